#include "devices/inclinometer/sample_gate.h"

#include <cmath>

namespace tbm {

bool SampleGate::IsNear(const std::optional<Reading>& reference, const Inclination& reading) const {
  return reference &&
         std::abs(reading.beta_rad - reference->angles.beta_rad) <= limits_.max_step_rad &&
         std::abs(reading.gamma_rad - reference->angles.gamma_rad) <= limits_.max_step_rad;
}

std::optional<InclinometerFailure> SampleGate::Refuses(const Inclination& reading, SteadyTime now) {
  if (!std::isfinite(reading.beta_rad) || !std::isfinite(reading.gamma_rad)) {
    return InclinometerFailure::kNotFinite;
  }
  if (std::abs(reading.beta_rad) > limits_.range_rad ||
      std::abs(reading.gamma_rad) > limits_.range_rad) {
    return InclinometerFailure::kOutOfRange;
  }

  const bool is_same = unchanged_since_ && reading.beta_rad == last_.beta_rad &&
                       reading.gamma_rad == last_.gamma_rad;
  if (!is_same) unchanged_since_ = now;
  last_ = reading;
  if (limits_.frozen_after.count() > 0 && now - *unchanged_since_ >= limits_.frozen_after) {
    return InclinometerFailure::kFrozen;
  }

  if (accepted_ && now - accepted_->at > limits_.forget_after) accepted_.reset();
  const bool is_step = limits_.max_step_rad > 0.0 && accepted_ && !IsNear(accepted_, reading);
  if (is_step && !IsNear(refused_step_, reading)) {
    refused_step_ = Reading{reading, now};
    return InclinometerFailure::kStep;
  }
  refused_step_.reset();
  accepted_ = Reading{reading, now};
  return std::nullopt;
}

}  // namespace tbm
