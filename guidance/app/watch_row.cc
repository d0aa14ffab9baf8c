#include "guidance/app/watch_row.h"

#include <algorithm>

#include <fmt/format.h>

#include "guidance/app/watch_text.h"

namespace tbm {

double WatchAgeS(WatchInstant received_at, Timestamp sensed_at, const WatchNow& now) {
  const double since_received_s = std::chrono::duration<double>(now.steady - received_at).count();
  return std::max({0.0, since_received_s, SecondsBetween(sensed_at, now.utc)});
}

namespace watch {

WatchRow RowAge::Dress(WatchRow row) const {
  row.age = AgeText(age_s);
  if (is_stale) {
    row.status = row.status.empty() ? "STALE" : "STALE, was " + row.status;
    row.style = WatchStyle::kStale;
    if (!row.value.empty()) row.value = "(" + row.value + ")";
    row.sigma.clear();
  }
  row.status += clock;
  return row;
}

RowAge AgeOf(WatchInstant received_at,
             Timestamp sensed_at,
             const WatchNow& now,
             double stale_after_s) {
  constexpr double kClockTrustS = 0.5;  // how far ahead of us a stamp may be before it is mentioned
  RowAge age;
  age.age_s = WatchAgeS(received_at, sensed_at, now);
  age.is_stale = age.age_s > stale_after_s;
  const double ahead_s = SecondsBetween(now.utc, sensed_at);
  if (ahead_s > kClockTrustS) age.clock = fmt::format(", clock {:.1f} s ahead", ahead_s);
  return age;
}

}  // namespace watch
}  // namespace tbm
