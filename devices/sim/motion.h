#pragma once

#include <cstdint>

namespace tbm::sim {

// How the two shields move against each other and against level while the machine advances. All of
// it is smooth; vibration is a sum of three sines near vibration_hz.
struct Motion {
  std::uint64_t seed = 1;
  double start_distance_m = 3.2;   // camera to target when the world begins
  double stroke_m = 1.2;           // the front shield advances by this, then is pulled after
  double advance_m_per_s = 0.001;  // 60 mm/min
  double steer_m = 0.03;           // +- lateral and vertical wander of the target
  double steer_angle_rad = 0.015;  // +- of each axis, relative rotation
  double level_angle_rad = 0.02;   // +- roll and pitch of the rear shield against level
  double steer_period_s = 240.0;
  double vibration_m = 0.00005;  // of the target against the camera, rms of each axis
  double vibration_rad = 0.00002;
  double vibration_hz = 17.0;
  double tilt_noise_factor = 1.0;  // times the rig's sigma; 0 for noise-free tilts
};

// Two sines whose periods have no common multiple, amplitudes summing to one. Starts anywhere; a
// channel is another wander of the same seed.
double Wander(std::uint64_t seed, int channel, double phase_rad);
// Its change per radian of `phase_rad`.
double WanderSlope(std::uint64_t seed, int channel, double phase_rad);

// Unit rms.
double Vibration(const Motion& motion, int channel, double t_s);

// Where in its strokes the machine is: the front shield pushes at the advance rate, then the rear
// one is pulled after at ten times that.
struct Stroke {
  double rear_m = 0.0;   // how far the rear shield has come since the world began
  double front_m = 0.0;  // how far the front one has
  double open_m = 0.0;   // the difference
};
Stroke StrokeAt(const Motion& motion, double t_s);

// Channels: what wanders and what shakes.
enum Channel {
  kLateral,
  kVertical,
  kTurnX,
  kTurnY,
  kTurnZ,
  kLevelRoll,
  kLevelPitch,
  kShakeX,      // six: shift or turn of three axes each
  kRoute = 16,  // two: to the left and up
  kRearCrab = 18,
  kFrontCrab = 20,
  kRearRoll = 22,
  kFrontRoll,
};

}  // namespace tbm::sim
