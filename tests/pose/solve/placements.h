#pragma once

#include <string>
#include <vector>

#include "pose/base/angle.h"
#include "tests/support/scene.h"

namespace tbm::test {

struct Placement {
  std::string name;
  Rig rig;
  Truth truth;
};

inline Eigen::Matrix3d TurnDeg(double x_deg, double y_deg, double z_deg) {
  return (Eigen::AngleAxisd(DegToRad(z_deg), Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(DegToRad(y_deg), Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(DegToRad(x_deg), Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

// The mountings of a real calibration, and two that no small angle describes: a housing turned by a
// quarter about the vertical, and plates bolted on 35 degrees off.
inline std::vector<Rig> RigsWithMountings() {
  std::vector<Rig> rigs = {PublishedRig(), FieldRig(), FieldRig(), FieldRig()};
  rigs[2].name = "quarter turns";
  rigs[2].target_tilt.tilt_from_body = TurnDeg(0, 0, 90) * rigs[2].target_tilt.tilt_from_body;
  rigs[2].camera_tilt.tilt_from_body = TurnDeg(0, 0, -90) * rigs[2].camera_tilt.tilt_from_body;
  rigs[3].name = "steep plates";
  rigs[3].target_tilt.tilt_from_body = TurnDeg(25, -20, 140) * rigs[3].target_tilt.tilt_from_body;
  rigs[3].camera_tilt.tilt_from_body = TurnDeg(-20, 25, -60) * rigs[3].camera_tilt.tilt_from_body;
  return rigs;
}

// Every sign of every angle: the camera rolled and looking up, level and down, the target pitched,
// turned and rolled to both sides of it, left and right and above and below the axis.
inline std::vector<Placement> EverySign() {
  std::vector<Placement> placements;
  const Eigen::Quaterniond facing(0.0, 1.0, 0.0, 0.0);
  for (const Rig& rig : RigsWithMountings()) {
    for (const double look_deg : {-24.0, -0.7, 0.0, 0.7, 24.0}) {
      for (const double roll_deg : {-9.0, 0.0, 9.0}) {
        for (int signs = 0; signs < 32; ++signs) {
          const auto sign = [&](int bit) { return (signs >> bit) & 1 ? 1.0 : -1.0; };
          Truth truth;
          truth.camera_from_target.rotation =
              Eigen::Quaterniond(TurnDeg(5.0 * sign(0), 7.0 * sign(1), 4.0 * sign(2))) * facing;
          truth.camera_from_target.translation = {0.21 * sign(3), 0.17 * sign(4), 3.9};
          truth.up_in_camera =
              TurnDeg(look_deg, 0, 0) * TurnDeg(0, 0, roll_deg) * -Eigen::Vector3d::UnitY();
          placements.push_back({rig.name + " look " + std::to_string(look_deg) + " roll " +
                                    std::to_string(roll_deg) + " signs " + std::to_string(signs),
                                rig,
                                truth});
        }
      }
    }
  }
  return placements;
}

inline double TurnErrorDeg(const Rigid3& estimate, const Truth& truth) {
  return RadToDeg(ErrorBetween(estimate, truth.camera_from_target).head<3>().norm());
}
inline double ShiftErrorMm(const Rigid3& estimate, const Truth& truth) {
  return 1e3 * ErrorBetween(estimate, truth.camera_from_target).tail<3>().norm();
}

// `count` LEDs spread over a board of half a metre with a quarter of a metre of depth.
inline Rig RigWithLeds(int count, std::string_view stream) {
  Rig rig = FieldRig();
  Random random(stream, static_cast<std::uint64_t>(count));
  rig.leds.clear();
  for (int i = 0; i < count; ++i) {
    rig.leds.push_back(
        {"P" + std::to_string(i + 1),
         {random.Uniform(-0.25, 0.25), random.Uniform(-0.25, 0.25), random.Uniform(0.0, 0.25)},
         0.0});
  }
  return rig;
}

}  // namespace tbm::test
