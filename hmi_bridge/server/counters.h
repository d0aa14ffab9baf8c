#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>

namespace tbm::hmi {

// Why somebody was not served.
enum class Refusal {
  kTooManyConnections,
  kTimeout,    // slow at asking, at taking, or silent
  kMalformed,  // no HTTP, or more of it than is taken
  kForeignHost,
  kForeignOrigin,
  kNotLoggedIn,
  kRole,
  kRateLimit,
  kBusy,
  kTls,
};
inline constexpr std::size_t kRefusals = 10;

// The server's own numbers, from all its threads.
struct Counters {
  std::atomic<std::int64_t> connections{0};  // open now
  std::atomic<std::int64_t> live_clients{0};
  std::atomic<std::int64_t> foxglove_clients{0};
  std::atomic<std::uint64_t> requests{0};
  std::atomic<std::uint64_t> live_messages{0};
  std::atomic<std::uint64_t> live_bytes{0};
  std::atomic<std::uint64_t> foxglove_messages{0};
  std::atomic<std::uint64_t> foxglove_bytes{0};
  std::atomic<std::uint64_t> foxglove_dropped{0};
  std::atomic<std::uint64_t> logins_good{0};
  std::atomic<std::uint64_t> logins_wrong{0};
  std::array<std::atomic<std::uint64_t>, kRefusals> refused{};

  void Refuse(Refusal why) { ++refused[static_cast<std::size_t>(why)]; }
  std::uint64_t Refused(Refusal why) const { return refused[static_cast<std::size_t>(why)]; }
  std::string Text() const;  // Prometheus
};

}  // namespace tbm::hmi
