#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "guidance/rail_vision/find_targets.h"
#include "guidance/rail_vision/ground_motion.h"

namespace {

tbm::CameraModel Camera(int width_px, int height_px) {
  tbm::CameraModel camera;
  camera.image_width_px = width_px;
  camera.image_height_px = height_px;
  camera.fx_px = 100.0;
  camera.fy_px = 100.0;
  camera.cx_px = 0.5 * width_px;
  camera.cy_px = 0.5 * height_px;
  camera.k1 = -0.1;
  return camera;
}

}  // namespace

// An image of any pixels, with a target of each kind somewhere in it.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr int kWidth_px = 96;
  if (size < 2 + kWidth_px * 32) return 0;
  const int height_px = static_cast<int>((size - 2) / kWidth_px);
  tbm::ImageView image;
  image.pixels = data + 2;
  image.width_px = kWidth_px;
  image.height_px = height_px;
  image.stride_bytes = kWidth_px;
  const tbm::CameraModel camera = Camera(kWidth_px, height_px);

  std::vector<tbm::SoughtTarget> targets(5);
  targets[1].mark.kind = tbm::TargetKind::kCircle;
  targets[1].mark.diameter_m = 0.1;
  targets[2].mark.kind = tbm::TargetKind::kCoded;
  for (std::size_t i = 3; i < 5; ++i) {
    targets[i].mark = {tbm::TargetKind::kBoard, 0.0, 0, "A", 4, 3, static_cast<int>(i)};
    targets[i].in_world_m.z() = static_cast<double>(i);
  }
  tbm::TargetsAhead ahead;
  ahead.up_in_camera = Eigen::Vector3d(0.0, -1.0, 0.0);
  if (data[0] % 2 == 1) {
    ahead.expected.emplace();
    ahead.expected->covariance = Eigen::MatrixXd::Identity(2, 2);
    ahead.expected->focal_px = camera.fx_px;
    for (std::size_t i = 0; i < targets.size(); ++i) {
      tbm::ExpectedPixel pixel;
      pixel.pixel_px = {data[1] * 0.4 + 7.0 * static_cast<double>(i), data[1] * 0.2};
      pixel.by_state = 3.0 * Eigen::Matrix2d::Identity();
      pixel.px_per_m = 120.0;
      ahead.expected->targets.emplace_back(pixel);
    }
  }
  tbm::TargetFinder finder;
  const auto found = finder.Find(image, camera, targets, ahead);
  for (const tbm::TargetSeen& one : found.seen) {
    if (!one.pixel_px.allFinite() || !(one.sigma_px > 0.0)) __builtin_trap();
  }
  const auto features = tbm::FindGroundFeatures(image, camera);
  const auto motion = tbm::MeasureGroundMotion(
      features, features, camera, {{0.0, 1.0, 0.0, 0.0}, {0.0, 1.0, 0.0, 0.0}, 1e-4});
  if (motion && !motion->moved.allFinite()) __builtin_trap();
  return 0;
}
