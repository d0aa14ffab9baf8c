#include "guidance/rail_vision/board_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "pose/calibrate/find_board.h"
#include "pose/centres/image_view.h"

namespace tbm {
namespace {

using Pixels = std::vector<Eigen::Vector2d>;

constexpr double kFloor_px = 0.02;
constexpr double kLeastPitch_px = 7.0;

Board FormOf(const SoughtBoard& board) {
  Board form;
  form.kind = BoardKind::kChessboard;
  form.columns = board.columns;
  form.rows = board.rows;
  form.pitch_m = 1.0;
  return form;
}

ImageView ViewOf(const cv::Mat& grey) {
  ImageView view;
  view.pixels = grey.data;
  view.width_px = grey.cols;
  view.height_px = grey.rows;
  view.stride_bytes = static_cast<int>(grey.step);
  return view;
}

// Place of a point on the board, in pitches.
Eigen::Vector2d OnBoard(const SoughtBoard& board, int point) {
  return {point % board.columns, point / board.columns};
}

// By the two surveyed points that are furthest from each other, or nearly so; 0 where there is but
// one.
double Pitch_m(std::span<const SoughtTarget> targets, const SoughtBoard& board) {
  const SoughtTarget& first = targets[board.targets.front()];
  double furthest = 0.0;
  double pitch_m = 0.0;
  for (const std::size_t target : board.targets) {
    const SoughtTarget& other = targets[target];
    const double pitches =
        (OnBoard(board, other.mark.point) - OnBoard(board, first.mark.point)).norm();
    if (pitches <= furthest) continue;
    furthest = pitches;
    pitch_m = (other.in_world_m - first.in_world_m).norm() / pitches;
  }
  return pitch_m;
}

// From a point to the end of the board's light rim, at most.
double Reach(const SoughtBoard& board, int point) {
  constexpr double kSquareAndRim = 2.0;
  const Eigen::Vector2d at = OnBoard(board, point);
  const Eigen::Vector2d last(board.columns - 1, board.rows - 1);
  return (at.cwiseMax(last - at) + Eigen::Vector2d::Constant(kSquareAndRim)).norm();
}

// Part of the image that surely holds the board if it is there at all: as far around each surveyed
// point as the board reaches, however it is turned.
std::optional<cv::Rect> WindowOf(const cv::Mat& grey,
                                 const CameraModel& camera,
                                 std::span<const SoughtTarget> targets,
                                 const SoughtBoard& board,
                                 const TargetGates& gates) {
  constexpr int kLeastSide_px = 16;
  const double pitch_m = Pitch_m(targets, board);
  Eigen::Array2d least(0.0, 0.0);
  Eigen::Array2d most(grey.cols, grey.rows);
  for (const std::size_t target : board.targets) {
    if (!gates.Expects(target)) return {};
    const auto gate = gates.At(target, 1.0);
    const double reach_m = pitch_m * Reach(board, targets[target].mark.point);
    // What comes nearer to the camera than the point is looks larger.
    const double nearest_m = camera.fx_px / gates.Expected(target).px_per_m - reach_m;
    if (!(reach_m > 0.0) || nearest_m < reach_m) continue;
    const double reach_px = camera.fx_px * reach_m / nearest_m + gate.HalfWidth_px();
    least = least.max(gate.pixel_px.array() - reach_px);
    most = most.min(gate.pixel_px.array() + reach_px);
  }
  if (!((most - least).minCoeff() >= kLeastSide_px)) return {};
  const Eigen::Array2i from = least.cast<int>();
  const Eigen::Array2i size = most.cast<int>() - from;
  return cv::Rect(from.x(), from.y(), size.x(), size.y());
}

// So that it is not found again. Not where it reaches the horizon of its plane: then it is found
// again, and is ambiguous.
void PaintOver(const SoughtBoard& board, const Pixels& pixels, cv::Mat* grey) {
  constexpr double kBeyond = 1.3;  // pitches: its outer squares
  std::vector<cv::Point2d> plane;
  std::vector<cv::Point2d> seen;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const Eigen::Vector2d at = OnBoard(board, static_cast<int>(i));
    plane.emplace_back(at.x(), at.y());
    seen.emplace_back(pixels[i].x(), pixels[i].y());
  }
  const cv::Mat image_from_plane = cv::findHomography(plane, seen);
  if (image_from_plane.empty()) return;
  const double right = board.columns - 1 + kBeyond;
  const double bottom = board.rows - 1 + kBeyond;
  const std::vector<cv::Point2d> corners = {
      {-kBeyond, -kBeyond}, {right, -kBeyond}, {right, bottom}, {-kBeyond, bottom}};
  std::vector<cv::Point2d> around;
  cv::perspectiveTransform(corners, around, image_from_plane);
  std::vector<cv::Point> outline;
  for (const cv::Point2d& p : around) {
    if (!(std::abs(p.x) < 1e4 && std::abs(p.y) < 1e4)) return;
    outline.emplace_back(cvRound(p.x), cvRound(p.y));
  }
  cv::fillConvexPoly(*grey, outline, cv::mean(*grey));
}

// How well the points lie on a plane, without the lens: rms of one coordinate.
double Scatter(const CameraModel& camera, const SoughtBoard& board, const Pixels& pixels) {
  std::vector<cv::Point2d> plane;
  std::vector<cv::Point2d> seen;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const auto ideal = NormalisedFromPixel(camera, pixels[i]);
    if (!ideal) return std::numeric_limits<double>::infinity();
    const Eigen::Vector2d at = OnBoard(board, static_cast<int>(i));
    plane.emplace_back(at.x(), at.y());
    seen.emplace_back(camera.fx_px * ideal->x(), camera.fy_px * ideal->y());
  }
  const cv::Mat seen_from_plane = cv::findHomography(plane, seen);
  if (seen_from_plane.empty()) return std::numeric_limits<double>::infinity();
  std::vector<cv::Point2d> expected;
  cv::perspectiveTransform(plane, expected, seen_from_plane);
  double sum = 0.0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const cv::Point2d off = seen[i] - expected[i];
    sum += off.dot(off);
  }
  return std::sqrt(sum / (2.0 * static_cast<double>(seen.size()) - 8.0));
}

// Whether all surveyed points lie in their gates when the board is counted so.
bool Fits(std::span<const SoughtTarget> targets,
          const SoughtBoard& board,
          const TargetGates& gates,
          const Pixels& pixels,
          double sigma_px) {
  return std::all_of(board.targets.begin(), board.targets.end(), [&](std::size_t target) {
    const auto point = static_cast<std::size_t>(targets[target].mark.point);
    return gates.At(target, sigma_px).Has(pixels[point]);
  });
}

// How surely the points rise in the image as they do in the world: 1 yes, -1 the other way round; 0
// where they hardly rise, and the survey's own errors would decide.
double RisesAsSurveyed(const CameraModel& camera,
                       std::span<const SoughtTarget> targets,
                       const SoughtBoard& board,
                       const Pixels& pixels,
                       const Eigen::Vector3d& up_in_camera) {
  constexpr double kLeastPitches = 0.5;
  constexpr double kLeastSigmas = 6.0;
  std::vector<std::pair<double, double>> rises;
  double least_m = kLeastPitches * Pitch_m(targets, board);
  double lowest_m = std::numeric_limits<double>::infinity();
  double highest_m = -lowest_m;
  double mean_z = 0.0;
  double mean_seen = 0.0;
  for (const std::size_t target : board.targets) {
    const auto point = static_cast<std::size_t>(targets[target].mark.point);
    const auto ideal = NormalisedFromPixel(camera, pixels[point]);
    if (!ideal) return 0.0;
    const Eigen::Vector2d up = up_in_camera.head<2>() - *ideal * up_in_camera.z();
    rises.emplace_back(targets[target].in_world_m.z(), ideal->dot(up.normalized()));
    least_m = std::max(least_m, kLeastSigmas * targets[target].sigma_m);
    lowest_m = std::min(lowest_m, rises.back().first);
    highest_m = std::max(highest_m, rises.back().first);
    mean_z += rises.back().first / static_cast<double>(board.targets.size());
    mean_seen += rises.back().second / static_cast<double>(board.targets.size());
  }
  if (!(highest_m - lowest_m >= least_m)) return 0.0;
  double both = 0.0;
  double z2 = 0.0;
  double seen2 = 0.0;
  for (const auto& [z, seen] : rises) {
    both += (z - mean_z) * (seen - mean_seen);
    z2 += (z - mean_z) * (z - mean_z);
    seen2 += (seen - mean_seen) * (seen - mean_seen);
  }
  return z2 > 0.0 && seen2 > 0.0 ? both / std::sqrt(z2 * seen2) : 0.0;
}

// Whether four sectors meet there, dark and light in turn, the same as their opposites.
bool IsCorner(const cv::Mat& grey, const Eigen::Vector2d& at_px, double radius_px) {
  constexpr int kPlaces = 32;
  constexpr double kLeastContrast_dn = 20.0;
  if (at_px.x() < radius_px + 1.0 || at_px.y() < radius_px + 1.0 ||
      at_px.x() > grey.cols - radius_px - 2.0 || at_px.y() > grey.rows - radius_px - 2.0) {
    return false;
  }
  std::array<double, kPlaces> ring{};
  for (int i = 0; i < kPlaces; ++i) {
    const double angle_rad = 2.0 * std::numbers::pi * i / kPlaces;
    const auto u = static_cast<int>(std::lround(at_px.x() + radius_px * std::cos(angle_rad)));
    const auto v = static_cast<int>(std::lround(at_px.y() + radius_px * std::sin(angle_rad)));
    ring[static_cast<std::size_t>(i)] = grey.at<unsigned char>(v, u);
  }
  const auto [low, high] = std::minmax_element(ring.begin(), ring.end());
  if (*high - *low < kLeastContrast_dn) return false;
  const double middle = 0.5 * (*high + *low);
  int changes = 0;
  int as_opposite = 0;
  for (std::size_t i = 0; i < kPlaces; ++i) {
    const bool is_light = ring[i] > middle;
    changes += is_light != (ring[(i + 1) % kPlaces] > middle) ? 1 : 0;
    as_opposite += is_light == (ring[(i + kPlaces / 2) % kPlaces] > middle) ? 1 : 0;
  }
  return changes == 4 && as_opposite >= kPlaces - 6;
}

// Two boards' points are two squares apart or more: where gates are narrower there is but one.
bool MayBeTwo(const SoughtBoard& board, const TargetGates& gates, const Pixels& pixels) {
  const auto columns = static_cast<std::size_t>(board.columns);
  double pitch_px = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if ((i + 1) % columns != 0) pitch_px = std::min(pitch_px, (pixels[i + 1] - pixels[i]).norm());
    if (i + columns < pixels.size()) {
      pitch_px = std::min(pitch_px, (pixels[i + columns] - pixels[i]).norm());
    }
  }
  return std::any_of(board.targets.begin(), board.targets.end(), [&](std::size_t target) {
    return gates.At(target, 0.0).HalfWidth_px() > 0.5 * pitch_px;
  });
}

// Whether there is one more. FindBoard's last resort takes minutes where a board of another form is
// in view, and is for the board that is sought.
bool HasAnother(const cv::Mat& grey, const SoughtBoard& board) {
  std::vector<cv::Point2f> corners;
  const cv::Size size(board.columns, board.rows);
  constexpr int kThorough =
      cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_EXHAUSTIVE | cv::CALIB_CB_ACCURACY;
  try {
    return cv::findChessboardCornersSB(grey, size, corners, cv::CALIB_CB_NORMALIZE_IMAGE) ||
           cv::findChessboardCornersSB(grey, size, corners, kThorough);
  } catch (const cv::Exception&) {
    // Its own geometry degenerates on what it took for a board.
    return false;
  }
}

// Which of the points is which, of a board that lies there.
BoardOutcome Counted(const CameraModel& camera,
                     std::span<const SoughtTarget> targets,
                     const SoughtBoard& board,
                     const TargetGates* gates,
                     const std::optional<Eigen::Vector3d>& up_in_camera,
                     Pixels pixels) {
  BoardOutcome outcome;
  const double sigma_px = std::hypot(Scatter(camera, board, pixels), kFloor_px);
  if (!std::isfinite(sigma_px)) return outcome;
  const Pixels turned(pixels.rbegin(), pixels.rend());
  const bool may_be_turned = LooksTheSameTurned(FormOf(board));
  bool is_as_found = true;
  if (gates != nullptr) {
    is_as_found = Fits(targets, board, *gates, pixels, sigma_px);
    const bool is_turned = may_be_turned && Fits(targets, board, *gates, turned, sigma_px);
    if (is_as_found == is_turned) {
      outcome.why = is_as_found ? TargetRefusal::kAmbiguous : TargetRefusal::kTooFar;
      if (is_as_found) outcome.corners_px = std::move(pixels);
      return outcome;
    }
  } else if (may_be_turned) {
    constexpr double kSure = 0.7;
    const double rises =
        up_in_camera ? RisesAsSurveyed(camera, targets, board, pixels, *up_in_camera) : 0.0;
    if (std::abs(rises) < kSure) {
      outcome.why = TargetRefusal::kAmbiguous;
      outcome.corners_px = std::move(pixels);
      return outcome;
    }
    is_as_found = rises > 0.0;
  }
  outcome.corners_px = is_as_found ? std::move(pixels) : turned;
  for (const std::size_t target : board.targets) {
    const auto point = static_cast<std::size_t>(targets[target].mark.point);
    outcome.seen.push_back({target, outcome.corners_px[point], sigma_px});
  }
  return outcome;
}

}  // namespace

std::vector<SoughtBoard> BoardsAmong(std::span<const SoughtTarget> targets) {
  std::vector<SoughtBoard> boards;
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const TargetMark& mark = targets[i].mark;
    if (mark.kind != TargetKind::kBoard) continue;
    auto known = std::find_if(boards.begin(), boards.end(), [&](const SoughtBoard& board) {
      return board.name == mark.board && board.columns == mark.columns && board.rows == mark.rows;
    });
    if (known == boards.end()) {
      known = boards.insert(boards.end(), {mark.board, mark.columns, mark.rows, {}});
    }
    known->targets.push_back(i);
  }
  return boards;
}

bool IsSameForm(const SoughtBoard& a, const SoughtBoard& b) {
  return std::minmax(a.columns, a.rows) == std::minmax(b.columns, b.rows);
}

bool HaveTheSame(const BoardOutcome& a, const BoardOutcome& b) {
  constexpr double kSame_px = 2.0;
  return std::any_of(a.corners_px.begin(), a.corners_px.end(), [&](const Eigen::Vector2d& p) {
    return std::any_of(b.corners_px.begin(), b.corners_px.end(), [&](const Eigen::Vector2d& q) {
      return (p - q).norm() < kSame_px;
    });
  });
}

BoardOutcome FindWholeBoard(const cv::Mat& grey,
                            const CameraModel& camera,
                            std::span<const SoughtTarget> targets,
                            const SoughtBoard& board,
                            const TargetGates* gates,
                            const std::optional<Eigen::Vector3d>& up_in_camera) {
  constexpr int kMostLooks = 8;
  BoardOutcome outcome;
  const auto window = gates != nullptr ? WindowOf(grey, camera, targets, board, *gates)
                                       : cv::Rect(0, 0, grey.cols, grey.rows);
  if (!window) return outcome;
  cv::Mat part = grey(*window).clone();
  for (int look = 0; look < kMostLooks; ++look) {
    if (look > 0 && !HasAnother(part, board)) return outcome;
    auto found = FindBoard(ViewOf(part), FormOf(board));
    if (!found) {
      const bool is_too_small = look == 0 && found.error() == FindBoardFailure::kTooSmall;
      if (is_too_small) outcome.why = TargetRefusal::kTooSmall;
      return outcome;
    }
    Pixels pixels = std::move(found).value();
    PaintOver(board, pixels, &part);
    for (Eigen::Vector2d& p : pixels) p += Eigen::Vector2d(window->x, window->y);
    BoardOutcome one = Counted(camera, targets, board, gates, up_in_camera, std::move(pixels));
    if (outcome.corners_px.empty()) {
      outcome = std::move(one);
    } else if (!one.corners_px.empty()) {
      outcome.seen.clear();
      outcome.why = TargetRefusal::kAmbiguous;
      outcome.corners_px.insert(
          outcome.corners_px.end(), one.corners_px.begin(), one.corners_px.end());
    }
    const bool is_alone = gates != nullptr && !outcome.corners_px.empty() &&
                          !MayBeTwo(board, *gates, outcome.corners_px);
    if (is_alone) return outcome;
  }
  return outcome;
}

std::vector<TargetSeen> FindBoardPoints(const cv::Mat& grey,
                                        std::span<const SoughtTarget> targets,
                                        const SoughtBoard& board,
                                        const TargetGates& gates) {
  constexpr double kWidestGate = 0.33;  // of the pitch
  constexpr double kSigma_px = 0.1;     // worse than of whole boards: what hides it casts shadows
  double pitch_px = std::numeric_limits<double>::infinity();
  for (const std::size_t a : board.targets) {
    for (const std::size_t b : board.targets) {
      const bool is_next = targets[b].mark.point == targets[a].mark.point + 1 &&
                           targets[b].mark.point % board.columns != 0;
      if (!is_next && targets[b].mark.point != targets[a].mark.point + board.columns) continue;
      const Eigen::Vector2d off_px = gates.At(a, 0.0).pixel_px - gates.At(b, 0.0).pixel_px;
      pitch_px = std::min(pitch_px, off_px.norm());
    }
  }
  std::vector<TargetSeen> seen;
  if (!(pitch_px < 1e6) || pitch_px < kLeastPitch_px) return seen;
  const int half = std::clamp(static_cast<int>(0.3 * pitch_px), 2, 10);
  for (const std::size_t target : board.targets) {
    const auto gate = gates.At(target, kSigma_px);
    if (gate.HalfWidth_px() > kWidestGate * pitch_px) continue;
    const Eigen::Vector2d& at_px = gate.pixel_px;
    if (at_px.x() < 2.0 * half || at_px.y() < 2.0 * half || at_px.x() > grey.cols - 2.0 * half ||
        at_px.y() > grey.rows - 2.0 * half) {
      continue;
    }
    std::vector<cv::Point2f> corner = {
        {static_cast<float>(at_px.x()), static_cast<float>(at_px.y())}};
    for (int round = 0; round < 2; ++round) {
      cv::cornerSubPix(grey,
                       corner,
                       {half, half},
                       {-1, -1},
                       {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 50, 1e-4});
    }
    const Eigen::Vector2d pixel_px(corner[0].x, corner[0].y);
    if (!gate.Has(pixel_px)) continue;
    if (!IsCorner(grey, pixel_px, 0.4 * pitch_px) || !IsCorner(grey, pixel_px, 0.2 * pitch_px)) {
      continue;
    }
    seen.push_back({target, pixel_px, kSigma_px});
  }
  return seen;
}

}  // namespace tbm
