#include "devices/inclinometer/streamed_inclinometer.h"

#include <algorithm>
#include <array>

#include "devices/inclinometer/bcd_frame_wire.h"
#include "devices/inclinometer/link_failure.h"

namespace tbm {
namespace {

constexpr std::chrono::seconds kAskAgainPeriod(1);

}  // namespace

StreamedInclinometer::StreamedInclinometer(InclinometerConfig config,
                                           FrameFamily family,
                                           std::unique_ptr<ByteLink> link,
                                           const Clock& clock,
                                           Sleeper& sleeper)
    : config_(std::move(config)),
      family_(family),
      link_(std::move(link)),
      clock_(clock),
      sleeper_(sleeper),
      life_(config_.silent_after),
      gate_({config_.range_rad, config_.max_step_rad, config_.frozen_after, config_.silent_after}),
      decoder_(family) {}

Result<TiltSample, InclinometerFailure> StreamedInclinometer::Fail(InclinometerFailure failure) {
  if (failure == InclinometerFailure::kHungUp) {
    link_->Close();
    open_at_ = clock_.Steady() + config_.reconnect_period;
  }
  life_.OnFailure(failure);
  return Failure{failure};
}

std::optional<InclinometerFailure> StreamedInclinometer::OpenWhenDue(SteadyTime deadline) {
  if (open_at_ > deadline) {
    sleeper_.SleepUntil(deadline);
    return InclinometerFailure::kNotDue;
  }
  if (open_at_ > clock_.Steady()) sleeper_.SleepUntil(open_at_);
  const auto failure = link_->Open();
  const SteadyTime now = clock_.Steady();
  if (failure) {
    open_at_ = now + config_.reconnect_period;
    return FailureFromLink(*failure);
  }
  decoder_.Reset();
  life_.OnPortOpen(now);
  alive_at_ = now;
  return AskForOutput(now);
}

std::optional<InclinometerFailure> StreamedInclinometer::AskForOutput(SteadyTime now) {
  ask_again_at_ = now + std::max<std::chrono::nanoseconds>(kAskAgainPeriod, config_.silent_after);
  const FrameBytes request =
      OutputModeRequest(family_,
                        static_cast<std::uint8_t>(config_.address),
                        static_cast<std::uint8_t>(config_.automatic_rate_code));
  if (const auto failure = link_->Write({request.data(), request.size()})) {
    return FailureFromLink(*failure);
  }
  return std::nullopt;
}

Result<TiltSample, InclinometerFailure> StreamedInclinometer::Read(SteadyTime deadline) {
  if (!link_->IsOpen()) {
    if (const auto failure = OpenWhenDue(deadline)) return Fail(*failure);
  }
  std::array<std::uint8_t, 256> bytes;
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
      const auto newest = TakeNewest(std::span(bytes.data(), *count));
      if (!newest) return Fail(newest.error());
      if (newest.value()) return *newest.value();
      if (now < deadline) continue;
    }
    if (now < alive_at_ + config_.silent_after) {
      if (now < deadline) continue;
      return Fail(InclinometerFailure::kNotDue);
    }
    if (config_.reopen_after.count() > 0 && now - alive_at_ >= config_.reopen_after) {
      // Some USB adapters come back only when the port is closed and opened.
      link_->Close();
      life_.OnPortClosed();
    } else if (now >= ask_again_at_) {
      if (const auto failure = AskForOutput(now)) return Fail(*failure);
    }
    return Fail(InclinometerFailure::kNoReply);
  }
}

// Frames that came in one piece cannot be told apart in time: only the newest has a known instant.
// Damage is counted also when a good frame follows in the same piece.
Result<std::optional<TiltSample>, InclinometerFailure> StreamedInclinometer::TakeNewest(
    std::span<const std::uint8_t> bytes) {
  const SteadyTime now = clock_.Steady();
  const Timestamp now_utc = clock_.Now();
  std::optional<WireReading> newest;
  std::optional<InclinometerFailure> damage;
  const auto note = [&](InclinometerFailure failure) {
    if (damage) life_.OnFailure(*damage);
    damage = failure;
  };
  for (const std::uint8_t byte : bytes) {
    const std::uint64_t wrong_before = decoder_.wrong_sums();
    for (auto frame = decoder_.Push(byte); frame; frame = decoder_.Next()) {
      const auto reading = ReadingFromFrame(family_, *frame, config_.swap_axes);
      if (frame->address != static_cast<std::uint8_t>(config_.address)) {
        note(InclinometerFailure::kOtherInstrument);
      } else if (reading) {
        life_.OnRequest();
        if (newest) life_.OnStale();
        newest = reading.value();
      } else if (reading.error() != AngleFailure::kNotAngles) {
        note(InclinometerFailure::kGarbled);
      }
    }
    if (decoder_.wrong_sums() > wrong_before) note(InclinometerFailure::kGarbled);
  }
  if (!newest) {
    if (damage) return Failure{*damage};  // counted by the caller
    return std::optional<TiltSample>();
  }
  if (damage) life_.OnFailure(*damage);
  if (const auto refused = gate_.Refuses(newest->raw, now)) return Failure{*refused};
  const Timestamp sensed_at =
      now_utc - config_.port.LineTime(newest->reply_characters) - config_.latency;
  life_.OnGood(sensed_at, now);
  alive_at_ = now;
  return std::optional(TiltSample{sensed_at, newest->raw, newest->temperature_celsius});
}

}  // namespace tbm
