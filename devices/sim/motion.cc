#include "devices/sim/motion.h"

#include <cmath>
#include <numbers>

#include "devices/sim/hash_noise.h"

namespace tbm::sim {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;

double Phase(std::uint64_t seed, int channel, int part) {
  return kTwoPi * UnitFrom(Mixed(Mixed(seed) ^ static_cast<std::uint64_t>(channel * 64 + part)));
}

}  // namespace

double Wander(std::uint64_t seed, int channel, double phase_rad) {
  return 0.7 * std::sin(phase_rad + Phase(seed, channel, 0)) +
         0.3 * std::sin(2.618 * phase_rad + Phase(seed, channel, 1));
}

double WanderSlope(std::uint64_t seed, int channel, double phase_rad) {
  return 0.7 * std::cos(phase_rad + Phase(seed, channel, 0)) +
         0.3 * 2.618 * std::cos(2.618 * phase_rad + Phase(seed, channel, 1));
}

double Vibration(const Motion& motion, int channel, double t_s) {
  double sum = 0.0;
  for (int part = 0; part < 3; ++part) {
    const double hz = motion.vibration_hz * (0.83 + 0.19 * part + 0.013 * channel);
    sum += std::sin(kTwoPi * hz * t_s + Phase(motion.seed, channel, 2 + part));
  }
  return sum * std::sqrt(2.0 / 3.0);
}

Stroke StrokeAt(const Motion& motion, double t_s) {
  if (motion.advance_m_per_s <= 0.0 || motion.stroke_m <= 0.0 || t_s < 0.0) return {};
  const double push_s = motion.stroke_m / motion.advance_m_per_s;
  const double pull_s = push_s / 10.0;
  const double in_cycle_s = std::fmod(t_s, push_s + pull_s);
  const double driven_m = motion.stroke_m * std::round((t_s - in_cycle_s) / (push_s + pull_s));
  if (in_cycle_s < push_s) {
    const double open_m = motion.advance_m_per_s * in_cycle_s;
    return {driven_m, driven_m + open_m, open_m};
  }
  const double pulled = (in_cycle_s - push_s) / pull_s;
  return {driven_m + motion.stroke_m * pulled,
          driven_m + motion.stroke_m,
          motion.stroke_m * (1.0 - pulled)};
}

}  // namespace tbm::sim
