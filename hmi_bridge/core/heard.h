#pragma once

#include <cstdint>

#include "pose/base/time.h"

namespace tbm::hmi {

// When a value is stale: two periods of its source (idl/README.md, "Topics").
inline constexpr std::int64_t kGuidanceStale_ms = 400;
inline constexpr std::int64_t kTrolleyStale_ms = 400;  // four: told beside other work
inline constexpr std::int64_t kHeartbeatStale_ms = 2000;

// One moment by both clocks of the bridge.
struct Moment {
  Timestamp utc;
  std::int64_t steady_ms = 0;  // never set; only good for differences
};

// How a sample came.
struct Arrival {
  std::int64_t heard_steady_ms = 0;
  bool contested = false;  // two senders are alive for its key
};

// The last sample of a key.
template <class Message>
struct Heard {
  Message message;
  Arrival arrival;
};

inline std::int64_t Milliseconds(Timestamp stamp) { return stamp.ns / 1'000'000; }

// How old a value is [ms]: by its own stamp, either way, because a stamp of the future is as
// doubtful as one of the past, or by when it came, whichever is worse.
inline std::int64_t AgeMs(const Arrival& arrival, Timestamp stamp, const Moment& now) {
  const std::int64_t by_stamp = Milliseconds(now.utc) - Milliseconds(stamp);
  const std::int64_t by_arrival = now.steady_ms - arrival.heard_steady_ms;
  const std::int64_t doubt = by_stamp < 0 ? -by_stamp : by_stamp;
  return doubt > by_arrival ? doubt : by_arrival;
}

}  // namespace tbm::hmi
