#include "pose/calibrate/board_pose.h"

#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

namespace tbm {
namespace {

using Points = std::vector<Eigen::Vector3d>;
using CvPoints2 = std::vector<cv::Point2d>;

constexpr int kMostSteps = 30;
// The answers may be told apart when one leaves this much more than the other. Square sums: twice
// as much from a hundred coordinates is far beyond chance.
constexpr double kLeastRatio = 1.5;
constexpr double kSameTurn_rad = 0.02;

std::optional<CvPoints2> Undistorted(std::span<const Eigen::Vector2d> pixels,
                                     const CameraModel& camera) {
  CvPoints2 out;
  out.reserve(pixels.size());
  for (const Eigen::Vector2d& pixel : pixels) {
    const auto point = NormalisedFromPixel(camera, pixel);
    if (!point) return std::nullopt;
    out.emplace_back(point->x(), point->y());
  }
  return out;
}

Rigid3 PoseOf(const cv::Mat& turn, const cv::Mat& shift) {
  const Eigen::Vector3d turn_rad(turn.at<double>(0), turn.at<double>(1), turn.at<double>(2));
  return {ExpRotation(turn_rad), {shift.at<double>(0), shift.at<double>(1), shift.at<double>(2)}};
}

std::vector<Rigid3> Starts(const Points& points, const CvPoints2& seen) {
  std::vector<cv::Point3d> object;
  object.reserve(points.size());
  for (const Eigen::Vector3d& p : points) object.emplace_back(p.x(), p.y(), p.z());
  std::vector<cv::Mat> turns;
  std::vector<cv::Mat> shifts;
  std::vector<Rigid3> starts;
  try {
    cv::solvePnPGeneric(
        object, seen, cv::Matx33d::eye(), cv::noArray(), turns, shifts, false, cv::SOLVEPNP_IPPE);
  } catch (const cv::Exception&) {
    return starts;
  }
  for (std::size_t i = 0; i < turns.size(); ++i) {
    const Rigid3 start = PoseOf(turns[i], shifts[i]);
    if (start.rotation.coeffs().allFinite() && start.translation.allFinite()) {
      starts.push_back(start);
    }
  }
  return starts;
}

std::optional<BoardPose> Refined(const Board& board,
                                 const Points& points,
                                 std::span<const Eigen::Vector2d> pixels,
                                 const CameraModel& camera,
                                 Rigid3 pose) {
  auto normal = LinearisedView(board, points, pixels, camera, pose);
  for (int step = 0; normal && step < kMostSteps; ++step) {
    PoseError e = normal->by_pose.ldlt().solve(normal->pull_pose);
    if (!e.allFinite()) return std::nullopt;
    auto next = LinearisedView(board, points, pixels, camera, Moved(pose, e));
    for (int half = 0; half < 8 && (!next || next->sum_px2 > normal->sum_px2); ++half) {
      e *= 0.5;
      next = LinearisedView(board, points, pixels, camera, Moved(pose, e));
    }
    if (!next || next->sum_px2 > normal->sum_px2) break;
    pose = Moved(pose, e);
    normal = std::move(next);
    if (e.norm() < 1e-12) break;
  }
  if (!normal) return std::nullopt;
  BoardPose found;
  found.camera_from_board = pose;
  found.cofactor = normal->by_pose.inverse();
  if (!found.cofactor.allFinite() || !(found.cofactor.diagonal().minCoeff() > 0.0)) {
    return std::nullopt;
  }
  found.sum_px2 = normal->sum_px2;
  found.dof = 2 * static_cast<int>(points.size()) - 6;
  found.residuals_px = std::move(normal->residuals_px);
  return found;
}

double TurnBetweenPoses(const BoardPose& a, const BoardPose& b) {
  return a.camera_from_board.rotation.angularDistance(b.camera_from_board.rotation);
}

}  // namespace

const char* Text(BoardPoseFailure failure) {
  switch (failure) {
    case BoardPoseFailure::kBeyondLens:
      return "the board reaches to where the camera's distortion cannot be undone: is --camera "
             "that "
             "of this camera?";
    case BoardPoseFailure::kNoPose:
      return "no placement of the board fits its points";
    case BoardPoseFailure::kTwoPoses:
      return "two placements of the board fit alike: come nearer, or tilt it";
  }
  return "";
}

Result<BoardPose, BoardPoseFailure> PlaceBoard(const Board& board,
                                               std::span<const Eigen::Vector2d> pixels,
                                               const CameraModel& camera) {
  const Points points = BoardPoints(board);
  if (pixels.size() != points.size()) return Failure{BoardPoseFailure::kNoPose};
  const auto seen = Undistorted(pixels, camera);
  if (!seen) return Failure{BoardPoseFailure::kBeyondLens};
  std::optional<BoardPose> best;
  std::optional<BoardPose> second;
  for (const Rigid3& start : Starts(points, *seen)) {
    auto found = Refined(board, points, pixels, camera, start);
    if (!found) continue;
    if (!best || found->sum_px2 < best->sum_px2) std::swap(best, found);
    if (found && (!second || found->sum_px2 < second->sum_px2)) second = std::move(found);
  }
  if (!best) return Failure{BoardPoseFailure::kNoPose};
  if (second && TurnBetweenPoses(*best, *second) > kSameTurn_rad &&
      second->sum_px2 < kLeastRatio * best->sum_px2) {
    return Failure{BoardPoseFailure::kTwoPoses};
  }
  return std::move(*best);
}

}  // namespace tbm
