#include "devices/inclinometer/inclinometer_life.h"

namespace tbm {

std::string_view FailureCode(InclinometerFailure failure) {
  switch (failure) {
    case InclinometerFailure::kNotDue:
      return "not_due";
    case InclinometerFailure::kPortMissing:
      return "port_missing";
    case InclinometerFailure::kPortRefused:
      return "port_refused";
    case InclinometerFailure::kHungUp:
      return "hung_up";
    case InclinometerFailure::kNoReply:
      return "no_reply";
    case InclinometerFailure::kGarbled:
      return "garbled";
    case InclinometerFailure::kOtherInstrument:
      return "other_instrument";
    case InclinometerFailure::kException:
      return "exception";
    case InclinometerFailure::kNotFinite:
      return "not_finite";
    case InclinometerFailure::kOutOfRange:
      return "out_of_range";
    case InclinometerFailure::kStep:
      return "step";
    case InclinometerFailure::kFrozen:
      return "frozen";
    case InclinometerFailure::kEnded:
      return "ended";
  }
  return "unknown";
}

std::string_view StateCode(InclinometerState state) {
  switch (state) {
    case InclinometerState::kClosed:
      return "closed";
    case InclinometerState::kOpening:
      return "opening";
    case InclinometerState::kStreaming:
      return "streaming";
    case InclinometerState::kSilent:
      return "silent";
  }
  return "unknown";
}

void InclinometerLife::OnPortOpen(SteadyTime now) {
  const std::lock_guard lock(mutex_);
  if (was_open_) ++health_.counters.reconnects;
  is_open_ = was_open_ = true;
  has_good_ = false;
  alive_at_ = now;
}

void InclinometerLife::OnPortClosed() {
  const std::lock_guard lock(mutex_);
  is_open_ = false;
}

void InclinometerLife::OnRequest() {
  const std::lock_guard lock(mutex_);
  ++health_.counters.requests;
}

void InclinometerLife::OnStale() {
  const std::lock_guard lock(mutex_);
  ++health_.counters.stale;
}

void InclinometerLife::OnGood(Timestamp sensed_at, SteadyTime now) {
  const std::lock_guard lock(mutex_);
  ++health_.counters.good;
  health_.last_failure.reset();
  health_.last_sensed_at = sensed_at;
  has_good_ = true;
  alive_at_ = now;
}

void InclinometerLife::OnFailure(InclinometerFailure failure) {
  const std::lock_guard lock(mutex_);
  if (failure == InclinometerFailure::kNotDue) return;
  health_.last_failure = failure;
  switch (failure) {
    case InclinometerFailure::kPortMissing:
    case InclinometerFailure::kPortRefused:
    case InclinometerFailure::kHungUp:
    case InclinometerFailure::kEnded:
      is_open_ = false;
      break;
    case InclinometerFailure::kNoReply:
      ++health_.counters.no_reply;
      break;
    case InclinometerFailure::kGarbled:
    case InclinometerFailure::kOtherInstrument:
    case InclinometerFailure::kException:
      ++health_.counters.garbled;
      break;
    case InclinometerFailure::kNotFinite:
    case InclinometerFailure::kOutOfRange:
    case InclinometerFailure::kStep:
    case InclinometerFailure::kFrozen:
      ++health_.counters.implausible;
      break;
    case InclinometerFailure::kNotDue:
      break;
  }
}

InclinometerHealth InclinometerLife::At(SteadyTime now) const {
  const std::lock_guard lock(mutex_);
  InclinometerHealth health = health_;
  if (!is_open_) {
    health.state = InclinometerState::kClosed;
  } else if (now - alive_at_ >= silent_after_) {
    health.state = InclinometerState::kSilent;
  } else {
    health.state = has_good_ ? InclinometerState::kStreaming : InclinometerState::kOpening;
  }
  return health;
}

}  // namespace tbm
