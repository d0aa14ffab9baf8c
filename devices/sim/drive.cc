#include "devices/sim/drive.h"

#include <numbers>
#include <utility>

namespace tbm::sim {

Drive::Drive(Tunnel tunnel, const Motion& motion) : tunnel_(std::move(tunnel)), motion_(motion) {}

Rigid3 Drive::OnRoute(double chainage_m, int crab_channel, int roll_channel) const {
  const double rad_per_m = 2.0 * std::numbers::pi / tunnel_.wander_length_m;
  const double at_rad = chainage_m * rad_per_m;
  const auto off_m = [&](int axis) {
    return tunnel_.wander_m * Wander(motion_.seed, kRoute + axis, at_rad);
  };
  // A shield points along the route, and a little past it.
  const auto slope = [&](int axis) {
    return tunnel_.wander_m * rad_per_m * WanderSlope(motion_.seed, kRoute + axis, at_rad) +
           tunnel_.crab_rad * Wander(motion_.seed, crab_channel + axis, at_rad);
  };
  const double roll_rad = tunnel_.roll_rad * Wander(motion_.seed, roll_channel, at_rad);
  const Eigen::Quaterniond turned = ExpRotation({0.0, 0.0, slope(0)}) *
                                    ExpRotation({0.0, -slope(1), 0.0}) *
                                    ExpRotation({roll_rad, 0.0, 0.0});
  return tunnel_.site_from_axis(chainage_m) * Rigid3{turned, {0.0, off_m(0), off_m(1)}};
}

Rigid3 Drive::SiteFromRearShield(double t_s) const {
  return OnRoute(tunnel_.start_chainage_m + StrokeAt(motion_, t_s).rear_m, kRearCrab, kRearRoll);
}

Rigid3 Drive::SiteFromFrontShield(double t_s) const {
  const double chainage_m =
      tunnel_.start_chainage_m + tunnel_.closed_joint_m + StrokeAt(motion_, t_s).front_m;
  Eigen::Vector3d turn_rad;
  Eigen::Vector3d shift_m;
  for (int axis = 0; axis < 3; ++axis) {
    turn_rad[axis] = motion_.vibration_rad * Vibration(motion_, kShakeX + axis, t_s);
    shift_m[axis] = motion_.vibration_m * Vibration(motion_, kShakeX + 3 + axis, t_s);
  }
  return OnRoute(chainage_m, kFrontCrab, kFrontRoll) * Rigid3{ExpRotation(turn_rad), shift_m};
}

}  // namespace tbm::sim
