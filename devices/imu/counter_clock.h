#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

#include "pose/base/result.h"
#include "pose/base/time.h"

namespace tbm {

struct CounterClockSettings {
  double counter_hz = 2000.0;
  int counter_step = 4;  // from one sample to the next
  // How long arrivals are only watched after the start. No stamps meanwhile.
  Duration settle = std::chrono::milliseconds(500);
};

enum class CounterClockFailure {
  kSettling,   // arrivals are being watched
  kWrongRate,  // the last settling ended without: counter and arrivals do not go together
};

struct CountedTime {
  std::chrono::steady_clock::time_point at;
  std::int64_t ticks = 0;  // of the counter, since the clock was started
};

// Instants of samples by the unit's own counter, on this computer's steady clock.
//
// A unit samples with a crystal and numbers what it sends, but the datagram comes late: by the
// serial port's buffers, the adapter, the scheduler; at times by milliseconds, never early. So the
// time between samples is taken from the counter, and only the offset between counter and clock
// from the arrivals, by the earliest of them:
//
//   stamp = ticks / counter_hz + offset
//   an arrival before its stamp    offset falls towards it, by at most 1 % of the time passed
//   an arrival after its stamp     offset rises towards it, by at most 200 ppm of the time passed
//
// The fall finds the smallest delay, the rise follows two crystals that run apart (100 ppm each at
// most). Stamps therefore strictly increase, from 99 % to 100.02 % of the unit's step, and are late
// by about the smallest delay, which nobody can see. Simulated at 500 Hz with crystals up to 100
// ppm apart, delays even up to 2 ms and some of 30 ms: stamps scatter by 25 us rms about their
// mean.
//
// While it settles the offset takes the earliest arrival at once, and counter and arrivals must
// have gone on by the same time within a tenth. An offset that is off by more than 60 ms, early at
// once or late for a second, starts it anew; so does a pause of 0.3 s.
class CounterClock {
 public:
  using SteadyTime = std::chrono::steady_clock::time_point;

  explicit CounterClock(const CounterClockSettings& settings) : settings_(settings) {}

  struct Arrival {
    std::optional<std::uint8_t> counter;  // empty: datagrams that are not numbered
    bool follows = false;                 // nothing was lost between the one before and this
    SteadyTime latest;                    // the sample was taken then at the latest
  };
  Result<CountedTime, CounterClockFailure> Next(const Arrival& arrival);

  // Forgets everything: the port was opened.
  void Restart() { is_started_ = is_settled_ = is_wrong_rate_ = false; }

  std::uint64_t restarts() const { return restarts_; }  // by itself

 private:
  CounterClockFailure Start(const Arrival& arrival);
  CounterClockFailure StartAnew(const Arrival& arrival);
  std::optional<std::int64_t> TicksSince(const Arrival& arrival, double gap_s);
  CounterClockFailure Waiting() const;
  bool HasRightRate(double arrival_s, double counted_s) const;
  bool Follow(double error_s, double step_s);

  const CounterClockSettings settings_;
  bool is_started_ = false;
  bool is_settled_ = false;
  bool is_wrong_rate_ = false;
  SteadyTime start_{};
  double last_arrival_s_ = 0.0;
  std::optional<std::uint8_t> last_counter_;
  std::int64_t ticks_ = 0;
  double offset_s_ = 0.0;
  double late_for_s_ = 0.0;
  int steps_seen_ = 0;  // while settling, between datagrams that follow one another
  int steps_right_ = 0;
  std::uint64_t restarts_ = 0;
};

}  // namespace tbm
