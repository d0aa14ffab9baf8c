#include "devices/sim/world.h"

#include <cmath>
#include <numbers>
#include <utility>

#include "devices/sim/hash_noise.h"

namespace tbm::sim {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;

double Phase(std::uint64_t seed, int channel, int part) {
  return kTwoPi * UnitFrom(Mixed(Mixed(seed) ^ static_cast<std::uint64_t>(channel * 64 + part)));
}

enum Channel { kLateral, kVertical, kTurnX, kTurnY, kTurnZ, kLevelRoll, kLevelPitch, kShakeX };

}  // namespace

World::World(Rig rig, const Motion& motion, Faults faults, Timestamp begins_at, double speed)
    : rig_(std::move(rig)),
      motion_(motion),
      faults_(std::move(faults)),
      begins_at_(begins_at),
      speed_(speed) {}

// Two sines whose periods have no common multiple, amplitudes summing to one. Starts anywhere.
double World::Wander(int channel, double t_s) const {
  const double slow = kTwoPi * t_s / motion_.steer_period_s;
  return 0.7 * std::sin(slow + Phase(motion_.seed, channel, 0)) +
         0.3 * std::sin(2.618 * slow + Phase(motion_.seed, channel, 1));
}

// Unit rms.
double World::Vibration(int channel, double t_s) const {
  double sum = 0.0;
  for (int part = 0; part < 3; ++part) {
    const double hz = motion_.vibration_hz * (0.83 + 0.19 * part + 0.013 * channel);
    sum += std::sin(kTwoPi * hz * t_s + Phase(motion_.seed, channel, 2 + part));
  }
  return sum * std::sqrt(2.0 / 3.0);
}

// Forward through one stroke at the advance rate, back at ten times that, and again.
double World::Advance(double t_s) const {
  if (motion_.advance_m_per_s <= 0.0 || motion_.stroke_m <= 0.0 || t_s < 0.0) return 0.0;
  const double push_s = motion_.stroke_m / motion_.advance_m_per_s;
  const double pull_s = push_s / 10.0;
  const double in_cycle_s = std::fmod(t_s, push_s + pull_s);
  if (in_cycle_s < push_s) return motion_.advance_m_per_s * in_cycle_s;
  return motion_.stroke_m * (1.0 - (in_cycle_s - push_s) / pull_s);
}

WorldState World::At(Timestamp when) const {
  const double t_s = SecondsAt(when);
  // The target faces the camera: its x to the image's right, its y up, its z towards the camera.
  const Eigen::Quaterniond facing(0.0, 1.0, 0.0, 0.0);

  Eigen::Vector3d turn_rad =
      motion_.steer_angle_rad *
      Eigen::Vector3d(Wander(kTurnX, t_s), Wander(kTurnY, t_s), Wander(kTurnZ, t_s));
  Eigen::Vector3d shift_m(motion_.steer_m * Wander(kLateral, t_s),
                          motion_.steer_m * Wander(kVertical, t_s),
                          motion_.start_distance_m + Advance(t_s));
  for (int axis = 0; axis < 3; ++axis) {
    turn_rad[axis] += motion_.vibration_rad * Vibration(kShakeX + axis, t_s);
    shift_m[axis] += motion_.vibration_m * Vibration(kShakeX + 3 + axis, t_s);
  }

  // Camera axes: x right, y down, z forward. Roll turns about z, pitch about x.
  const Eigen::Quaterniond level_from_camera =
      ExpRotation({motion_.level_angle_rad * Wander(kLevelPitch, t_s), 0.0, 0.0}) *
      ExpRotation({0.0, 0.0, motion_.level_angle_rad * Wander(kLevelRoll, t_s)});
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
