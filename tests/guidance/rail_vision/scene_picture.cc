#include "tests/guidance/rail_vision/scene_picture.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>

#include <Eigen/LU>
#include <opencv2/aruco.hpp>

#include "pose/base/check.h"

namespace tbm::test {
namespace {

constexpr double kPaper = 0.92;
constexpr double kInk = 0.12;
constexpr double kHole = std::numeric_limits<double>::quiet_NaN();

std::vector<double> Blurred(
    const std::vector<double>& light, int width_px, int height_px, bool is_across, double sigma) {
  const int half = static_cast<int>(std::ceil(4.0 * sigma));
  std::vector<double> weights;
  double sum = 0.0;
  for (int k = -half; k <= half; ++k) {
    weights.push_back(std::exp(-0.5 * k * k / (sigma * sigma)));
    sum += weights.back();
  }
  std::vector<double> blurred(light.size(), 0.0);
  for (int v = 0; v < height_px; ++v) {
    for (int u = 0; u < width_px; ++u) {
      double value = 0.0;
      for (int k = -half; k <= half; ++k) {
        const int column = is_across ? std::clamp(u + k, 0, width_px - 1) : u;
        const int row = is_across ? v : std::clamp(v + k, 0, height_px - 1);
        value += weights[static_cast<std::size_t>(k + half)] / sum *
                 light[static_cast<std::size_t>(row * width_px + column)];
      }
      blurred[static_cast<std::size_t>(v * width_px + u)] = value;
    }
  }
  return blurred;
}

}  // namespace

Patch CirclePatch(const Rigid3& world_from_patch, double diameter_m, bool is_light) {
  const double half_m = 0.85 * diameter_m;
  return {world_from_patch, half_m, half_m, [=](double x_m, double y_m) {
            const bool is_disc = std::hypot(x_m, y_m) < 0.5 * diameter_m;
            return is_disc != is_light ? kInk : kPaper;
          }};
}

Patch CodedPatch(const Rigid3& world_from_patch, double side_m, int code) {
  cv::Mat cells;
  cv::aruco::drawMarker(cv::aruco::getPredefinedDictionary(cv::aruco::DICT_4X4_50), code, 6, cells);
  const double half_m = side_m * 4.5 / 6.0;
  return {world_from_patch, half_m, half_m, [=](double x_m, double y_m) {
            const auto column = static_cast<int>(std::floor(6.0 * (x_m / side_m + 0.5)));
            const auto row = static_cast<int>(std::floor(6.0 * (y_m / side_m + 0.5)));
            if (column < 0 || row < 0 || column > 5 || row > 5) return kPaper;
            return cells.at<unsigned char>(row, column) == 0 ? kInk : kPaper;
          }};
}

Patch BoardPatch(const Rigid3& world_from_patch, int columns, int rows, double pitch_m) {
  const double half_x_m = (columns + 1.0) * pitch_m;
  const double half_y_m = (rows + 1.0) * pitch_m;
  Rigid3 middle = world_from_patch;
  const Eigen::Vector3d to_middle(0.5 * (columns - 1) * pitch_m, 0.5 * (rows - 1) * pitch_m, 0.0);
  middle.translation = world_from_patch * to_middle;
  return {middle, half_x_m, half_y_m, [=](double x_m, double y_m) {
            const double x = (x_m + to_middle.x()) / pitch_m;
            const double y = (y_m + to_middle.y()) / pitch_m;
            if (x <= -1.8 || y <= -1.8 || x >= columns + 0.8 || y >= rows + 0.8) return kHole;
            if (x <= -1.0 || y <= -1.0 || x >= columns || y >= rows) return kPaper;
            const auto square = static_cast<int>(std::floor(x) + std::floor(y));
            return square % 2 == 0 ? kInk : kPaper;
          }};
}

Patch PlainPatch(const Rigid3& world_from_patch, double half_x_m, double half_y_m, double light) {
  return {world_from_patch, half_x_m, half_y_m, [=](double, double) { return light; }};
}

ScenePainter::ScenePainter(const CameraModel& camera) : camera_(camera) {
  for (int v = 0; v <= camera.image_height_px; ++v) {
    for (int u = 0; u <= camera.image_width_px; ++u) {
      const auto ray = NormalisedFromPixel(camera, {u - 0.5, v - 0.5});
      TBM_CHECK(ray.has_value());
      rays_.push_back(*ray);
    }
  }
}

void ScenePainter::Lay(const Patch& patch,
                       const Rigid3& camera_from_world,
                       std::vector<double>* light) const {
  const Rigid3 camera_from_patch = camera_from_world * patch.world_from_patch;
  Eigen::Vector2d least(1e9, 1e9);
  Eigen::Vector2d most(-1e9, -1e9);
  for (int corner = 0; corner < 4; ++corner) {
    const Eigen::Vector3d at(corner % 2 == 0 ? patch.half_x_m : -patch.half_x_m,
                             corner / 2 == 0 ? patch.half_y_m : -patch.half_y_m,
                             0.0);
    const Eigen::Vector3d in_camera = camera_from_patch * at;
    // What reaches behind the camera, or beyond what the lens' polynomial knows, may be anywhere.
    if (in_camera.z() < 0.05 || in_camera.hnormalized().norm() > 1.5) {
      least = {-1e9, -1e9};
      most = {1e9, 1e9};
      break;
    }
    const Eigen::Vector2d pixel = PixelFromNormalised(camera_, in_camera.hnormalized());
    least = least.cwiseMin(pixel);
    most = most.cwiseMax(pixel);
  }
  const auto clip = [](double at, int size) {
    return static_cast<int>(std::clamp(at, 0.0, static_cast<double>(size)));
  };
  const int left = clip(least.x() - 12.0, camera_.image_width_px);
  const int right = clip(most.x() + 12.0, camera_.image_width_px);
  const int top = clip(least.y() - 12.0, camera_.image_height_px);
  const int bottom = clip(most.y() + 12.0, camera_.image_height_px);
  Eigen::Matrix3d image_from_plane = camera_from_patch.rotation.toRotationMatrix();
  image_from_plane.col(2) = camera_from_patch.translation;
  const Eigen::Matrix3d plane_from_image = image_from_plane.inverse();
  const auto light_of = [&](const Eigen::Vector2d& ray) {
    const Eigen::Vector3d on = plane_from_image * ray.homogeneous();
    if (on.z() <= 0.0) return kHole;
    const double x_m = on.x() / on.z();
    const double y_m = on.y() / on.z();
    if (std::abs(x_m) > patch.half_x_m || std::abs(y_m) > patch.half_y_m) return kHole;
    return patch.light(x_m, y_m);
  };
  const auto same = [](double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); };
  const auto stride = static_cast<std::size_t>(camera_.image_width_px) + 1;
  for (int v = top; v < bottom; ++v) {
    for (int u = left; u < right; ++u) {
      const std::size_t at = static_cast<std::size_t>(v) * stride + static_cast<std::size_t>(u);
      double& pixel = (*light)[static_cast<std::size_t>(v * camera_.image_width_px + u)];
      const double first = light_of(rays_[at]);
      if (patch.is_even && same(light_of(rays_[at + 1]), first) &&
          same(light_of(rays_[at + stride]), first) &&
          same(light_of(rays_[at + stride + 1]), first)) {
        if (!std::isnan(first)) pixel = first;
        continue;
      }
      const Eigen::Vector2d along = rays_[at + 1] - rays_[at];
      const Eigen::Vector2d down = rays_[at + stride] - rays_[at];
      const int count = patch.places;
      double sum = 0.0;
      for (int i = 0; i < count * count; ++i) {
        const double value = light_of(rays_[at] + (i % count + 0.5) / count * along +
                                      (i / count + 0.5) / count * down);
        sum += std::isnan(value) ? pixel : value;
      }
      pixel = sum / (count * count);
    }
  }
}

std::vector<std::uint8_t> ScenePainter::Paint(const Scenery& scenery,
                                              const Rigid3& camera_from_world,
                                              Random& random) const {
  const int width_px = camera_.image_width_px;
  const int height_px = camera_.image_height_px;
  std::vector<double> light(static_cast<std::size_t>(width_px * height_px), scenery.wall);
  for (const Patch& patch : scenery.patches) Lay(patch, camera_from_world, &light);
  for (int v = 0; v < height_px; ++v) {
    for (int u = 0; u < width_px; ++u) {
      light[static_cast<std::size_t>(v * width_px + u)] *=
          scenery.full_dn(static_cast<double>(u) / width_px, static_cast<double>(v) / height_px);
    }
  }
  light = Blurred(light, width_px, height_px, true, scenery.blur_px);
  light = Blurred(light, width_px, height_px, false, scenery.blur_px);
  for (const Lamp& lamp : scenery.lamps) {
    const auto seen = Project(camera_, camera_from_world * lamp.in_world_m);
    if (!seen) continue;
    const int half = static_cast<int>(std::ceil(5.0 * lamp.spread_px));
    const auto u0 = static_cast<int>(std::lround(seen->pixel_px.x()));
    const auto v0 = static_cast<int>(std::lround(seen->pixel_px.y()));
    for (int v = std::max(0, v0 - half); v <= std::min(height_px - 1, v0 + half); ++v) {
      for (int u = std::max(0, u0 - half); u <= std::min(width_px - 1, u0 + half); ++u) {
        const double r2 = (Eigen::Vector2d(u, v) - seen->pixel_px).squaredNorm();
        light[static_cast<std::size_t>(v * width_px + u)] +=
            lamp.peak_dn * std::exp(-0.5 * r2 / (lamp.spread_px * lamp.spread_px));
      }
    }
  }
  std::vector<std::uint8_t> pixels;
  pixels.reserve(light.size());
  for (const double value : light) {
    const double noisy = std::round(value + random.Normal(scenery.noise_dn));
    pixels.push_back(static_cast<std::uint8_t>(std::clamp(noisy, 0.0, 255.0)));
  }
  return pixels;
}

ImageView ScenePainter::View(const std::vector<std::uint8_t>& pixels) const {
  ImageView view;
  view.pixels = pixels.data();
  view.width_px = camera_.image_width_px;
  view.height_px = camera_.image_height_px;
  view.stride_bytes = camera_.image_width_px;
  return view;
}

CameraModel TrolleyCamera() {
  CameraModel camera;
  camera.image_width_px = 960;
  camera.image_height_px = 720;
  camera.fx_px = 1051.3;
  camera.fy_px = 1049.8;
  camera.cx_px = 483.1;
  camera.cy_px = 357.4;
  camera.k1 = -0.11;
  camera.k2 = 0.06;
  camera.p1 = 0.0005;
  camera.p2 = -0.0003;
  return camera;
}

Rigid3 LookingAt(const Eigen::Vector3d& at, const Eigen::Vector3d& to) {
  Eigen::Matrix3d world_from_camera;
  world_from_camera.col(2) = (to - at).normalized();
  world_from_camera.col(0) = world_from_camera.col(2).cross(Eigen::Vector3d::UnitZ()).normalized();
  world_from_camera.col(1) = world_from_camera.col(2).cross(world_from_camera.col(0));
  return Inverse({Eigen::Quaterniond(world_from_camera), at});
}

Rigid3 Facing(const Eigen::Vector3d& at,
              const Eigen::Vector3d& viewer,
              const Eigen::Vector3d& turns) {
  const Rigid3 towards = Inverse(LookingAt(viewer, at));
  const Eigen::Quaterniond turned = Eigen::AngleAxisd(turns.z(), Eigen::Vector3d::UnitZ()) *
                                    Eigen::AngleAxisd(turns.y(), Eigen::Vector3d::UnitY()) *
                                    Eigen::AngleAxisd(turns.x(), Eigen::Vector3d::UnitX());
  return {towards.rotation * turned, at};
}

ExpectedImage ExpectedFrom(const CameraModel& camera,
                           const Rigid3& camera_from_world,
                           const PoseCovariance& covariance,
                           const std::vector<SoughtTarget>& targets) {
  ExpectedImage expected;
  expected.covariance = covariance;
  expected.focal_px = camera.fx_px;
  for (const SoughtTarget& target : targets) {
    const auto seen = Project(camera, camera_from_world * target.in_world_m);
    if (!seen) {
      expected.targets.emplace_back();
      continue;
    }
    ExpectedPixel pixel;
    pixel.pixel_px = seen->pixel_px;
    pixel.by_state = seen->by_point_px_per_m * PointByError(camera_from_world, target.in_world_m);
    pixel.px_per_m = camera.fx_px / (camera_from_world * target.in_world_m).z();
    expected.targets.push_back(pixel);
  }
  return expected;
}

void WritePicture(const std::string& path, const ImageView& image) {
  std::ofstream stream(path, std::ios::binary);
  stream << "P5\n" << image.width_px << " " << image.height_px << "\n255\n";
  stream.write(static_cast<const char*>(image.pixels),
               static_cast<std::streamsize>(image.width_px) * image.height_px);
}

}  // namespace tbm::test
