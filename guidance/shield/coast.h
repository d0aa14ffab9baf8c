#pragma once

#include <optional>

#include "guidance/shield/uncertain.h"

namespace tbm {

// What a shield may have done since it was last seen: the law by which a pose grows old.
//
//   along its own x axis   moved on by speed * age,  sigma^2 += (speed sigma * age)^2 + (along *
//   age)^2 across, y and z        sigma^2 += (across * age)^2 turned, each axis      sigma^2 +=
//   (turn * age)^2
//
// The rates are one sigma. The defaults are a machine in good ground that may start or stop a
// stroke at any moment: 60 mm and 1.2 mm a minute, 0.05 mm/m a minute.
struct CoastOptions {
  double along_m_per_s = 1e-3;
  double across_m_per_s = 2e-5;
  double turn_rad_per_s = 8e-7;
};

// The pose `age_s` >= 0 after it was measured, with what has become uncertain since. Standing still
// is a speed of zero with a small sigma; it leaves `along_m_per_s` in.
UncertainRigid3 Coasted(const UncertainRigid3& site_from_shield,
                        double speed_m_per_s,
                        double speed_sigma_m_per_s,
                        double age_s,
                        const CoastOptions& options);

// How a number stands that is renewed every so often.
enum class Freshness {
  kMissing,   // there never was one
  kFresh,     // not older than two periods
  kCoasting,  // older, still usable with its grown sigma
  kStale,     // too old, or its sigma beyond what is of use: no longer valid
};

struct FreshnessLimits {
  double period_s = 1.0;  // in which a new one is expected
  double stale_after_s = 10.0;
  double useful_sigma = 0.0;  // in the number's own unit; 0: no limit
};

// `age_s` is empty when there never was one. A clock set back gives a negative age: by more than a
// period nothing is known about the number's age, and it is stale.
Freshness FreshnessOf(std::optional<double> age_s, double sigma, const FreshnessLimits& limits);

}  // namespace tbm
