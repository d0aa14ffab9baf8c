#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

#include <opencv2/imgproc.hpp>

#include "guidance/rail_vision/edge_fit.h"
#include "guidance/rail_vision/found_mark.h"

namespace tbm {
namespace {

// Where a cell is hardly wider than the lens' blur, what is in the next one moves the edge.
constexpr double kFloor_px = 0.01;
constexpr double kNextCell_px3 = 0.3;  // over the square of a cell's width
constexpr double kCells = 6.0;         // along a side: four of the code, two of the border
constexpr double kMostMove_px = 3.0;
constexpr double kMostRms_px = 0.35;

// The code cells of ArUco's dictionary 4x4_50, row by row, light is 1. Any two differ in four cells
// or more, however they are turned.
constexpr std::array<std::uint16_t, 50> kCodeCells = {
    0xB532, 0x0F9A, 0x332D, 0x9946, 0x549E, 0x79CD, 0x9E2E, 0xC4F2, 0xFEDA, 0xCF56,
    0xF991, 0x11A7, 0x0EB7, 0x2A0F, 0x24B1, 0x263E, 0x4665, 0x6600, 0x6C5E, 0x76AF,
    0x868B, 0xB02B, 0xCCD5, 0xDD82, 0xFE47, 0x9471, 0xACE4, 0xA554, 0x2123, 0x346F,
    0x4415, 0x57B2, 0x9ECF, 0xF0CB, 0x08AE, 0x0929, 0x1875, 0x04FF, 0x0DF6, 0x1C5A,
    0x1718, 0x2A28, 0x328C, 0x38B2, 0x24E8, 0x2EEB, 0x2D3F, 0x4B64, 0x502E, 0x5013};
constexpr int kMostWrongCells = 1;

// Clockwise in the image, any first.
using Corners = std::array<Eigen::Vector2d, 4>;

// Convex four-sided outlines of what is darker than its surroundings.
std::vector<Corners> DarkSquares(const cv::Mat& grey) {
  constexpr double kDarker_dn = 7.0;
  constexpr double kLeastSide_px = 8.0;
  constexpr double kStraight = 0.04;  // how far an outline may leave its sides, of its length
  std::vector<Corners> squares;
  for (const int window_px : {11, 23, 61}) {
    if (window_px >= std::min(grey.cols, grey.rows)) continue;
    cv::Mat mask;
    cv::adaptiveThreshold(grey,
                          mask,
                          255.0,
                          cv::ADAPTIVE_THRESH_MEAN_C,
                          cv::THRESH_BINARY_INV,
                          window_px,
                          kDarker_dn);
    std::vector<std::vector<cv::Point>> outlines;
    cv::findContours(mask, outlines, cv::RETR_LIST, cv::CHAIN_APPROX_NONE);
    for (const auto& outline : outlines) {
      if (static_cast<double>(outline.size()) < 4.0 * kLeastSide_px) continue;
      std::vector<cv::Point> corners;
      cv::approxPolyDP(outline, corners, kStraight * static_cast<double>(outline.size()), true);
      if (corners.size() != 4 || !cv::isContourConvex(corners)) continue;
      if (cv::contourArea(corners, true) < 0.0) std::reverse(corners.begin(), corners.end());
      Corners square;
      double shortest_px = grey.cols;
      for (std::size_t i = 0; i < 4; ++i) {
        square[i] = {static_cast<double>(corners[i].x), static_cast<double>(corners[i].y)};
        shortest_px = std::min(shortest_px, cv::norm(corners[i] - corners[(i + 1) % 4]));
      }
      if (shortest_px >= kLeastSide_px) squares.push_back(square);
    }
  }
  return squares;
}

// Grey values around the middles of `side` by `side` cells of which the inner kCells by kCells fill
// the square. Empty where the image ends before.
std::vector<double> CellValues(const cv::Mat& grey, const Corners& corners_px, int side) {
  std::array<cv::Point2f, 4> to;
  for (std::size_t i = 0; i < 4; ++i) {
    to[i] = {static_cast<float>(corners_px[i].x()), static_cast<float>(corners_px[i].y())};
  }
  const auto cells = static_cast<float>(kCells);
  const std::array<cv::Point2f, 4> from = {
      cv::Point2f(0, 0), cv::Point2f(cells, 0), cv::Point2f(cells, cells), cv::Point2f(0, cells)};
  const cv::Mat image_from_cells = cv::getPerspectiveTransform(from.data(), to.data());
  std::vector<cv::Point2d> middles;
  const double first = 0.5 * (kCells - side) + 0.5;
  for (int i = 0; i < side * side; ++i) middles.emplace_back(first + i % side, first + i / side);
  std::vector<cv::Point2d> at;
  cv::perspectiveTransform(middles, at, image_from_cells);
  std::vector<double> values;
  for (const cv::Point2d& p : at) {
    const auto u = static_cast<int>(std::lround(p.x));
    const auto v = static_cast<int>(std::lround(p.y));
    if (u < 1 || v < 1 || u >= grey.cols - 1 || v >= grey.rows - 1) return {};
    values.push_back(cv::mean(grey(cv::Rect(u - 1, v - 1, 3, 3)))[0]);
  }
  return values;
}

double MedianOf(std::vector<double> values) {
  std::nth_element(values.begin(),
                   values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

// The four by four cells turned by a quarter, as ReadCode counts them.
unsigned Turned(unsigned cells) {
  unsigned turned = 0;
  for (int i = 0; i < 16; ++i) {
    const int from = 4 * (i % 4) + 3 - i / 4;
    turned = 2 * turned + (cells >> (15 - from) & 1u);
  }
  return turned;
}

// The code on a square: a light rim, a dark border, and cells of the dictionary, however turned.
std::optional<int> ReadCode(const cv::Mat& grey, const Corners& corners_px) {
  constexpr double kLeastContrast_dn = 15.0;
  constexpr int kWithRim = 8;
  const std::vector<double> values = CellValues(grey, corners_px, kWithRim);
  if (values.empty()) return {};
  const auto at = [&](int row, int column) {
    return values[static_cast<std::size_t>(row * kWithRim + column)];
  };
  std::vector<double> rim;
  std::vector<double> border;
  for (int i = 0; i < kWithRim; ++i) {
    for (const double value : {at(0, i), at(7, i), at(i, 0), at(i, 7)}) rim.push_back(value);
    if (i == 0 || i == 7) continue;
    for (const double value : {at(1, i), at(6, i), at(i, 1), at(i, 6)}) border.push_back(value);
  }
  const double middle = 0.5 * (MedianOf(rim) + MedianOf(border));
  if (MedianOf(rim) - MedianOf(border) < kLeastContrast_dn) return {};
  const auto light =
      std::count_if(border.begin(), border.end(), [&](double value) { return value > middle; });
  if (light > 2) return {};
  unsigned cells = 0;
  for (int i = 0; i < 16; ++i) cells = 2 * cells + (at(2 + i / 4, 2 + i % 4) > middle ? 1u : 0u);
  // How it is turned nobody asks: the middle stays where it is.
  for (int turn = 0; turn < 4; ++turn) {
    for (std::size_t code = 0; code < kCodeCells.size(); ++code) {
      if (std::popcount(cells ^ kCodeCells[code]) <= kMostWrongCells) return static_cast<int>(code);
    }
    cells = Turned(cells);
  }
  return {};
}

// Points of one side's edge, in the ideal image plane times f.
std::optional<LineFit> Side(const cv::Mat& grey,
                            const CameraModel& camera,
                            const Eigen::Vector2d& from_px,
                            const Eigen::Vector2d& to_px,
                            const Eigen::Vector2d& middle_px) {
  constexpr double kWithinCell = 0.65;  // the next one may be light
  constexpr double kLeftOut = 0.1;      // at either corner
  const Eigen::Vector2d along = to_px - from_px;
  const double length_px = along.norm();
  if (length_px < 0.5 * kLeastMarker_px) return {};
  Eigen::Vector2d outward = Eigen::Vector2d(along.y(), -along.x()) / length_px;
  if (outward.dot(from_px - middle_px) < 0.0) outward = -outward;
  // From the side to the middle it is three cells, however the marker is turned away.
  const double cell_px = 2.0 * std::abs(outward.dot(from_px - middle_px)) / kCells;
  const double reach_px = std::clamp(kWithinCell * cell_px, 1.5, 4.0);
  const auto count = static_cast<int>(std::clamp(0.6 * length_px, 8.0, 64.0));
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < count; ++i) {
    const double part = kLeftOut + (1.0 - 2.0 * kLeftOut) * i / (count - 1);
    const Eigen::Vector2d at_px = from_px + part * along;
    const auto edge_px = EdgeAlong(grey, at_px, outward, reach_px);
    if (!edge_px) continue;
    const auto ideal = NormalisedFromPixel(camera, at_px + *edge_px * outward);
    if (ideal) points.emplace_back(camera.fx_px * *ideal);
  }
  if (static_cast<double>(points.size()) < 0.66 * count) return {};
  return FitLine(std::move(points));
}

struct Square {
  Corners corners;  // in the ideal image plane times f
  double rms_px = 0.0;
  double points = 0.0;
};

std::optional<Square> FitSquare(const cv::Mat& grey,
                                const CameraModel& camera,
                                const Corners& corners_px) {
  Eigen::Vector2d middle_px = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& corner : corners_px) middle_px += 0.25 * corner;
  std::array<LineFit, 4> sides;
  double sum = 0.0;
  Square square;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto side = Side(grey, camera, corners_px[i], corners_px[(i + 1) % 4], middle_px);
    if (!side) return {};
    sides[i] = *side;
    sum += side->sum_squared;
    square.points += static_cast<double>(side->kept);
  }
  square.rms_px = std::sqrt(sum / (square.points - 8.0));
  for (std::size_t i = 0; i < 4; ++i) {
    const auto corner = Meeting(sides[(i + 3) % 4], sides[i]);
    if (!corner) return {};
    square.corners[i] = *corner;
  }
  return square;
}

struct Measured {
  FoundMark mark;
  Corners corners_px;
};

std::optional<Measured> Measure(const cv::Mat& grey,
                                const CameraModel& camera,
                                const Corners& found_px) {
  // The first fit brings the profiles onto the edges, the second measures.
  Corners corners_px = found_px;
  std::optional<Square> square;
  for (int round = 0; round < 2; ++round) {
    square = FitSquare(grey, camera, corners_px);
    if (!square || square->rms_px > kMostRms_px) return {};
    for (std::size_t i = 0; i < 4; ++i) {
      corners_px[i] = PixelFromNormalised(camera, square->corners[i] / camera.fx_px);
      if ((corners_px[i] - found_px[i]).norm() > kMostMove_px) return {};
    }
  }
  const auto line = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    LineFit through;
    through.normal = Eigen::Vector2d(b.y() - a.y(), a.x() - b.x()).normalized();
    through.offset = through.normal.dot(a);
    return through;
  };
  const auto middle = Meeting(line(square->corners[0], square->corners[2]),
                              line(square->corners[1], square->corners[3]));
  if (!middle) return {};
  Measured measured;
  measured.corners_px = corners_px;
  FoundMark& mark = measured.mark;
  mark.pixel_px = PixelFromNormalised(camera, *middle / camera.fx_px);
  // The diagonals meet where the sides' offsets put them (variance s^2 / 2n for n points a side)
  // and where their slopes do (2.34 s^2 / n with a tenth left out at either corner).
  constexpr double kByPoints = 4.0 * (0.5 + 2.34);
  const double sigma_px = square->rms_px * std::sqrt(kByPoints / square->points);
  double longest_px = 0.0;
  double area_px2 = 0.0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d& a = square->corners[i];
    const Eigen::Vector2d& b = square->corners[(i + 1) % 4];
    longest_px = std::max(longest_px, (b - a).norm());
    area_px2 += 0.5 * (a.x() * b.y() - a.y() * b.x());
  }
  const double cell_px = std::abs(area_px2) / longest_px / kCells;
  mark.sigma_px = std::hypot(sigma_px, kFloor_px + kNextCell_px3 / (cell_px * cell_px));
  return measured;
}

}  // namespace

FoundCodes FindCodes(const cv::Mat& grey, const CameraModel& camera) {
  constexpr double kSame_px = 3.0;
  FoundCodes found;
  for (const Corners& corners_px : DarkSquares(grey)) {
    double shortest_px = grey.cols;
    for (std::size_t i = 0; i < 4; ++i) {
      shortest_px = std::min(shortest_px, (corners_px[i] - corners_px[(i + 1) % 4]).norm());
    }
    if (shortest_px < kLeastMarker_px) {
      if (const auto code = ReadCode(grey, corners_px)) found.too_small.push_back(*code);
      continue;
    }
    // The sides where they are measured to be; as they were found where they cannot be.
    const auto measured = Measure(grey, camera, corners_px);
    const auto code = ReadCode(grey, measured ? measured->corners_px : corners_px);
    if (!code) continue;
    if (!measured) {
      found.unclear.push_back(*code);
      continue;
    }
    // The same marker, as another window shows it.
    const bool is_known =
        std::any_of(found.marks.begin(), found.marks.end(), [&](const FoundMark& other) {
          return other.code == *code &&
                 (other.pixel_px - measured->mark.pixel_px).norm() < kSame_px;
        });
    if (is_known) continue;
    found.marks.push_back(measured->mark);
    found.marks.back().code = *code;
  }
  return found;
}

}  // namespace tbm
