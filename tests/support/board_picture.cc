#include "tests/support/board_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <numbers>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "pose/base/angle.h"
#include "pose/base/check.h"

namespace tbm::test {
namespace {

constexpr double kPaper_dn = 215.0;
constexpr double kInk_dn = 40.0;
constexpr double kWall_dn = 110.0;

bool IsOdd(double number) { return std::fmod(std::abs(number), 2.0) > 0.5; }

// In pitches from the first point.
bool IsInk(const Board& board, double x, double y) {
  if (board.kind == BoardKind::kChessboard) {
    const bool is_square = x > -1.0 && y > -1.0 && x < board.columns && y < board.rows;
    return is_square && !IsOdd(std::floor(x) + std::floor(y));
  }
  const double radius = 0.5 * board.diameter_m.value_or(0.4 * board.pitch_m) / board.pitch_m;
  const bool is_asymmetric = board.kind == BoardKind::kAsymmetricCircles;
  for (int off = -1; off <= 1; ++off) {
    const double row = std::round(y) + off;
    if (row < 0.0 || row >= board.rows) continue;
    const double from = is_asymmetric && IsOdd(row) ? 1.0 : 0.0;
    const double step = is_asymmetric ? 2.0 : 1.0;
    const double column = std::round((x - from) / step);
    if (column < 0.0 || column >= board.columns) continue;
    if (std::hypot(x - from - step * column, y - row) < radius) return true;
  }
  return false;
}

double Brightness(const Board& board, double x_m, double y_m) {
  const double x = x_m / board.pitch_m;
  const double y = y_m / board.pitch_m;
  const double width =
      board.kind == BoardKind::kAsymmetricCircles ? 2.0 * board.columns : board.columns;
  const bool is_on_paper = x > -1.8 && y > -1.8 && x < width + 0.8 && y < board.rows + 0.8;
  if (!is_on_paper) return kWall_dn;
  return IsInk(board, x, y) ? kInk_dn : kPaper_dn;
}

Eigen::Vector2d PixelOf(const CameraModel& camera, const Eigen::Vector3d& p_in_camera) {
  const auto seen = Project(camera, p_in_camera);
  TBM_CHECK(seen.has_value());
  return seen->pixel_px;
}

Eigen::Vector2d MiddleOfPolygon(const std::vector<Eigen::Vector2d>& corners) {
  double twice_area = 0.0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d a = corners[i] - corners[0];
    const Eigen::Vector2d b = corners[(i + 1) % corners.size()] - corners[0];
    const double cross = a.x() * b.y() - a.y() * b.x();
    twice_area += cross;
    sum += cross * (a + b);
  }
  return corners[0] + sum / (3.0 * twice_area);
}

std::vector<double> Blurred(
    const std::vector<double>& light, int width_px, int height_px, int step_u, int step_v) {
  // A Gaussian of 0.6 px.
  constexpr std::array<double, 3> kWeights = {0.6638, 0.1655, 0.0026};
  const auto at = [&](int u, int v) {
    const int column = std::clamp(u, 0, width_px - 1);
    const int row = std::clamp(v, 0, height_px - 1);
    return light[static_cast<std::size_t>(row) * static_cast<std::size_t>(width_px) +
                 static_cast<std::size_t>(column)];
  };
  std::vector<double> blurred;
  blurred.reserve(light.size());
  for (int v = 0; v < height_px; ++v) {
    for (int u = 0; u < width_px; ++u) {
      double value = kWeights[0] * at(u, v);
      for (int k = 1; k < 3; ++k) {
        value += kWeights[static_cast<std::size_t>(k)] *
                 (at(u + k * step_u, v + k * step_v) + at(u - k * step_u, v - k * step_v));
      }
      blurred.push_back(value);
    }
  }
  return blurred;
}

}  // namespace

CameraModel BoardCamera() {
  CameraModel camera;
  camera.image_width_px = 640;
  camera.image_height_px = 480;
  camera.fx_px = 612.4;
  camera.fy_px = 611.1;
  camera.cx_px = 323.7;
  camera.cy_px = 236.2;
  camera.k1 = -0.12;
  camera.k2 = 0.07;
  camera.p1 = 0.0006;
  camera.p2 = -0.0004;
  return camera;
}

BoardPainter::BoardPainter(const CameraModel& camera) : camera_(camera) {
  for (int v = 0; v <= camera.image_height_px; ++v) {
    for (int u = 0; u <= camera.image_width_px; ++u) {
      const auto ray = NormalisedFromPixel(camera, {u - 0.5, v - 0.5});
      TBM_CHECK(ray.has_value());
      rays_.push_back(*ray);
    }
  }
}

std::vector<std::uint8_t> BoardPainter::Paint(const Board& board,
                                              const Rigid3& camera_from_board,
                                              double noise_dn,
                                              Random& random,
                                              bool is_negative) const {
  constexpr int kPlaces = 6;
  Eigen::Matrix3d image_from_plane = camera_from_board.rotation.toRotationMatrix();
  image_from_plane.col(2) = camera_from_board.translation;
  const Eigen::Matrix3d plane_from_image = image_from_plane.inverse();
  const auto brightness = [&](const Eigen::Vector2d& ray) {
    const Eigen::Vector3d on_board = plane_from_image * ray.homogeneous();
    return Brightness(board, on_board.x() / on_board.z(), on_board.y() / on_board.z());
  };
  std::vector<double> corners;
  for (const Eigen::Vector2d& ray : rays_) corners.push_back(brightness(ray));
  const auto stride = static_cast<std::size_t>(camera_.image_width_px) + 1;
  std::vector<double> light;
  for (int v = 0; v < camera_.image_height_px; ++v) {
    for (int u = 0; u < camera_.image_width_px; ++u) {
      const std::size_t at = static_cast<std::size_t>(v) * stride + static_cast<std::size_t>(u);
      double value = corners[at];
      // Only where an edge passes: figures are much larger than pixels.
      if (corners[at + 1] != value || corners[at + stride] != value ||
          corners[at + stride + 1] != value) {
        const Eigen::Vector2d along = rays_[at + 1] - rays_[at];
        const Eigen::Vector2d down = rays_[at + stride] - rays_[at];
        value = 0.0;
        for (int i = 0; i < kPlaces * kPlaces; ++i) {
          const Eigen::Vector2d ray = rays_[at] + (i % kPlaces + 0.5) / kPlaces * along +
                                      (i / kPlaces + 0.5) / kPlaces * down;
          value += brightness(ray) / (kPlaces * kPlaces);
        }
      }
      light.push_back(is_negative ? 255.0 - value : value);
    }
  }
  // A lens is never sharper than this: along rows, then along columns.
  light = Blurred(light, camera_.image_width_px, camera_.image_height_px, 1, 0);
  light = Blurred(light, camera_.image_width_px, camera_.image_height_px, 0, 1);
  std::vector<std::uint8_t> pixels;
  pixels.reserve(light.size());
  for (const double value : light) {
    const double noisy = std::round(value + random.Normal(noise_dn));
    pixels.push_back(static_cast<std::uint8_t>(std::clamp(noisy, 0.0, 255.0)));
  }
  return pixels;
}

ImageView BoardPainter::View(const std::vector<std::uint8_t>& pixels) const {
  ImageView view;
  view.pixels = pixels.data();
  view.width_px = camera_.image_width_px;
  view.height_px = camera_.image_height_px;
  view.stride_bytes = camera_.image_width_px;
  return view;
}

Rigid3 Placed(const Board& board, const CameraModel& camera, const BoardPlace& place) {
  const auto points = BoardPoints(board);
  const Eigen::Vector3d far_corner = points.back();
  Rigid3 camera_from_board;
  camera_from_board.rotation =
      Eigen::AngleAxisd(DegToRad(place.roll_deg), Eigen::Vector3d::UnitZ()) *
      Eigen::AngleAxisd(DegToRad(place.tilt_v_deg), Eigen::Vector3d::UnitY()) *
      Eigen::AngleAxisd(DegToRad(place.tilt_u_deg), Eigen::Vector3d::UnitX());
  // A board that is tall takes its share of the height.
  const double z_m =
      std::max(camera.fx_px * far_corner.x() / (place.share * camera.image_width_px),
               camera.fy_px * far_corner.y() / (1.2 * place.share * camera.image_height_px));
  camera_from_board.translation =
      Eigen::Vector3d(0.0, 0.0, z_m) - camera_from_board.rotation * (0.5 * far_corner);
  const Eigen::Array2d last(camera.image_width_px - 1.0, camera.image_height_px - 1.0);
  for (int i = 0; i < 12; ++i) {
    Eigen::Array2d least = last;
    Eigen::Array2d most(0.0, 0.0);
    for (const Eigen::Vector3d& p : points) {
      const Eigen::Array2d pixel = PixelOf(camera, camera_from_board * p).array();
      least = least.min(pixel);
      most = most.max(pixel);
    }
    const std::array<int, 2> along = {place.along_u, place.along_v};
    for (Eigen::Index k = 0; k < 2; ++k) {
      const int side = along[static_cast<std::size_t>(k)];
      const double off_px = side < 0   ? place.margin_px - least(k)
                            : side > 0 ? last(k) - place.margin_px - most(k)
                                       : 0.5 * (last(k) - least(k) - most(k));
      camera_from_board.translation(k) += off_px * z_m / camera.fx_px;
    }
  }
  return camera_from_board;
}

std::vector<Rigid3> GoodPlacements(const Board& board,
                                   const CameraModel& camera,
                                   int count,
                                   Random& random) {
  std::vector<Rigid3> placements;
  for (int i = 0; i < count; ++i) {
    BoardPlace place;
    place.along_u = i % 3 - 1;
    place.along_v = i / 3 % 3 - 1;
    place.share = random.Uniform(0.42, 0.55);
    const double tilt_deg = (i / 2 % 2 == 0 ? 1.0 : -1.0) * random.Uniform(18.0, 35.0);
    const double other_deg = random.Uniform(-8.0, 8.0);
    place.tilt_u_deg = i % 2 == 0 ? tilt_deg : other_deg;
    place.tilt_v_deg = i % 2 == 0 ? other_deg : tilt_deg;
    place.roll_deg = random.Uniform(-12.0, 12.0);
    placements.push_back(Placed(board, camera, place));
  }
  return placements;
}

std::vector<Eigen::Vector2d> TruePixels(const Board& board,
                                        const CameraModel& camera,
                                        const Rigid3& camera_from_board) {
  constexpr int kCorners = 256;
  std::vector<Eigen::Vector2d> pixels;
  for (const Eigen::Vector3d& p : BoardPoints(board)) {
    if (!board.diameter_m) {
      pixels.push_back(PixelOf(camera, camera_from_board * p));
      continue;
    }
    std::vector<Eigen::Vector2d> edge;
    for (int k = 0; k < kCorners; ++k) {
      const double angle_rad = 2.0 * std::numbers::pi * k / kCorners;
      const Eigen::Vector3d at(std::cos(angle_rad), std::sin(angle_rad), 0.0);
      edge.push_back(PixelOf(camera, camera_from_board * (p + 0.5 * *board.diameter_m * at)));
    }
    pixels.push_back(MiddleOfPolygon(edge));
  }
  return pixels;
}

void WritePicture(const std::string& path, const ImageView& image) {
  std::ofstream stream(path, std::ios::binary);
  stream << "P5\n" << image.width_px << " " << image.height_px << "\n255\n";
  stream.write(static_cast<const char*>(image.pixels),
               static_cast<std::streamsize>(image.width_px) * image.height_px);
}

}  // namespace tbm::test
