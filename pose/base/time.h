#pragma once

#include <chrono>
#include <compare>
#include <cstdint>

namespace tbm {

// An instant as integer nanoseconds since 1970-01-01T00:00:00Z. The name of a variable says which
// event: sensed_at, received_at, published_at. Recordings and DDS carry the same integer, so no
// rounding ever happens between a camera and a CSV file.
struct Timestamp {
  std::int64_t ns = 0;

  auto operator<=>(const Timestamp&) const = default;
};

using Duration = std::chrono::nanoseconds;

inline Duration operator-(Timestamp later, Timestamp earlier) {
  return Duration(later.ns - earlier.ns);
}
inline Timestamp operator+(Timestamp start, Duration span) { return {start.ns + span.count()}; }
inline Timestamp operator-(Timestamp start, Duration span) { return {start.ns - span.count()}; }

inline double SecondsBetween(Timestamp earlier, Timestamp later) {
  return static_cast<double>(later.ns - earlier.ns) * 1e-9;
}

// Nothing on the way from a sensor to the solver overtakes by as much as this. A stamp that is
// older than the one before by more means that somebody has set the clock back; what was remembered
// under the old clock is then of no use.
inline constexpr Duration kClockSetBack = std::chrono::milliseconds(500);

}  // namespace tbm
