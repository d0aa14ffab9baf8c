#include "devices/sim/world.h"

#include <cmath>
#include <numbers>
#include <utility>

#include "devices/sim/hash_noise.h"
#include "pose/base/check.h"

namespace tbm::sim {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;

}  // namespace

World::World(Rig rig,
             const Motion& motion,
             Faults faults,
             Timestamp begins_at,
             double speed,
             std::optional<Tunnel> tunnel)
    : rig_(std::move(rig)),
      motion_(motion),
      faults_(std::move(faults)),
      begins_at_(begins_at),
      speed_(speed) {
  if (tunnel) drive_.emplace(std::move(*tunnel), motion);
}

double World::Wandered(int channel, double t_s) const {
  return Wander(motion_.seed, channel, kTwoPi * t_s / motion_.steer_period_s);
}

Rigid3 World::SiteFromRearShield(Timestamp when) const {
  TBM_CHECK(drive_.has_value());
  return drive_->SiteFromRearShield(SecondsAt(when));
}

Rigid3 World::SiteFromFrontShield(Timestamp when) const {
  TBM_CHECK(drive_.has_value());
  return drive_->SiteFromFrontShield(SecondsAt(when));
}

WorldState World::InTunnel(double t_s) const {
  const Tunnel& tunnel = drive_->tunnel();
  const Rigid3 camera_from_site =
      Inverse(drive_->SiteFromRearShield(t_s) * tunnel.rear_shield_from_camera);
  return {camera_from_site * drive_->SiteFromFrontShield(t_s) * tunnel.front_shield_from_target,
          camera_from_site.rotation * Eigen::Vector3d::UnitZ()};
}

WorldState World::At(Timestamp when) const {
  const double t_s = SecondsAt(when);
  if (drive_) return InTunnel(t_s);
  // The target faces the camera: its x to the image's right, its y up, its z towards the camera.
  const Eigen::Quaterniond facing(0.0, 1.0, 0.0, 0.0);

  Eigen::Vector3d turn_rad =
      motion_.steer_angle_rad *
      Eigen::Vector3d(Wandered(kTurnX, t_s), Wandered(kTurnY, t_s), Wandered(kTurnZ, t_s));
  Eigen::Vector3d shift_m(motion_.steer_m * Wandered(kLateral, t_s),
                          motion_.steer_m * Wandered(kVertical, t_s),
                          motion_.start_distance_m + StrokeAt(motion_, t_s).open_m);
  for (int axis = 0; axis < 3; ++axis) {
    turn_rad[axis] += motion_.vibration_rad * Vibration(motion_, kShakeX + axis, t_s);
    shift_m[axis] += motion_.vibration_m * Vibration(motion_, kShakeX + 3 + axis, t_s);
  }

  // Camera axes: x right, y down, z forward. Roll turns about z, pitch about x.
  const Eigen::Quaterniond level_from_camera =
      ExpRotation({motion_.level_angle_rad * Wandered(kLevelPitch, t_s), 0.0, 0.0}) *
      ExpRotation({0.0, 0.0, motion_.level_angle_rad * Wandered(kLevelRoll, t_s)});
  return {{(ExpRotation(turn_rad) * facing).normalized(), shift_m},
          level_from_camera.conjugate() * -Eigen::Vector3d::UnitY()};
}

Inclination World::TiltReading(TiltSensor sensor, Timestamp when) const {
  const bool is_target = sensor == TiltSensor::kTarget;
  const TiltMount& mount = is_target ? rig_.target_tilt : rig_.camera_tilt;
  const WorldState state = At(when);
  const Eigen::Vector3d up_in_body =
      is_target
          ? Eigen::Vector3d(state.camera_from_target.rotation.conjugate() * state.up_in_camera)
          : state.up_in_camera;
  Inclination reading = InclinationFromUp(mount.tilt_from_body * up_in_body);

  const double t_s = SecondsAt(when);
  for (const TiltFault& fault : faults_.tilts) {
    if (fault.sensor != sensor || !fault.window.Contains(t_s)) continue;
    reading.beta_rad += fault.offset.beta_rad;
    reading.gamma_rad += fault.offset.gamma_rad;
  }
  const double sigma_rad = mount.sigma_rad * motion_.tilt_noise_factor;
  const std::uint64_t key =
      Mixed(motion_.seed ^ Mixed(static_cast<std::uint64_t>(when.ns))) + (is_target ? 0 : 2);
  reading.beta_rad += sigma_rad * NormalFrom(key);
  reading.gamma_rad += sigma_rad * NormalFrom(key + 1);
  return {mount.sign[0] * reading.beta_rad, mount.sign[1] * reading.gamma_rad};
}

bool World::IsHidden(std::size_t led, Timestamp when) const {
  const double t_s = SecondsAt(when);
  for (const HiddenLed& hidden : faults_.hidden) {
    if (hidden.led == led && hidden.window.Contains(t_s)) return true;
  }
  return false;
}

}  // namespace tbm::sim
