#include "devices/inclinometer/polled_inclinometer.h"

#include <algorithm>

namespace tbm {
namespace {

constexpr int kDeadAfterFailures = 3;
constexpr std::chrono::seconds kDeadPollPeriod(1);

}  // namespace

PolledInclinometer::PolledInclinometer(InclinometerConfig config,
                                       std::shared_ptr<TiltBus> bus,
                                       const Clock& clock,
                                       bool is_wire_shared)
    : config_(std::move(config)),
      bus_(std::move(bus)),
      clock_(clock),
      is_wire_shared_(is_wire_shared),
      life_(config_.silent_after),
      gate_({config_.range_rad, config_.max_step_rad, config_.frozen_after, config_.silent_after}) {
}

Result<TiltSample, InclinometerFailure> PolledInclinometer::Read(
    std::chrono::steady_clock::time_point deadline) {
  const TiltBus::Turn turn = bus_->Ask(config_, due_, deadline);
  const auto now = clock_.Steady();
  if (turn.openings > openings_seen_) {
    openings_seen_ = turn.openings;
    life_.OnPortOpen(turn.sent);
  }
  if (turn.stale_bytes > 0) life_.OnStale();
  if (turn.was_asked) {
    life_.OnRequest();
    failures_in_a_row_ = turn.result ? 0 : failures_in_a_row_ + 1;
    ScheduleNext(now);
  }
  if (!turn.result) {
    life_.OnFailure(turn.result.error());
    return Failure{turn.result.error()};
  }
  if (const auto refused = gate_.Refuses(turn.result->raw, now)) {
    life_.OnFailure(*refused);
    return Failure{*refused};
  }
  const TiltSample sample = Stamp(turn);
  life_.OnGood(sample.sensed_at, now);
  return sample;
}

// The instrument reads its plate between the last bit of the question and the first of the answer.
// An adapter that collects bytes can make the reply seem shorter than its line time: then the
// middle of all of it is the best guess.
TiltSample PolledInclinometer::Stamp(const TiltBus::Turn& turn) const {
  auto first = turn.sent + config_.port.LineTime(turn.result->request_characters);
  auto last = turn.done - config_.port.LineTime(turn.result->reply_characters);
  if (first > last) {
    first = turn.sent;
    last = turn.done;
  }
  const auto middle = first + (last - first) / 2;
  return {turn.done_utc - (turn.done - middle) - config_.latency,
          turn.result->raw,
          turn.result->temperature_celsius};
}

// Keeps the beat, but never tries to catch up on missed ones.
void PolledInclinometer::ScheduleNext(std::chrono::steady_clock::time_point now) {
  if (is_wire_shared_ && failures_in_a_row_ >= kDeadAfterFailures) {
    due_ = now + std::max<std::chrono::nanoseconds>(config_.poll_period, kDeadPollPeriod);
  } else {
    due_ = std::max(due_ + config_.poll_period, now);
  }
}

}  // namespace tbm
