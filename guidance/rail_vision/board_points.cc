#include "guidance/rail_vision/board_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "pose/calibrate/find_board.h"

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

// Part of the image that surely holds the board if it is there at all.
struct Window {
  int left = 0;
  int top = 0;
  int right = 0;  // one beyond
  int bottom = 0;
};
Window WholeOf(const ImageView& image) { return {0, 0, image.width_px, image.height_px}; }

std::optional<Window> WindowOf(const ImageView& image,
                               const SoughtBoard& board,
                               const TargetGates& gates) {
  Eigen::Vector2d least(1e9, 1e9);
  Eigen::Vector2d most(-1e9, -1e9);
  double gate_px = 0.0;
  for (const std::size_t target : board.targets) {
    if (!gates.Expects(target)) return {};
    const auto gate = gates.At(target, 1.0);
    least = least.cwiseMin(gate.pixel_px);
    most = most.cwiseMax(gate.pixel_px);
    gate_px = std::max(gate_px, gate.HalfWidth_px());
  }
  // Its outer squares and the rim around them belong to what the finder looks for.
  const double rim_px =
      gate_px + 2.0 * (most - least).maxCoeff() / (std::min(board.columns, board.rows) - 1);
  const auto clip = [](double at_px, int size_px) {
    return static_cast<int>(std::clamp(at_px, 0.0, static_cast<double>(size_px)));
  };
  const Window window{clip(least.x() - rim_px, image.width_px),
                      clip(least.y() - rim_px, image.height_px),
                      clip(most.x() + rim_px, image.width_px),
                      clip(most.y() + rim_px, image.height_px)};
  if (window.right - window.left < 16 || window.bottom - window.top < 16) return {};
  return window;
}

ImageView Part(const ImageView& image, const Window& window) {
  ImageView part = image;
  part.pixels = static_cast<const std::uint8_t*>(image.pixels) + window.top * image.stride_bytes +
                window.left * image.bytes_per_pixel;
  part.width_px = window.right - window.left;
  part.height_px = window.bottom - window.top;
  return part;
}

// How well the points lie on a plane, without the lens: rms of one coordinate.
double Scatter(const CameraModel& camera, const SoughtBoard& board, const Pixels& pixels) {
  std::vector<cv::Point2d> plane;
  std::vector<cv::Point2d> seen;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const auto ideal = NormalisedFromPixel(camera, pixels[i]);
    if (!ideal) return std::numeric_limits<double>::infinity();
    const auto columns = static_cast<std::size_t>(board.columns);
    plane.emplace_back(static_cast<double>(i % columns), static_cast<double>(i / columns));
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

// How surely the points rise in the image as they do in the world: 1 yes, -1 the other way round.
double RisesAsSurveyed(const CameraModel& camera,
                       std::span<const SoughtTarget> targets,
                       const SoughtBoard& board,
                       const Pixels& pixels,
                       const Eigen::Vector3d& up_in_camera) {
  std::vector<std::pair<double, double>> rises;
  double mean_z = 0.0;
  double mean_seen = 0.0;
  for (const std::size_t target : board.targets) {
    const auto point = static_cast<std::size_t>(targets[target].mark.point);
    const auto ideal = NormalisedFromPixel(camera, pixels[point]);
    if (!ideal) return 0.0;
    const Eigen::Vector2d up = up_in_camera.head<2>() - *ideal * up_in_camera.z();
    rises.emplace_back(targets[target].in_world_m.z(), ideal->dot(up.normalized()));
    mean_z += rises.back().first / static_cast<double>(board.targets.size());
    mean_seen += rises.back().second / static_cast<double>(board.targets.size());
  }
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

// Points of a board that is not seen whole: each in its own gate.
std::vector<TargetSeen> SinglePoints(const cv::Mat& grey,
                                     const SoughtBoard& board,
                                     std::span<const SoughtTarget> targets,
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

BoardOutcome FindBoardPoints(const ImageView& image,
                             const cv::Mat& grey,
                             const CameraModel& camera,
                             std::span<const SoughtTarget> targets,
                             const SoughtBoard& board,
                             const TargetGates* gates,
                             const std::optional<Eigen::Vector3d>& up_in_camera) {
  BoardOutcome outcome;
  const Board form = FormOf(board);
  const auto window = gates != nullptr ? WindowOf(image, board, *gates) : WholeOf(image);
  if (!window) return outcome;
  auto found = FindBoard(Part(image, *window), form);
  if (!found) {
    if (gates != nullptr) outcome.seen = SinglePoints(grey, board, targets, *gates);
    if (found.error() == FindBoardFailure::kTooSmall) outcome.why = TargetRefusal::kTooSmall;
    return outcome;
  }
  Pixels pixels = std::move(found).value();
  for (Eigen::Vector2d& p : pixels) p += Eigen::Vector2d(window->left, window->top);
  const double sigma_px = std::hypot(Scatter(camera, board, pixels), kFloor_px);
  const Pixels turned(pixels.rbegin(), pixels.rend());
  const bool may_be_turned = LooksTheSameTurned(form);
  bool is_as_found = true;
  if (gates != nullptr) {
    is_as_found = Fits(targets, board, *gates, pixels, sigma_px);
    const bool is_turned = may_be_turned && Fits(targets, board, *gates, turned, sigma_px);
    if (is_as_found == is_turned) {
      outcome.why = is_as_found ? TargetRefusal::kAmbiguous : TargetRefusal::kTooFar;
      return outcome;
    }
  } else if (may_be_turned) {
    constexpr double kSure = 0.7;
    const double rises =
        up_in_camera ? RisesAsSurveyed(camera, targets, board, pixels, *up_in_camera) : 0.0;
    if (std::abs(rises) < kSure) {
      outcome.why = TargetRefusal::kAmbiguous;
      return outcome;
    }
    is_as_found = rises > 0.0;
  }
  for (const std::size_t target : board.targets) {
    const auto point = static_cast<std::size_t>(targets[target].mark.point);
    outcome.seen.push_back({target, (is_as_found ? pixels : turned)[point], sigma_px});
  }
  return outcome;
}

}  // namespace tbm
