#include "devices/imu/stim_unit.h"

#include <algorithm>
#include <array>

namespace tbm {
namespace {

InertialFailure FailureFromLink(LinkFailure failure) {
  switch (failure) {
    case LinkFailure::kMissing:
      return InertialFailure::kPortMissing;
    case LinkFailure::kDenied:
    case LinkFailure::kBusy:
    case LinkFailure::kBadSettings:
      return InertialFailure::kPortRefused;
    case LinkFailure::kHungUp:
      return InertialFailure::kHungUp;
    case LinkFailure::kTimeout:
      return InertialFailure::kNoData;
  }
  return InertialFailure::kHungUp;
}

CounterClockSettings ClockSettings(const StimConfig& config) {
  CounterClockSettings settings;
  settings.counter_hz = config.counter_hz;
  settings.counter_step = config.CounterStep();
  return settings;
}

}  // namespace

StimUnit::StimUnit(StimConfig config,
                   std::unique_ptr<ByteLink> link,
                   const Clock& clock,
                   Sleeper& sleeper)
    : config_(std::move(config)),
      family_(FamilyOf(config_.model)),
      link_(std::move(link)),
      clock_(clock),
      sleeper_(sleeper),
      life_(config_.silent_after),
      decoder_(family_, config_.CounterStep()),
      counter_clock_(ClockSettings(config_)) {}

StimUnit::Outcome StimUnit::Fail(InertialFailure failure) {
  if (failure == InertialFailure::kHungUp) {
    link_->Close();
    open_at_ = clock_.Steady() + config_.reconnect_period;
  }
  life_.OnFailure(failure);
  return Failure{failure};
}

void StimUnit::Forget() {
  decoder_.Reset();
  counter_clock_.Restart();
  waiting_.clear();
  next_waiting_ = 0;
  unchanged_.reset();
  last_ticks_.reset();
}

std::optional<InertialFailure> StimUnit::OpenWhenDue(SteadyTime deadline) {
  if (open_at_ > deadline) {
    sleeper_.SleepUntil(deadline);
    return InertialFailure::kNotDue;
  }
  if (open_at_ > clock_.Steady()) sleeper_.SleepUntil(open_at_);
  const auto failure = link_->Open();
  const SteadyTime now = clock_.Steady();
  if (failure) {
    open_at_ = now + config_.reconnect_period;
    return FailureFromLink(*failure);
  }
  Forget();
  life_.OnPortOpen(now);
  alive_at_ = now;
  heard_at_ = now - config_.silent_after;
  return std::nullopt;
}

StimUnit::Outcome StimUnit::Read(SteadyTime deadline) {
  if (next_waiting_ < waiting_.size()) return TakeWaiting();
  if (!link_->IsOpen()) {
    if (const auto failure = OpenWhenDue(deadline)) return Fail(*failure);
  }
  std::array<std::uint8_t, kPieceBytes> bytes;
  for (;;) {
    const SteadyTime silent_at = alive_at_ + config_.silent_after;
    const bool is_silent = clock_.Steady() >= silent_at;
    const SteadyTime until = is_silent ? deadline : std::min(deadline, silent_at);
    const auto count = link_->Read(bytes, until);
    const SteadyTime now = clock_.Steady();
    if (!count && count.error() != LinkFailure::kTimeout) {
      return Fail(FailureFromLink(count.error()));
    }
    if (count) {
      TakeBytes(std::span(bytes.data(), *count), now);
      if (!waiting_.empty()) return TakeWaiting();
    }
    const bool is_silent_now = now >= alive_at_ + config_.silent_after;
    if (now >= deadline || (is_silent_now && !is_silent)) return NothingCame(now);
  }
}

StimUnit::Outcome StimUnit::NothingCame(SteadyTime now) {
  if (now < alive_at_ + config_.silent_after) return Fail(InertialFailure::kNotDue);
  if (config_.reopen_after.count() > 0 && now - alive_at_ >= config_.reopen_after) {
    // Some USB adapters come back only when the port is closed and opened.
    link_->Close();
    life_.OnPortClosed();
  }
  const bool is_anything_heard = now - heard_at_ < config_.silent_after;
  return Fail(is_anything_heard ? InertialFailure::kGarbled : InertialFailure::kNoData);
}

// Counted when it is handed out, so that health and what the caller has seen agree.
StimUnit::Outcome StimUnit::TakeWaiting() {
  const Waiting next = waiting_[next_waiting_++];
  if (next_waiting_ == waiting_.size()) {
    waiting_.clear();
    next_waiting_ = 0;
  }
  if (next.failure) return Fail(*next.failure);
  life_.OnGood(next.sample.ends_at, clock_.Steady());
  return next.sample;
}

void StimUnit::TakeBytes(std::span<const std::uint8_t> bytes, SteadyTime now) {
  heard_at_ = now;
  civil_minus_steady_ = CivilMinusSteady(clock_);
  const StimCounts before = decoder_.counts();
  const std::uint64_t restarts_before = counter_clock_.restarts();
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const std::size_t unread = bytes.size() - 1 - i;
    std::uint64_t wrong_before = decoder_.counts().wrong_crcs;
    for (auto datagram = decoder_.Push(bytes[i]);; datagram = decoder_.Next()) {
      for (; wrong_before < decoder_.counts().wrong_crcs; ++wrong_before) {
        waiting_.push_back({{}, InertialFailure::kGarbled});
      }
      if (!datagram) break;
      TakeDatagram(*datagram, unread + decoder_.bytes_held(), now);
    }
  }
  life_.OnWire(decoder_.counts().lost - before.lost,
               decoder_.counts().skipped_bytes - before.skipped_bytes,
               counter_clock_.restarts() - restarts_before);
}

void StimUnit::TakeDatagram(const StimDatagram& datagram,
                            std::size_t bytes_behind,
                            SteadyTime now) {
  life_.OnDatagram(now);
  alive_at_ = now;
  const StimReading reading = ReadingFromStim(datagram, config_.scales);
  const auto time = Time(datagram, bytes_behind, now);
  if (const auto failure = Refuses(datagram, reading, time, now)) {
    waiting_.push_back({{}, *failure});
    return;
  }
  waiting_.push_back({MakeSample(reading, *time), std::nullopt});
}

// The bytes that stand behind the datagram came after it, and took their time on the line.
Result<CountedTime, CounterClockFailure> StimUnit::Time(const StimDatagram& datagram,
                                                        std::size_t bytes_behind,
                                                        SteadyTime now) {
  const StimLayout* layout = FindStimLayout(family_, datagram.id);
  const std::size_t length = StimLength(family_, *layout);
  const Duration latency = std::chrono::microseconds(datagram.latency_us.value_or(0));
  const std::uint64_t restarts_before = counter_clock_.restarts();
  const auto time = counter_clock_.Next(
      {datagram.counter,
       datagram.follows,
       now - config_.port.LineTime(bytes_behind + length) - latency - config_.constant_delay});
  if (counter_clock_.restarts() > restarts_before) last_ticks_.reset();
  return time;
}

std::optional<InertialFailure> StimUnit::Refuses(
    const StimDatagram& datagram,
    const StimReading& reading,
    const Result<CountedTime, CounterClockFailure>& time,
    SteadyTime now) {
  const bool is_frozen = IsFrozen(datagram, now);
  if (reading.is_starting_up) return InertialFailure::kStartingUp;
  if (reading.is_faulty) return InertialFailure::kFaulty;
  if (!time) {
    return time.error() == CounterClockFailure::kWrongRate ? InertialFailure::kWrongRate
                                                           : InertialFailure::kSettling;
  }
  if (reading.is_overloaded) return InertialFailure::kOverload;
  if (is_frozen) return InertialFailure::kFrozen;
  return std::nullopt;
}

bool StimUnit::IsFrozen(const StimDatagram& datagram, SteadyTime now) {
  const auto is_same = [](const std::optional<StimCluster>& a,
                          const std::optional<StimCluster>& b) {
    return a.has_value() == b.has_value() && (!a || a->counts == b->counts);
  };
  if (!unchanged_ || unchanged_->gyro.counts != datagram.gyro.counts ||
      !is_same(unchanged_->accel, datagram.accel)) {
    unchanged_ = datagram;
    unchanged_since_ = now;
  }
  return config_.frozen_after.count() > 0 && now - unchanged_since_ >= config_.frozen_after;
}

InertialSample StimUnit::MakeSample(const StimReading& reading, const CountedTime& time) {
  InertialSample sample;
  const Duration since_epoch = std::chrono::duration_cast<Duration>(time.at.time_since_epoch());
  sample.ends_at = {(since_epoch + civil_minus_steady_).count()};
  sample.interval_s = 1.0 / config_.scales.sample_rate_hz;
  if (last_ticks_) {
    const std::int64_t steps = (time.ticks - *last_ticks_) / config_.CounterStep();
    sample.missing_before = static_cast<std::uint32_t>(std::max<std::int64_t>(0, steps - 1));
  }
  last_ticks_ = time.ticks;
  sample.rate_rad_s = reading.rate_rad_s;
  sample.specific_force_m_s2 = reading.specific_force_m_s2;
  sample.tilt_force_m_s2 = reading.tilt_force_m_s2;
  sample.gyro_temperature_celsius = reading.gyro_temperature_celsius;
  sample.accel_temperature_celsius = reading.accel_temperature_celsius;
  sample.is_outside_conditions = reading.is_outside_conditions;
  return sample;
}

}  // namespace tbm
