#include "devices/inclinometer/bcd_frame_emulator.h"

#include <algorithm>
#include <utility>

#include "pose/base/angle.h"

namespace tbm {
namespace {

constexpr double kBeyondAnyRangeDeg = 999.99;

std::vector<std::uint8_t> ToVector(const FrameBytes& bytes) { return {bytes.begin(), bytes.end()}; }

}  // namespace

BcdFrameEmulator::BcdFrameEmulator(SerialSettings line,
                                   FrameFamily family,
                                   std::vector<EmulatedFrameTilt> tilts,
                                   std::chrono::nanoseconds think_time,
                                   std::chrono::nanoseconds automatic_period,
                                   const Clock& clock)
    : line_(std::move(line)),
      family_(family),
      units_(MakeUnits(std::move(tilts))),
      think_time_(think_time),
      automatic_period_(automatic_period),
      clock_(clock),
      decoder_(family),
      server_(line_.path, *this) {}

std::vector<BcdFrameEmulator::Unit> BcdFrameEmulator::MakeUnits(
    std::vector<EmulatedFrameTilt> tilts) {
  std::vector<Unit> units;
  units.reserve(tilts.size());
  for (EmulatedFrameTilt& tilt : tilts) units.push_back({std::move(tilt), {}, std::nullopt});
  return units;
}

void BcdFrameEmulator::OnPlug() {
  decoder_.Reset();
  for (Unit& unit : units_) unit.next_automatic.reset();
}

void BcdFrameEmulator::OnBytes(std::span<const std::uint8_t> bytes,
                               SteadyTime now,
                               PtyOutbox& outbox) {
  for (const std::uint8_t byte : bytes) {
    for (auto frame = decoder_.Push(byte); frame; frame = decoder_.Next()) {
      OnFrame(*frame, now, outbox);
    }
  }
}

void BcdFrameEmulator::OnFrame(const BcdFrame& frame, SteadyTime now, PtyOutbox& outbox) {
  for (Unit& unit : units_) {
    if (unit.tilt.address != frame.address) continue;
    const auto heard = now + line_.LineTime(frame.data.size() + kFrameMinLength + 1);
    if (frame.command == frame_command::kReadAngles) {
      ++requests_seen_;
      SendAngles(unit, heard, now, outbox);
    } else if (frame.command == frame_command::kSetOutput && frame.data.size() == 1) {
      unit.next_automatic.reset();
      if (frame.data[0] != 0) unit.next_automatic = heard + automatic_period_;
      BcdFrame done{frame.address, frame_command::kSetOutput | frame_command::kReply, {}};
      done.data.push_back(0);
      auto bytes = ToVector(EncodeFrame(family_, done));
      const auto due = heard + think_time_ + line_.LineTime(bytes.size());
      outbox.At(due, std::move(bytes));
    }
  }
}

void BcdFrameEmulator::SendAngles(Unit& unit,
                                  SteadyTime sensed,
                                  SteadyTime now,
                                  PtyOutbox& outbox) {
  const std::optional<EmulatorFault> fault = faults_.Take();
  const auto is = [&](EmulatorFaultKind kind) { return fault && fault->kind == kind; };
  if (!is(EmulatorFaultKind::kFrozen)) unit.last = unit.tilt.truth(clock_.Now() + (sensed - now));
  FrameAngles angles{RadToDeg(unit.last.beta_rad), RadToDeg(unit.last.gamma_rad), unit.tilt.third};
  if (is(EmulatorFaultKind::kOutOfRange)) angles.x_deg = angles.y_deg = kBeyondAnyRangeDeg;

  const int address = unit.tilt.address ^ (is(EmulatorFaultKind::kOtherId) ? 0x40 : 0);
  const BcdFrame reply = EncodeAngles(static_cast<std::uint8_t>(address), unit.tilt.layout, angles);
  SayReply(ToVector(EncodeFrame(family_, reply)), fault, sensed + think_time_, line_, outbox);
}

std::optional<PtyInstrument::SteadyTime> BcdFrameEmulator::OnTurn(SteadyTime now,
                                                                  PtyOutbox& outbox) {
  std::optional<SteadyTime> next;
  for (Unit& unit : units_) {
    if (!unit.next_automatic) continue;
    if (*unit.next_automatic <= now) {
      SendAngles(unit, now, now, outbox);
      unit.next_automatic = std::max(*unit.next_automatic + automatic_period_, now);
    }
    next = next ? std::min(*next, *unit.next_automatic) : unit.next_automatic;
  }
  return next;
}

}  // namespace tbm
