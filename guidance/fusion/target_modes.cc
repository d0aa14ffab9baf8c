#include "guidance/fusion/target_modes.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "pose/base/angle.h"

namespace tbm {
namespace {

// Of a long run so many views, and beside them one of each target that none of them shows.
constexpr std::size_t kMostViews = 100;
// What gyros and inclinometer know of the attitude between images, at worst and at best: where they
// know much, other combinations matter than where the targets alone tell it.
const std::array<double, 2> kAttitudeSigmas_rad = {DegToRad(0.05), DegToRad(0.001)};
// What is known of the place without the image: one target does not tell how far away it is.
constexpr double kPlaceSigma_m = 0.01;
// An attitude error is worth what it does to a target at this distance.
constexpr double kReach_m = 2.5;
// Combinations that move the camera by less are left out.
constexpr double kLeastEffect_m = 2e-6;

using Matrix6 = Eigen::Matrix<double, 6, 6>;
// Columns: coordinates of the view's targets, each in units of its sigma.
using Answer = Eigen::Matrix<double, 6, Eigen::Dynamic>;
using Answers = std::array<Answer, kAttitudeSigmas_rad.size()>;

// What the targets of a view say of the camera's place (3 rows, m, axes of the world) and attitude
// (3 rows, axes of the camera, times kReach_m), and how their coordinates pull at it.
struct Said {
  Matrix6 information = Matrix6::Zero();
  Answer pull;
};

Said SaidBy(const TargetView& view,
            const CameraModel& camera,
            double residual_px,
            const std::vector<SurveyedTarget>& targets) {
  Said said;
  said.pull.setZero(6, static_cast<Eigen::Index>(3 * view.targets.size()));
  const Eigen::Matrix3d camera_from_world = view.camera_from_world.rotation.toRotationMatrix();
  const double weight = 1.0 / (residual_px * residual_px);
  for (std::size_t i = 0; i < view.targets.size(); ++i) {
    const SurveyedTarget& one = targets[static_cast<std::size_t>(view.targets[i])];
    const Eigen::Vector3d in_camera = view.camera_from_world * one.in_world_m;
    const auto projection = Project(camera, in_camera);
    if (!projection) continue;
    const Eigen::Matrix<double, 2, 3> by_target = projection->by_point_px_per_m * camera_from_world;
    Eigen::Matrix<double, 2, 6> by_pose;
    by_pose.leftCols<3>() = -by_target;
    by_pose.rightCols<3>() = -projection->by_point_px_per_m * Skew(in_camera) / kReach_m;
    said.information += weight * by_pose.transpose() * by_pose;
    said.pull.middleCols<3>(static_cast<Eigen::Index>(3 * i)) =
        -weight * by_pose.transpose() * by_target * one.sigma_m;
  }
  said.information.diagonal().head<3>().array() += 1.0 / (kPlaceSigma_m * kPlaceSigma_m);
  return said;
}

// How place and attitude answer where the attitude is known beside; `attitude`: the inverse of its
// covariance, axes of the camera.
Answer AnswerOf(const Said& said, const Eigen::Matrix3d& attitude) {
  Matrix6 information = said.information;
  information.bottomRightCorner<3, 3>() += attitude / (kReach_m * kReach_m);
  return information.ldlt().solve(said.pull);
}

Answers AnswersOf(const Said& said) {
  Answers answers;
  for (std::size_t k = 0; k < answers.size(); ++k) {
    const double sigma_rad = kAttitudeSigmas_rad[k];
    answers[k] = AnswerOf(said, Eigen::Matrix3d::Identity() / (sigma_rad * sigma_rad));
  }
  return answers;
}

// The same views for the same run: evenly over all of them, and of each target that none of these
// shows the one in the middle of those that do.
std::vector<const TargetView*> Picked(std::span<const TargetView> views, std::size_t targets) {
  const std::size_t count = std::min(views.size(), kMostViews);
  std::vector<const TargetView*> picked;
  std::vector<bool> is_shown(targets, false);
  const auto pick = [&](const TargetView& view) {
    picked.push_back(&view);
    for (const int target : view.targets) is_shown[static_cast<std::size_t>(target)] = true;
  };
  for (std::size_t i = 0; i < count; ++i) {
    pick(views[count == 1 ? 0 : i * (views.size() - 1) / (count - 1)]);
  }
  std::vector<std::vector<std::size_t>> shown_by(targets);
  for (std::size_t i = 0; i < views.size(); ++i) {
    for (const int target : views[i].targets) {
      shown_by[static_cast<std::size_t>(target)].push_back(i);
    }
  }
  for (std::size_t target = 0; target < targets; ++target) {
    const std::vector<std::size_t>& by = shown_by[target];
    if (!is_shown[target] && !by.empty()) pick(views[by[by.size() / 2]]);
  }
  return picked;
}

// Columns of the view's targets among those of all.
std::vector<Eigen::Index> ColumnsOf(const TargetView& view) {
  std::vector<Eigen::Index> columns;
  for (const int target : view.targets) {
    for (Eigen::Index i = 0; i < 3; ++i) columns.push_back(3 * target + i);
  }
  return columns;
}

}  // namespace

TargetModes FindTargetModes(std::span<const TargetView> views,
                            const CameraModel& camera,
                            double residual_px,
                            int most,
                            std::vector<SurveyedTarget>* targets) {
  for (SurveyedTarget& target : *targets) target.by_mode.resize(3, 0);
  if (views.empty()) return {};

  const std::vector<const TargetView*> picked = Picked(views, targets->size());
  const double per_view = 1.0 / static_cast<double>(picked.size());
  const auto size = static_cast<Eigen::Index>(3 * targets->size());
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(size, size);
  for (const TargetView* view : picked) {
    const std::vector<Eigen::Index> columns = ColumnsOf(*view);
    for (const Answer& answer : AnswersOf(SaidBy(*view, camera, residual_px, *targets))) {
      const Eigen::MatrixXd square = per_view * (answer.transpose() * answer);
      gram(columns, columns) += square;
    }
  }
  // Principal axes of what moves the camera: largest last.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(gram);
  TargetModes modes;
  while (modes.count < std::min<Eigen::Index>(most, size) &&
         axes.eigenvalues()[size - 1 - modes.count] > kLeastEffect_m * kLeastEffect_m) {
    ++modes.count;
  }
  const Eigen::MatrixXd taken = axes.eigenvectors().rightCols(modes.count).rowwise().reverse();
  for (std::size_t t = 0; t < targets->size(); ++t) {
    SurveyedTarget& target = (*targets)[t];
    target.by_mode = target.sigma_m * taken.middleRows<3>(static_cast<Eigen::Index>(3 * t));
  }

  std::array<Eigen::Vector3d, kAttitudeSigmas_rad.size()> left_m2;
  left_m2.fill(Eigen::Vector3d::Zero());
  for (const TargetView* view : picked) {
    const Eigen::MatrixXd here = taken(ColumnsOf(*view), Eigen::all);
    const Answers answers = AnswersOf(SaidBy(*view, camera, residual_px, *targets));
    for (std::size_t k = 0; k < answers.size(); ++k) {
      const auto place = answers[k].topRows<3>();
      // The columns of `taken` are orthonormal: what they explain goes off the squares.
      left_m2[k] +=
          per_view *
          (place.rowwise().squaredNorm() - (place * here).rowwise().squaredNorm()).cwiseMax(0.0);
    }
  }
  modes.left_out_m = left_m2[0].cwiseMax(left_m2[1]).cwiseSqrt();
  return modes;
}

Eigen::Vector3d SurveySigma(const TargetView& view,
                            const CameraModel& camera,
                            double residual_px,
                            double level_sigma_rad,
                            const std::vector<SurveyedTarget>& targets) {
  const double heading_rad = kAttitudeSigmas_rad[0];
  const Eigen::Vector3d known = Eigen::Vector3d(level_sigma_rad, level_sigma_rad, heading_rad);
  const Eigen::Matrix3d camera_from_world = view.camera_from_world.rotation.toRotationMatrix();
  const Answer answer = AnswerOf(SaidBy(view, camera, residual_px, targets),
                                 camera_from_world * known.cwiseAbs2().cwiseInverse().asDiagonal() *
                                     camera_from_world.transpose());
  return answer.topRows<3>().rowwise().norm();
}

}  // namespace tbm
