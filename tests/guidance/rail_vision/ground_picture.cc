#include "tests/guidance/rail_vision/ground_picture.h"

#include <cmath>

namespace tbm::test {
namespace {

double Hashed(std::uint64_t seed, std::int64_t x, std::int64_t y) {
  std::uint64_t h = seed ^ (static_cast<std::uint64_t>(x) * 0x9E3779B97F4A7C15ull) ^
                    (static_cast<std::uint64_t>(y) * 0xC2B2AE3D27D4EB4Full);
  h ^= h >> 29;
  h *= 0xBF58476D1CE4E5B9ull;
  h ^= h >> 32;
  h *= 0x94D049BB133111EBull;
  h ^= h >> 29;
  return static_cast<double>(h >> 11) * 0x1.0p-53;
}

double Smooth(double t) { return t * t * (3.0 - 2.0 * t); }

double Grain(std::uint64_t seed, double x, double y) {
  const double column = std::floor(x);
  const double row = std::floor(y);
  const auto i = static_cast<std::int64_t>(column);
  const auto j = static_cast<std::int64_t>(row);
  const double a = Smooth(x - column);
  const double b = Smooth(y - row);
  return (1.0 - b) * ((1.0 - a) * Hashed(seed, i, j) + a * Hashed(seed, i + 1, j)) +
         b * ((1.0 - a) * Hashed(seed, i, j + 1) + a * Hashed(seed, i + 1, j + 1));
}

}  // namespace

CameraModel GroundCamera() {
  CameraModel camera;
  camera.image_width_px = 640;
  camera.image_height_px = 480;
  camera.fx_px = 801.0;
  camera.fy_px = 800.2;
  camera.cx_px = 321.3;
  camera.cy_px = 238.8;
  camera.k1 = -0.08;
  return camera;
}

Eigen::Quaterniond LookingDown() {
  Eigen::Matrix3d world_from_camera;
  world_from_camera << 0.0, -1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, -1.0;
  return Eigen::Quaterniond(world_from_camera);
}

Patch GroundPatch(std::uint64_t seed) {
  Patch ground;
  ground.half_x_m = 20.0;
  ground.half_y_m = 20.0;
  ground.places = 2;
  ground.is_even = false;
  ground.light = [seed](double x_m, double y_m) {
    double light = 0.45;
    double share = 0.5;
    std::uint64_t octave = seed;
    for (double grain_m = 0.03; grain_m > 0.002; grain_m *= 0.5) {
      light += share * (Grain(++octave, x_m / grain_m, y_m / grain_m) - 0.5);
      share *= 0.8;
    }
    return light < 0.0 ? 0.0 : light > 1.0 ? 1.0 : light;
  };
  return ground;
}

}  // namespace tbm::test
