#pragma once

#include <chrono>
#include <string>

#include "pose/base/time.h"

namespace tbm {

using WatchInstant = std::chrono::steady_clock::time_point;

// The two times that an age needs, taken together.
struct WatchNow {
  WatchInstant steady;
  Timestamp utc;
};

// How old a sample is: by this machine's steady clock since it came, or by its own stamp, whichever
// is worse. A network that delivers late, a sender that repeats itself and a clock that was set
// back each betray themselves in one of the two.
double WatchAgeS(WatchInstant received_at, Timestamp sensed_at, const WatchNow& now);

enum class WatchStyle { kHeading, kGood, kDegraded, kBad, kStale, kPlain };

// One line of the screen. A stale row carries its last value in brackets: never in normal dress.
struct WatchRow {
  std::string what;
  std::string value;
  std::string sigma;
  std::string age;
  std::string status;
  WatchStyle style = WatchStyle::kPlain;
};

// A message and when it came.
template <class Message>
struct WatchHeard {
  Message message;
  WatchInstant received_at;
};

namespace watch {

// Age and staleness of one row, and what they do to it.
struct RowAge {
  double age_s = 0.0;
  bool is_stale = false;
  std::string clock;  // ", clock 3.1 s ahead" when the sender's clock is doubtful

  WatchRow Dress(WatchRow row) const;
};

RowAge AgeOf(WatchInstant received_at,
             Timestamp sensed_at,
             const WatchNow& now,
             double stale_after_s);

}  // namespace watch

}  // namespace tbm
