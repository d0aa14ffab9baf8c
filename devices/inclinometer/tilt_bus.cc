#include "devices/inclinometer/tilt_bus.h"

#include <algorithm>

namespace tbm {

TiltBus::SteadyTime TiltBus::FreeAt() const {
  const std::lock_guard lock(mutex_);
  return free_at_;
}

TiltBus::Turn TiltBus::Ask(const InclinometerConfig& instrument,
                           SteadyTime earliest,
                           SteadyTime deadline) {
  for (;;) {
    const SteadyTime start = std::max(earliest, FreeAt());
    if (start > deadline) {
      sleeper_.SleepUntil(deadline);
      return Turn{};
    }
    if (start > clock_.Steady()) sleeper_.SleepUntil(start);
    const std::lock_guard lock(mutex_);
    // Meanwhile an error of the other instrument may have asked for silence.
    if (free_at_ <= clock_.Steady()) return AskNow(instrument);
  }
}

// A port that opens and then stays dead is given up: some USB adapters come back only by that.
void TiltBus::CloseWhenDead(SteadyTime now) {
  if (!wire_->IsOpen() || timing_.reopen_after.count() == 0) return;
  if (now - alive_at_ >= timing_.reopen_after) wire_->Close();
}

TiltBus::Turn TiltBus::AskNow(const InclinometerConfig& instrument) {
  Turn turn;
  CloseWhenDead(clock_.Steady());
  if (!wire_->IsOpen()) {
    if (const auto failure = wire_->Open()) {
      free_at_ = clock_.Steady() + timing_.reconnect_period;
      turn.result = Failure{*failure};
      turn.openings = openings_;
      return turn;
    }
    ++openings_;
    alive_at_ = clock_.Steady();
  }
  turn.openings = openings_;
  turn.stale_bytes = wire_->Discard();
  turn.was_asked = true;
  turn.sent = clock_.Steady();
  turn.result = wire_->Ask(instrument);
  turn.done = clock_.Steady();
  turn.done_utc = clock_.Now();
  if (turn.result) {
    alive_at_ = turn.done;
  } else if (turn.result.error() == InclinometerFailure::kHungUp) {
    wire_->Close();
    free_at_ = turn.done + timing_.reconnect_period;
  } else {
    free_at_ = turn.done + timing_.quiet_time;
  }
  return turn;
}

}  // namespace tbm
