#pragma once

#include <array>

#include "pose/base/angle.h"
#include "pose/geometry/rigid3.h"
#include "tests/support/scene.h"

namespace tbm::test {

// Declares what a field calibration is worth: the sigmas of a surveyed rig with a 16 mm lens.
inline void DeclareFieldSigmas(Rig& rig) {
  rig.calibration_residual_px = 0.08;
  rig.intrinsics_sigma_px << 0.45, 0.45, 0.6, 0.6;
  for (Led& led : rig.leds) led.sigma_m = 0.05e-3;
  rig.target_tilt.mounting_sigma_rad = rig.camera_tilt.mounting_sigma_rad = DegToRad(0.004);
  for (NamedPoint& point : rig.points) point.sigma_m = 0.2e-3;
}

// The rig as it really is: the file's values plus errors drawn from the file's own sigmas. They
// stay the same from frame to frame.
struct AsBuilt {
  Rig rig;
  std::array<Eigen::Vector2d, kMaxLeds> residual_px{};  // of each LED's centre
};

inline AsBuilt DrawAsBuilt(const Rig& nominal, Random& random) {
  AsBuilt built;
  built.rig = nominal;
  CameraModel& camera = built.rig.camera;
  camera.fx_px += random.Normal(nominal.intrinsics_sigma_px[0]);
  camera.fy_px += random.Normal(nominal.intrinsics_sigma_px[1]);
  camera.cx_px += random.Normal(nominal.intrinsics_sigma_px[2]);
  camera.cy_px += random.Normal(nominal.intrinsics_sigma_px[3]);
  for (std::size_t i = 0; i < nominal.leds.size(); ++i) {
    built.rig.leds[i].p_led_in_target += random.Normal3(nominal.leds[i].sigma_m);
    built.residual_px[i] = random.Normal2(nominal.calibration_residual_px);
  }
  for (TiltMount* mount : {&built.rig.target_tilt, &built.rig.camera_tilt}) {
    mount->tilt_from_body =
        mount->tilt_from_body * ExpRotation(random.Normal3(mount->mounting_sigma_rad));
  }
  for (NamedPoint& point : built.rig.points) {
    point.p_point_in_target += random.Normal3(point.sigma_m);
  }
  return built;
}

// What the sensors of `built` send, as a problem over the rig file's values.
inline PoseProblem Observe(const AsBuilt& built,
                           const Rig& nominal,
                           const Truth& truth,
                           double centre_sigma_px,
                           double tilt_sigma_rad,
                           Random& random) {
  PoseProblem problem = NoisyProblem(built.rig, truth, centre_sigma_px, tilt_sigma_rad, random);
  problem.rig = &nominal;
  for (LedObservation& led : problem.leds) {
    led.pixel_px += built.residual_px[static_cast<std::size_t>(led.led_index)];
  }
  return problem;
}

}  // namespace tbm::test
