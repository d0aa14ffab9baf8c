#include "devices/inclinometer/sim_inclinometer.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tbm {
namespace {

std::uint64_t StreamOf(std::string_view name, std::uint64_t seed) {
  std::uint64_t hash = 14695981039346656037ull;  // FNV-1a, 64 bit
  for (const char letter : name) {
    hash = (hash ^ static_cast<unsigned char>(letter)) * 1099511628211ull;
  }
  return hash ^ (seed * 0x9E3779B97F4A7C15ull);
}

}  // namespace

SimInclinometer::SimInclinometer(InclinometerConfig config,
                                 TiltTruth truth,
                                 std::uint64_t seed,
                                 const Clock& clock,
                                 Sleeper& sleeper)
    : config_(std::move(config)),
      truth_(std::move(truth)),
      clock_(clock),
      sleeper_(sleeper),
      life_(config_.silent_after),
      engine_(StreamOf(config_.name, seed)) {}

// Box-Muller on the engine's bits: the standard's normal_distribution differs between libraries.
double SimInclinometer::Normal() {
  const double u = (static_cast<double>(engine_() >> 11u) + 0.5) * 0x1.0p-53;
  const double v = static_cast<double>(engine_() >> 11u) * 0x1.0p-53;
  return std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * std::numbers::pi * v);
}

double SimInclinometer::Noisy(double angle_rad) {
  const double noisy = angle_rad + config_.sim_sigma_rad * Normal();
  const double digit = config_.sim_resolution_rad;
  return digit > 0.0 ? digit * std::round(noisy / digit) : noisy;
}

Result<TiltSample, InclinometerFailure> SimInclinometer::Read(
    std::chrono::steady_clock::time_point deadline) {
  if (!due_) {
    due_ = clock_.Steady();
    life_.OnPortOpen(*due_);
  }
  if (*due_ > deadline) {
    sleeper_.SleepUntil(deadline);
    return Failure{InclinometerFailure::kNotDue};
  }
  if (*due_ > clock_.Steady()) sleeper_.SleepUntil(*due_);
  const auto now = clock_.Steady();
  due_ = std::max(*due_ + config_.poll_period, now);
  life_.OnRequest();

  const Timestamp sensed_at = clock_.Now() - config_.latency;
  const Inclination truth = truth_(sensed_at);
  const double beta_rad = Noisy(truth.beta_rad);
  const double gamma_rad = Noisy(truth.gamma_rad);
  life_.OnGood(sensed_at, now);
  return TiltSample{sensed_at, {beta_rad, gamma_rad}, std::nullopt};
}

}  // namespace tbm
