#pragma once

#include "pose/rig/rig.h"
#include "pose/solve/problem.h"
#include "tests/support/random.h"

namespace tbm::test {

// The rig of the pose paper's section 4.1: 16 mm lens, 5.3 um pixels, 1280 x 1024, no distortion,
// the five LEDs of Table 1, tilt sigma 0.005 degree; inclinometers bolted level-ish: tilt z is up
// when the camera looks along the tunnel and when the target's y is up. Nothing else is uncertain.
Rig PublishedRig();

// PublishedRig with lens distortion, unequal focal lengths, an off-centre principal point and
// mountings turned by a few degrees: what a real calibration looks like.
Rig FieldRig();

// A true situation: where the target is, and which way up is.
struct Truth {
  Rigid3 camera_from_target;
  Eigen::Vector3d up_in_camera = -Eigen::Vector3d::UnitY();
};

struct TruthRange {
  double distance_min_m = 4.0;
  double distance_max_m = 4.0;
  double lateral_m = 0.2;            // +- of x and y
  double relative_angle_rad = 0.03;  // +- of each axis, around the target facing the camera upright
  double camera_tilt_rad = 0.05;     // +- roll and pitch of the camera against level
};

Truth DrawTruth(Random& random, const TruthRange& range);

// What ideal sensors see. Projection and up vectors are written out here a second time on purpose:
// truth must not come from the code under test.
Eigen::Vector2d ExactPixel(const CameraModel& camera, const Eigen::Vector3d& p_in_camera);
Inclination ExactInclination(const TiltMount& mount, const Eigen::Vector3d& up_in_body);
PoseProblem ExactProblem(const Rig& rig, const Truth& truth);  // all LEDs, both tilts, sigmas 0

// Exact observations plus seeded noise; the sigmas in the problem say what was added.
PoseProblem NoisyProblem(const Rig& rig,
                         const Truth& truth,
                         double centre_sigma_px,
                         double tilt_sigma_rad,
                         Random& random);

}  // namespace tbm::test
