#include "pose/solve/linearised.h"

#include "pose/solve/rows.h"

namespace tbm {
namespace {

// Focal lengths and principal point shift all LEDs together.
void AddIntrinsics(const Rig& rig,
                   const Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, kMaxLeds>& by_focal_length,
                   LinearisedProblem& linear) {
  const Eigen::Array4d variance = rig.intrinsics_sigma_px.array().square();
  const Eigen::Index leds = by_focal_length.cols();
  for (Eigen::Index i = 0; i < leds; ++i) {
    for (Eigen::Index j = 0; j < leds; ++j) {
      for (Eigen::Index axis = 0; axis < 2; ++axis) {
        linear.covariance(2 * i + axis, 2 * j + axis) +=
            variance[axis] * by_focal_length(axis, i) * by_focal_length(axis, j) +
            variance[2 + axis];
      }
    }
  }
}

}  // namespace

std::optional<LinearisedProblem> Linearise(const PoseProblem& problem,
                                           const Rigid3& camera_from_target,
                                           bool with_tilts) {
  TBM_CHECK(problem.rig != nullptr);
  const Eigen::Matrix3d rotation = camera_from_target.rotation.toRotationMatrix();
  const bool has_tilts = with_tilts && problem.target_tilt && problem.camera_tilt;
  LinearisedProblem linear;
  linear.led_rows = 2 * static_cast<int>(problem.leds.size());
  linear.tilt_rows = has_tilts ? 2 : 0;
  const int rows = linear.led_rows + linear.tilt_rows;
  linear.residual.setZero(rows);
  linear.by_pose.setZero(rows, 6);
  linear.covariance.setZero(rows, rows);

  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, kMaxLeds> by_focal_length(2, linear.led_rows / 2);
  for (int i = 0; i < linear.led_rows / 2; ++i) {
    const LedObservation& led = problem.leds[static_cast<std::size_t>(i)];
    LedRows of_led;
    if (!RowsOfLed(*problem.rig, led, rotation, camera_from_target.translation, of_led)) {
      return std::nullopt;
    }
    linear.residual.segment<2>(2 * i) = of_led.residual_px;
    linear.by_pose.middleRows<2>(2 * i) = of_led.by_pose;
    linear.covariance.block<2, 2>(2 * i, 2 * i) = CovarianceOfLed(*problem.rig, led, of_led);
    by_focal_length.col(i) = of_led.by_focal_length;
  }
  AddIntrinsics(*problem.rig, by_focal_length, linear);

  if (has_tilts) {
    const auto tilts = TiltConstraint::From(problem);
    if (!tilts) return std::nullopt;
    const TiltConstraint::Rows of_tilts = tilts->At(rotation);
    linear.residual.tail<2>() = of_tilts.residual;
    linear.by_pose.bottomLeftCorner<2, 3>() = of_tilts.by_turn;
    linear.covariance.bottomRightCorner<2, 2>() = of_tilts.covariance;
  }
  return linear;
}

}  // namespace tbm
