#include "devices/inclinometer/modbus_emulator.h"

#include <numbers>

namespace tbm {
namespace {

// RTU ends a message by 3.5 characters of silence; a scheduler's pause must not look like one.
constexpr std::chrono::milliseconds kMessageGap(50);

constexpr std::uint8_t kIllegalFunction = 1;
constexpr std::uint8_t kIllegalAddress = 2;

}  // namespace

ModbusEmulator::ModbusEmulator(SerialSettings line,
                               std::vector<EmulatedModbusTilt> tilts,
                               std::chrono::nanoseconds think_time,
                               const Clock& clock)
    : line_(std::move(line)),
      tilts_(std::move(tilts)),
      last_(tilts_.size()),
      think_time_(think_time),
      clock_(clock),
      server_(line_.path, *this) {}

void ModbusEmulator::OnBytes(std::span<const std::uint8_t> bytes,
                             SteadyTime now,
                             PtyOutbox& outbox) {
  if (now - held_since_ > kMessageGap) held_.clear();
  held_since_ = now;
  held_.insert(held_.end(), bytes.begin(), bytes.end());
  while (held_.size() >= kModbusReadRequestSize) {
    const auto request = ParseModbusRequest(std::span(held_).first(kModbusReadRequestSize));
    const std::size_t used = request ? kModbusReadRequestSize : 1;
    held_.erase(held_.begin(), held_.begin() + static_cast<std::ptrdiff_t>(used));
    if (request) Answer(*request, now, outbox);
  }
}

void ModbusEmulator::Answer(const ModbusReadRequest& request, SteadyTime now, PtyOutbox& outbox) {
  for (std::size_t i = 0; i < tilts_.size(); ++i) {
    if (tilts_[i].slave_id != request.slave_id) continue;
    ++requests_seen_;
    const std::optional<EmulatorFault> fault = faults_.Take();
    const auto heard = line_.LineTime(kModbusReadRequestSize);
    SayReply(ReplyTo(request, tilts_[i], &last_[i], fault, clock_.Now() + heard),
             fault,
             now + heard + think_time_,
             line_,
             outbox);
    return;
  }
}

std::vector<std::uint8_t> ModbusEmulator::ReplyTo(const ModbusReadRequest& request,
                                                  EmulatedModbusTilt& tilt,
                                                  Inclination* last,
                                                  const std::optional<EmulatorFault>& fault,
                                                  Timestamp sensed_at) const {
  const ModbusRegisterMap& map = tilt.registers;
  if (request.function != map.function) return EncodeModbusException(request, kIllegalFunction);
  const int offset = request.first_register - map.First();
  if (offset < 0 || request.count < 1 || offset + request.count > map.Count()) {
    return EncodeModbusException(request, kIllegalAddress);
  }
  Inclination angles = *last;
  if (!fault || fault->kind != EmulatorFaultKind::kFrozen) angles = tilt.truth(sensed_at);
  if (fault && fault->kind == EmulatorFaultKind::kOutOfRange) {
    angles = {std::numbers::pi, -std::numbers::pi};
  }
  *last = angles;
  const auto registers = EncodeRegisters(map, {angles, tilt.temperature_celsius});
  ModbusReadRequest answered = request;
  if (fault && fault->kind == EmulatorFaultKind::kOtherId) answered.slave_id ^= 0x40;
  return EncodeModbusReply(answered,
                           std::span(registers).subspan(static_cast<std::size_t>(offset),
                                                        static_cast<std::size_t>(request.count)));
}

}  // namespace tbm
