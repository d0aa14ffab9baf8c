#pragma once

#include "guidance/fusion/fusion_filter.h"

namespace tbm {

// How still "at rest" is, beside the unit's own noise.
struct RestNoise {
  double velocity_m_s = 2e-4;
  double rate_rad_s = 1e-6;
  double force_m_s2 = 1e-5;
};

// The unit stands still (docs/filter.md, "Rest"): it has no velocity, and where its samples were
// held (FusionFilter::Hold) their means show biases and gravity. Refused when state and rest
// do not agree: a slow even motion looks like rest to the unit.
FusionVerdict UpdateByRest(FusionFilter& filter, const RestNoise& noise);

// The same with `shown`, means of samples that were integrated and not held: whether it may be rest
// that begins. They are in the state already, so the filter is one to be thrown away.
FusionVerdict TryRest(FusionFilter& filter,
                      const RestNoise& noise,
                      const FusionFilter::Held& shown);

}  // namespace tbm
