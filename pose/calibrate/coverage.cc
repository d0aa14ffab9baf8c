#include "pose/calibrate/coverage.h"

#include <algorithm>
#include <cmath>

namespace tbm {
namespace {

constexpr int kPartsAlong = 3;
constexpr int kCellsOfPart = Coverage::kCells / kPartsAlong;
// So that points lie in the outermost row and column of cells as well.
constexpr int kLeastCells = kCellsOfPart * kCellsOfPart - 1;

int CellOf(double pixel_px, int size_px) {
  // Pixel 0 reaches from -0.5 to 0.5.
  const double share = (pixel_px + 0.5) / size_px;
  return std::clamp(
      static_cast<int>(std::floor(share * Coverage::kCells)), 0, Coverage::kCells - 1);
}

std::size_t Index(int column, int row) {
  return static_cast<std::size_t>(row) * Coverage::kCells + static_cast<std::size_t>(column);
}

int CoveredCells(const Coverage& coverage, int part_column, int part_row) {
  int covered = 0;
  for (int row = 0; row < kCellsOfPart; ++row) {
    for (int column = 0; column < kCellsOfPart; ++column) {
      const std::size_t cell =
          Index(part_column * kCellsOfPart + column, part_row * kCellsOfPart + row);
      covered += coverage.points[cell] > 0 ? 1 : 0;
    }
  }
  return covered;
}

}  // namespace

const char* Name(ImagePart part) {
  constexpr std::array<const char*, kImageParts> kNames = {"upper left",
                                                           "upper middle",
                                                           "upper right",
                                                           "left",
                                                           "middle",
                                                           "right",
                                                           "lower left",
                                                           "lower middle",
                                                           "lower right"};
  return kNames[static_cast<std::size_t>(part)];
}

Coverage CoverageOf(std::span<const std::vector<Eigen::Vector2d>> views,
                    int image_width_px,
                    int image_height_px) {
  Coverage coverage;
  for (const auto& pixels : views) {
    for (const Eigen::Vector2d& pixel : pixels) {
      ++coverage
            .points[Index(CellOf(pixel.x(), image_width_px), CellOf(pixel.y(), image_height_px))];
    }
  }
  const auto covered = std::count_if(
      coverage.points.begin(), coverage.points.end(), [](int count) { return count > 0; });
  coverage.share = static_cast<double>(covered) / static_cast<double>(coverage.points.size());
  for (int part = 0; part < kImageParts; ++part) {
    if (CoveredCells(coverage, part % kPartsAlong, part / kPartsAlong) < kLeastCells) {
      coverage.missing.push_back(static_cast<ImagePart>(part));
    }
  }
  return coverage;
}

void SetTilts(std::span<const Rigid3> camera_from_boards, Coverage* coverage) {
  if (camera_from_boards.empty()) return;
  double about_u = 0.0;
  double about_v = 0.0;
  for (const Rigid3& camera_from_board : camera_from_boards) {
    const Eigen::Vector3d normal = camera_from_board.rotation * Eigen::Vector3d::UnitZ();
    about_u += std::pow(std::atan2(normal.y(), normal.z()), 2);
    about_v += std::pow(std::atan2(normal.x(), normal.z()), 2);
  }
  const double count = static_cast<double>(camera_from_boards.size());
  coverage->tilt_about_u_rad = std::sqrt(about_u / count);
  coverage->tilt_about_v_rad = std::sqrt(about_v / count);
}

std::string MissingPictures(const Coverage& coverage) {
  std::string text;
  for (std::size_t i = 0; i < coverage.missing.size(); ++i) {
    const bool is_last = i + 1 == coverage.missing.size();
    text += i == 0 ? "bring the board to the " : (is_last ? " and the " : ", the ");
    text += Name(coverage.missing[i]);
  }
  if (!text.empty()) text += " of the image";
  const auto add = [&text](const char* what) {
    if (!text.empty()) text += "; ";
    text += what;
  };
  const bool about_u = coverage.tilt_about_u_rad < Coverage::kLeastTilt_rad;
  const bool about_v = coverage.tilt_about_v_rad < Coverage::kLeastTilt_rad;
  if (about_u && about_v) {
    add("tilt it by 20 to 40 degrees both ways: its upper edge, then its left edge towards the "
        "camera and away; now it stands parallel to the image in all pictures");
  } else if (about_u) {
    add("tilt it so that its upper edge comes 20 to 40 degrees towards the camera, and away");
  } else if (about_v) {
    add("tilt it so that its left edge comes 20 to 40 degrees towards the camera, and away");
  }
  return text;
}

}  // namespace tbm
