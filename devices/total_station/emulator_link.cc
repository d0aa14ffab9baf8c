#include "devices/total_station/emulator_link.h"

#include <algorithm>

namespace tbm {

std::optional<LinkFailure> EmulatorLink::Open() {
  Close();
  ++openings_;
  if (opening_failure_) return opening_failure_;
  is_open_ = true;
  instrument_.OnPlug();
  return std::nullopt;
}

void EmulatorLink::Close() {
  is_open_ = false;
  outbox_.Clear();
  arrived_.clear();
}

std::optional<LinkFailure> EmulatorLink::Write(std::span<const std::uint8_t> bytes) {
  if (!is_open_) return LinkFailure::kHungUp;
  Turn();
  instrument_.OnBytes(bytes, clock_.Steady(), outbox_);
  return std::nullopt;
}

std::optional<ByteLink::SteadyTime> EmulatorLink::Turn() {
  const auto now = clock_.Steady();
  auto wake = instrument_.OnTurn(now, outbox_);
  while (const auto message = outbox_.TakeDue(now)) {
    arrived_.insert(arrived_.end(), message->begin(), message->end());
  }
  if (outbox_.TakeHangUp()) Close();
  if (const auto due = outbox_.NextDue()) wake = wake ? std::min(*wake, *due) : due;
  return wake;
}

Result<std::size_t, LinkFailure> EmulatorLink::Read(std::span<std::uint8_t> into,
                                                    SteadyTime until) {
  while (is_open_) {
    const auto wake = Turn();
    if (!arrived_.empty()) {
      const std::size_t count = std::min(into.size(), arrived_.size());
      std::copy_n(arrived_.begin(), count, into.begin());
      arrived_.erase(arrived_.begin(), arrived_.begin() + static_cast<std::ptrdiff_t>(count));
      return count;
    }
    if (!is_open_) break;
    if (clock_.Steady() >= until) return Failure{LinkFailure::kTimeout};
    sleeper_.SleepUntil(wake ? std::min(*wake, until) : until);
  }
  return Failure{LinkFailure::kHungUp};
}

std::size_t EmulatorLink::Discard() {
  if (is_open_) Turn();
  const std::size_t count = arrived_.size();
  arrived_.clear();
  return count;
}

}  // namespace tbm
