#include "tests/devices/camera/small_machine.h"

#include "pose/base/clock.h"

namespace tbm::test {

Rig SmallRig(int width_px, int height_px) {
  Rig rig;
  rig.name = "small";
  const double f_px = 2.36 * width_px;
  rig.camera = {width_px, height_px, f_px, f_px, 0.5 * width_px, 0.5 * height_px, 0, 0, 0, 0, 0};
  rig.leds = {{"P1", {-0.25, 0.0, 0.1}},
              {"P2", {0.25, 0.0, 0.1}},
              {"P3", {0.0, 0.25, 0.0}},
              {"P4", {0.0, -0.25, 0.0}},
              {"P5", {0.08, 0.08, 0.25}}};
  // Both plates level when their body is: tilt x = body x, tilt z = up.
  rig.target_tilt.tilt_from_body << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  rig.camera_tilt.tilt_from_body << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  return rig;
}

std::string SmallRigYaml() {
  return R"(rig_name: small
camera:
  image_width: 320
  image_height: 256
  distortion_model: plumb_bob
  camera_matrix: {rows: 3, cols: 3, data: [755, 0, 160, 0, 755, 128, 0, 0, 1]}
  distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}
target:
  leds:
    - {id: P1, xyz_mm: [-250, 0, 100]}
    - {id: P2, xyz_mm: [250, 0, 100]}
    - {id: P3, xyz_mm: [0, 250, 0]}
    - {id: P4, xyz_mm: [0, -250, 0]}
    - {id: P5, xyz_mm: [80, 80, 250]}
inclinometers:
  target: {rotation: [1, 0, 0, 0, 0, -1, 0, 1, 0], sigma_deg: 0.005}
  camera: {rotation: [1, 0, 0, 0, 0, 1, 0, -1, 0], sigma_deg: 0.005}
points:
  shield_head: {xyz_mm: [0, 0, -1600]}
)";
}

std::shared_ptr<const sim::World> SmallWorld(int width_px, int height_px) {
  return std::make_shared<sim::World>(
      SmallRig(width_px, height_px), sim::Motion{}, sim::Faults{}, SystemClock().Now());
}

sim::ViewOptions PlainView() {
  sim::ViewOptions view;
  view.led_peak_dn = 150.0 * 0.64;  // at 4 m; the target stands at 3.2
  view.led_spread_of_brightness = 0.0;
  view.hot_pixels = 0;
  return view;
}

}  // namespace tbm::test
