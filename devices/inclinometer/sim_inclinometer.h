#pragma once

#include <functional>
#include <random>

#include "devices/bus/sleeper.h"
#include "devices/inclinometer/inclinometer_config.h"
#include "devices/inclinometer/inclinometer_life.h"
#include "pose/base/clock.h"

namespace tbm {

// What the plate's angles are at an instant, in the instrument's own sign. The one truth of a
// simulated world, the same that its camera looks at. May be called from any thread.
using TiltTruth = std::function<Inclination(Timestamp)>;

// An inclinometer without a port: truth, white noise, last digit. The noise is a stream of its own
// that depends on the seed and the instrument's name only.
class SimInclinometer final : public Inclinometer {
 public:
  SimInclinometer(InclinometerConfig config,
                  TiltTruth truth,
                  std::uint64_t seed,
                  const Clock& clock,
                  Sleeper& sleeper);

  Result<TiltSample, InclinometerFailure> Read(
      std::chrono::steady_clock::time_point deadline) override;
  InclinometerHealth Health() const override { return life_.At(clock_.Steady()); }

 private:
  double Noisy(double angle_rad);
  double Normal();

  const InclinometerConfig config_;
  const TiltTruth truth_;
  const Clock& clock_;
  Sleeper& sleeper_;
  InclinometerLife life_;
  std::mt19937_64 engine_;
  std::optional<std::chrono::steady_clock::time_point> due_;
};

}  // namespace tbm
