#include "devices/imu/inertial_unit_life.h"

namespace tbm {

std::string_view FailureCode(InertialFailure failure) {
  switch (failure) {
    case InertialFailure::kNotDue:
      return "not_due";
    case InertialFailure::kPortMissing:
      return "port_missing";
    case InertialFailure::kPortRefused:
      return "port_refused";
    case InertialFailure::kHungUp:
      return "hung_up";
    case InertialFailure::kNoData:
      return "no_data";
    case InertialFailure::kGarbled:
      return "garbled";
    case InertialFailure::kStartingUp:
      return "starting_up";
    case InertialFailure::kSettling:
      return "settling";
    case InertialFailure::kWrongRate:
      return "wrong_rate";
    case InertialFailure::kOverload:
      return "overload";
    case InertialFailure::kFaulty:
      return "faulty";
    case InertialFailure::kFrozen:
      return "frozen";
    case InertialFailure::kEnded:
      return "ended";
  }
  return "unknown";
}

std::string_view StateCode(InertialState state) {
  switch (state) {
    case InertialState::kClosed:
      return "closed";
    case InertialState::kOpening:
      return "opening";
    case InertialState::kStreaming:
      return "streaming";
    case InertialState::kSilent:
      return "silent";
  }
  return "unknown";
}

void InertialUnitLife::OnPortOpen(SteadyTime now) {
  const std::lock_guard lock(mutex_);
  if (was_open_) ++health_.counters.reconnects;
  is_open_ = was_open_ = true;
  heard_at_ = now;
  good_at_.reset();
}

void InertialUnitLife::OnPortClosed() {
  const std::lock_guard lock(mutex_);
  is_open_ = false;
}

void InertialUnitLife::OnDatagram(SteadyTime now) {
  const std::lock_guard lock(mutex_);
  ++health_.counters.datagrams;
  heard_at_ = now;
}

void InertialUnitLife::OnGood(Timestamp ends_at, SteadyTime now) {
  const std::lock_guard lock(mutex_);
  ++health_.counters.good;
  health_.last_failure.reset();
  health_.last_ends_at = ends_at;
  good_at_ = now;
}

void InertialUnitLife::OnFailure(InertialFailure failure) {
  const std::lock_guard lock(mutex_);
  if (failure == InertialFailure::kNotDue) return;
  health_.last_failure = failure;
  switch (failure) {
    case InertialFailure::kPortMissing:
    case InertialFailure::kPortRefused:
    case InertialFailure::kHungUp:
    case InertialFailure::kEnded:
      is_open_ = false;
      break;
    case InertialFailure::kGarbled:
      ++health_.counters.garbled;
      break;
    case InertialFailure::kStartingUp:
      ++health_.counters.starting_up;
      break;
    case InertialFailure::kSettling:
    case InertialFailure::kWrongRate:
      ++health_.counters.untimed;
      break;
    case InertialFailure::kOverload:
      ++health_.counters.overloads;
      break;
    case InertialFailure::kFaulty:
      ++health_.counters.faulty;
      break;
    case InertialFailure::kFrozen:
      ++health_.counters.frozen;
      break;
    case InertialFailure::kNoData:
    case InertialFailure::kNotDue:
      break;
  }
}

void InertialUnitLife::OnWire(std::uint64_t lost,
                              std::uint64_t skipped_bytes,
                              std::uint64_t clock_restarts) {
  const std::lock_guard lock(mutex_);
  health_.counters.lost += lost;
  health_.counters.skipped_bytes += skipped_bytes;
  health_.counters.clock_restarts += clock_restarts;
}

InertialHealth InertialUnitLife::At(SteadyTime now) const {
  const std::lock_guard lock(mutex_);
  InertialHealth health = health_;
  if (!is_open_) {
    health.state = InertialState::kClosed;
  } else if (now - heard_at_ >= silent_after_) {
    health.state = InertialState::kSilent;
  } else {
    const bool has_good = good_at_ && now - *good_at_ < silent_after_;
    health.state = has_good ? InertialState::kStreaming : InertialState::kOpening;
  }
  return health;
}

}  // namespace tbm
