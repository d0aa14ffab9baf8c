#include "devices/imu/counter_clock.h"

#include <algorithm>
#include <cmath>

namespace tbm {
namespace {

constexpr double kLargestFall = 0.01;    // of the time between two samples
constexpr double kFastestRise = 200e-6;  // of the time passed
constexpr double kPaceTolerance = 0.1;
constexpr double kLost_s = 0.060;  // less than half a round of an 8-bit counter at 2000 Hz
constexpr double kLateForAtMost_s = 1.0;
// After a pause as long as this the counter tells nothing: it may have gone round, or begun anew.
constexpr double kForgetAfter_s = 0.3;
constexpr int kEnoughSteps = 8;

double Seconds(Duration span) { return static_cast<double>(span.count()) * 1e-9; }

}  // namespace

CounterClockFailure CounterClock::Start(const Arrival& arrival) {
  is_started_ = true;
  is_settled_ = false;
  start_ = arrival.latest;
  last_arrival_s_ = 0.0;
  last_counter_ = arrival.counter;
  ticks_ = 0;
  offset_s_ = 0.0;
  late_for_s_ = 0.0;
  steps_seen_ = steps_right_ = 0;
  return Waiting();
}

CounterClockFailure CounterClock::Waiting() const {
  return is_wrong_rate_ ? CounterClockFailure::kWrongRate : CounterClockFailure::kSettling;
}

CounterClockFailure CounterClock::StartAnew(const Arrival& arrival) {
  ++restarts_;
  return Start(arrival);
}

Result<CountedTime, CounterClockFailure> CounterClock::Next(const Arrival& arrival) {
  if (!is_started_) return Failure{Start(arrival)};
  const double arrival_s = Seconds(arrival.latest - start_);
  const auto step = TicksSince(arrival, arrival_s - last_arrival_s_);
  if (!step) return Failure{StartAnew(arrival)};
  ticks_ += *step;
  last_arrival_s_ = arrival_s;
  last_counter_ = arrival.counter;
  const double counted_s = static_cast<double>(ticks_) / settings_.counter_hz;
  if (!is_settled_) {
    offset_s_ = std::min(offset_s_, arrival_s - counted_s);
    if (arrival_s < Seconds(settings_.settle)) return Failure{Waiting()};
    is_wrong_rate_ = !HasRightRate(arrival_s, counted_s);
    if (is_wrong_rate_) return Failure{Start(arrival)};
    is_settled_ = true;
  }
  const double step_s = static_cast<double>(*step) / settings_.counter_hz;
  if (!Follow(arrival_s - counted_s - offset_s_, step_s)) return Failure{StartAnew(arrival)};
  const auto since_start = Duration(std::llround((counted_s + offset_s_) * 1e9));
  return CountedTime{start_ + since_start, ticks_};
}

// By how much the counter has gone on. Eight bits go round in 128 ms at 2000 Hz: how often they
// did, the arrivals tell, unless the datagrams touch. Then the computer was late, not the unit.
std::optional<std::int64_t> CounterClock::TicksSince(const Arrival& arrival, double gap_s) {
  if (gap_s > kForgetAfter_s) return std::nullopt;
  const double ticks_in_gap = gap_s * settings_.counter_hz;
  if (!arrival.counter || !last_counter_) {
    if (arrival.follows) return settings_.counter_step;
    const double steps = std::round(ticks_in_gap / settings_.counter_step);
    return settings_.counter_step * std::max<std::int64_t>(1, std::llround(steps));
  }
  const std::int64_t on = (*arrival.counter - *last_counter_) & 0xFF;
  const bool is_one_step = on == (settings_.counter_step & 0xFF);
  if (arrival.follows && !is_settled_) {
    ++steps_seen_;
    if (is_one_step) ++steps_right_;
  }
  if (arrival.follows && is_one_step) return settings_.counter_step;
  const double rounds = std::round((ticks_in_gap - static_cast<double>(on)) / 256.0);
  const std::int64_t ticks = on + 256 * std::max<std::int64_t>(0, std::llround(rounds));
  if (ticks > 0) return ticks;
  is_wrong_rate_ = true;  // two with one number: not the counter we know
  return std::nullopt;
}

bool CounterClock::HasRightRate(double arrival_s, double counted_s) const {
  const bool is_pace_right = std::abs(arrival_s - counted_s) <= kPaceTolerance * arrival_s;
  const bool are_steps_right = steps_seen_ < kEnoughSteps || 2 * steps_right_ >= steps_seen_;
  return is_pace_right && are_steps_right;
}

// False when counter and arrivals have nothing to do with one another any more.
bool CounterClock::Follow(double error_s, double step_s) {
  if (error_s < -kLost_s) return false;
  late_for_s_ = error_s > kLost_s ? late_for_s_ + step_s : 0.0;
  if (late_for_s_ > kLateForAtMost_s) return false;
  offset_s_ += std::clamp(error_s, -kLargestFall * step_s, kFastestRise * step_s);
  return true;
}

}  // namespace tbm
