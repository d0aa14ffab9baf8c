#include "pose/calibrate/find_board.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <utility>

#include <Eigen/LU>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "pose/calibrate/grey_mat.h"

namespace tbm {
namespace {

using CvPoints = std::vector<cv::Point2f>;
using Pixels = std::vector<Eigen::Vector2d>;

constexpr int kLeastSide_px = 16;
constexpr double kLeastDistance_px = 5.0;

// From each point to its nearest neighbour.
std::vector<double> NearestDistances(const CvPoints& points) {
  std::vector<double> distances(points.size(), std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const double distance_px = cv::norm(points[i] - points[j]);
      distances[i] = std::min(distances[i], distance_px);
      distances[j] = std::min(distances[j], distance_px);
    }
  }
  return distances;
}

std::optional<CvPoints> ChessboardCorners(const cv::Mat& grey, cv::Size size) {
  CvPoints corners;
  const bool is_seen =
      cv::findChessboardCornersSB(grey, size, corners, cv::CALIB_CB_NORMALIZE_IMAGE) ||
      cv::findChessboardCornersSB(
          grey,
          size,
          corners,
          cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_EXHAUSTIVE | cv::CALIB_CB_ACCURACY) ||
      cv::findChessboardCorners(
          grey,
          size,
          corners,
          cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK);
  if (!is_seen || corners.size() != static_cast<std::size_t>(size.area())) return std::nullopt;
  // The window must end before the next corner's edges begin.
  const auto distances = NearestDistances(corners);
  const double nearest_px = *std::min_element(distances.begin(), distances.end());
  const int half = std::clamp(static_cast<int>(0.35 * nearest_px), 2, 10);
  cv::cornerSubPix(grey,
                   corners,
                   {half, half},
                   {-1, -1},
                   {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 50, 1e-4});
  return corners;
}

cv::Ptr<cv::SimpleBlobDetector> BlobFinder(const cv::Mat& grey, bool is_dark, int circles) {
  cv::SimpleBlobDetector::Params params;
  params.thresholdStep = 10.0f;
  params.minThreshold = 20.0f;
  params.maxThreshold = 240.0f;
  params.minDistBetweenBlobs = 4.0f;
  params.filterByColor = true;
  params.blobColor = is_dark ? 0 : 255;
  params.filterByArea = true;
  params.minArea = 12.0f;
  params.maxArea = static_cast<float>(grey.total()) / static_cast<float>(circles);
  params.filterByCircularity = false;
  params.filterByInertia = true;
  params.minInertiaRatio = 0.1f;  // seen from the side a circle is three times as long as wide
  params.filterByConvexity = true;
  params.minConvexity = 0.8f;
  return cv::SimpleBlobDetector::create(params);
}

// Middle of the area of the circle around `start`, each pixel by how much of it is circle: grey
// values between that of the middle and that of the surroundings, noise of both cut off.
cv::Point2d MiddleOfArea(const cv::Mat& grey, cv::Point2d start, double radius_px) {
  constexpr double kCutOff = 0.15;
  constexpr double kLeastContrast_dn = 10.0;
  const int left = std::max(0, static_cast<int>(std::floor(start.x - radius_px)));
  const int right = std::min(grey.cols - 1, static_cast<int>(std::ceil(start.x + radius_px)));
  const int top = std::max(0, static_cast<int>(std::floor(start.y - radius_px)));
  const int bottom = std::min(grey.rows - 1, static_cast<int>(std::ceil(start.y + radius_px)));
  double inside = 0.0;
  double inside_count = 0.0;
  std::vector<double> around;
  for (int v = top; v <= bottom; ++v) {
    for (int u = left; u <= right; ++u) {
      const double from_middle = std::hypot(u - start.x, v - start.y);
      const double value = grey.at<unsigned char>(v, u);
      if (from_middle <= std::max(1.0, 0.1 * radius_px)) {
        inside += value;
        inside_count += 1.0;
      } else if (from_middle > 0.85 * radius_px && from_middle <= radius_px) {
        around.push_back(value);
      }
    }
  }
  if (inside_count == 0.0 || around.empty()) return start;
  inside /= inside_count;
  std::nth_element(around.begin(),
                   around.begin() + static_cast<std::ptrdiff_t>(around.size() / 2),
                   around.end());
  const double outside = around[around.size() / 2];
  if (std::abs(inside - outside) < kLeastContrast_dn) return start;
  double sum = 0.0;
  double sum_u = 0.0;
  double sum_v = 0.0;
  for (int v = top; v <= bottom; ++v) {
    for (int u = left; u <= right; ++u) {
      if (std::hypot(u - start.x, v - start.y) > radius_px) continue;
      const double share = (grey.at<unsigned char>(v, u) - outside) / (inside - outside);
      const double weight = std::clamp((share - kCutOff) / (1.0 - 2.0 * kCutOff), 0.0, 1.0);
      sum += weight;
      sum_u += weight * u;
      sum_v += weight * v;
    }
  }
  if (sum <= 0.0) return start;
  return {sum_u / sum, sum_v / sum};
}

// Whether a plane seen by a lens looks so. A grid finder that has lost its way among blobs is off
// by whole distances, a lens only bends.
bool LooksFlat(const CvPoints& found, const Board& board) {
  constexpr double kMostOff = 0.3;  // of the distance to the nearest point
  CvPoints plane;
  for (const Eigen::Vector3d& p : BoardPoints(board)) {
    plane.emplace_back(static_cast<float>(p.x() / board.pitch_m),
                       static_cast<float>(p.y() / board.pitch_m));
  }
  const cv::Mat image_from_plane = cv::findHomography(plane, found);
  if (image_from_plane.empty()) return false;
  CvPoints expected;
  cv::perspectiveTransform(plane, expected, image_from_plane);
  const auto distances = NearestDistances(found);
  for (std::size_t i = 0; i < found.size(); ++i) {
    if (!(cv::norm(found[i] - expected[i]) < kMostOff * distances[i])) return false;
  }
  return true;
}

std::optional<CvPoints> CircleCentres(const cv::Mat& grey, cv::Size size, const Board& board) {
  const int grid = board.kind == BoardKind::kAsymmetricCircles ? cv::CALIB_CB_ASYMMETRIC_GRID
                                                               : cv::CALIB_CB_SYMMETRIC_GRID;
  for (const bool is_dark : {true, false}) {
    const auto blobs = BlobFinder(grey, is_dark, size.area());
    for (const int more : {0, static_cast<int>(cv::CALIB_CB_CLUSTERING)}) {
      CvPoints centres;
      if (!cv::findCirclesGrid(grey, size, centres, grid | more, blobs)) continue;
      if (centres.size() != static_cast<std::size_t>(size.area())) continue;
      if (!LooksFlat(centres, board)) continue;
      const auto distances = NearestDistances(centres);
      for (std::size_t i = 0; i < centres.size(); ++i) {
        const double radius_px = 0.5 * distances[i];
        const cv::Point2d once = MiddleOfArea(grey, centres[i], radius_px);
        centres[i] = MiddleOfArea(grey, once, radius_px);
      }
      return centres;
    }
  }
  return std::nullopt;
}

std::size_t IndexOf(const Board& board, int column, int row) {
  return static_cast<std::size_t>(row) * static_cast<std::size_t>(board.columns) +
         static_cast<std::size_t>(column);
}

// Whether rows and columns turn as on the board, not as in a mirror.
bool IsRightHanded(const Board& board, const Pixels& pixels) {
  Eigen::Matrix2d sides;
  sides.col(0) = pixels[IndexOf(board, board.columns - 1, 0)] - pixels[0];
  sides.col(1) = pixels[IndexOf(board, 0, board.rows - 1)] - pixels[0];
  return sides.determinant() > 0.0;
}

// A finder may count the rows of a board, or the points of a row, from the wrong end.
bool MakeRightHanded(const Board& board, Pixels* pixels) {
  if (IsRightHanded(board, *pixels)) return true;
  if (board.kind == BoardKind::kAsymmetricCircles && board.rows % 2 == 0) return false;
  for (int row = 0; row < board.rows / 2; ++row) {
    for (int column = 0; column < board.columns; ++column) {
      std::swap((*pixels)[IndexOf(board, column, row)],
                (*pixels)[IndexOf(board, column, board.rows - 1 - row)]);
    }
  }
  return true;
}

// How much brighter the squares are that lie as the first one does.
double BrighterThanOthers(const cv::Mat& grey, const Board& board, const Pixels& pixels) {
  double difference = 0.0;
  for (int row = 0; row + 1 < board.rows; ++row) {
    for (int column = 0; column + 1 < board.columns; ++column) {
      const Eigen::Vector2d middle =
          0.25 *
          (pixels[IndexOf(board, column, row)] + pixels[IndexOf(board, column + 1, row)] +
           pixels[IndexOf(board, column, row + 1)] + pixels[IndexOf(board, column + 1, row + 1)]);
      const int u = std::clamp(static_cast<int>(std::lround(middle.x())), 0, grey.cols - 1);
      const int v = std::clamp(static_cast<int>(std::lround(middle.y())), 0, grey.rows - 1);
      const double value = grey.at<unsigned char>(v, u);
      difference += (row + column) % 2 == 0 ? value : -value;
    }
  }
  return difference;
}

Result<Pixels, FindBoardFailure> FindIn(const cv::Mat& grey, const Board& board) {
  const cv::Size size(board.columns, board.rows);
  const auto found = board.kind == BoardKind::kChessboard ? ChessboardCorners(grey, size)
                                                          : CircleCentres(grey, size, board);
  if (!found || !LooksFlat(*found, board)) return Failure{FindBoardFailure::kNotSeen};
  const auto distances = NearestDistances(*found);
  if (!(*std::min_element(distances.begin(), distances.end()) >= kLeastDistance_px)) {
    return Failure{FindBoardFailure::kTooSmall};
  }
  Pixels pixels;
  pixels.reserve(found->size());
  for (const cv::Point2f& point : *found) pixels.emplace_back(point.x, point.y);
  if (!MakeRightHanded(board, &pixels)) return Failure{FindBoardFailure::kNotSeen};
  if (board.kind == BoardKind::kChessboard && !LooksTheSameTurned(board) &&
      BrighterThanOthers(grey, board, pixels) > 0.0) {
    std::reverse(pixels.begin(), pixels.end());
  }
  return pixels;
}

}  // namespace

const char* Text(FindBoardFailure failure) {
  switch (failure) {
    case FindBoardFailure::kNotSeen:
      return "the board is not seen whole in it: part of it covered, out of the image, too steep "
             "or "
             "blurred, or --board counts other points";
    case FindBoardFailure::kTooSmall:
      return "the board is too far away: its points are closer than five pixels";
    case FindBoardFailure::kNoImage:
      return "has hardly any pixels";
  }
  return "";
}

Result<Pixels, FindBoardFailure> FindBoard(const ImageView& image, const Board& board) {
  if (image.pixels == nullptr || image.width_px < kLeastSide_px ||
      image.height_px < kLeastSide_px) {
    return Failure{FindBoardFailure::kNoImage};
  }
  try {
    return FindIn(GreyOf(image), board);
  } catch (const cv::Exception&) {
    // OpenCV throws where its own geometry degenerates on what it took for a board.
    return Failure{FindBoardFailure::kNotSeen};
  }
}

}  // namespace tbm
