#include "devices/inclinometer/bcd_frame_wire.h"

#include <array>

#include "devices/inclinometer/link_failure.h"

namespace tbm {

Result<WireReading, AngleFailure> ReadingFromFrame(FrameFamily family,
                                                   const BcdFrame& frame,
                                                   bool swap_axes) {
  const auto angles = DecodeAngles(family, frame);
  if (!angles) return Failure{angles.error()};
  WireReading reading;
  reading.raw = {DegToRad(swap_axes ? angles->y_deg : angles->x_deg),
                 DegToRad(swap_axes ? angles->x_deg : angles->y_deg)};
  if (angles->third_is_temperature) reading.temperature_celsius = angles->third;
  reading.request_characters = kFrameMinLength + 1;
  reading.reply_characters = frame.data.size() + kFrameMinLength + 1;
  return reading;
}

std::optional<InclinometerFailure> BcdFrameWire::Open() {
  const auto failure = link_->Open();
  if (!failure) return std::nullopt;
  return FailureFromLink(*failure);
}

Result<WireReading, InclinometerFailure> BcdFrameWire::Ask(const InclinometerConfig& instrument) {
  const auto address = static_cast<std::uint8_t>(instrument.address);
  const FrameBytes request = AnglesRequest(family_, address);
  if (const auto failure = link_->Write({request.data(), request.size()})) {
    return Failure{FailureFromLink(*failure)};
  }
  const auto until = clock_.Steady() + instrument.response_timeout;
  BcdFrameDecoder decoder(family_);
  bool is_anything_received = false;
  bool is_other_address = false;
  std::array<std::uint8_t, 64> bytes;
  for (;;) {
    const auto count = link_->Read(bytes, until);
    if (!count && count.error() != LinkFailure::kTimeout) {
      return Failure{FailureFromLink(count.error())};
    }
    if (!count) break;
    is_anything_received = true;
    for (std::size_t i = 0; i < *count; ++i) {
      for (auto frame = decoder.Push(bytes[i]); frame; frame = decoder.Next()) {
        if (frame->address != address) {
          is_other_address = true;
          continue;
        }
        const auto reading = ReadingFromFrame(family_, *frame, instrument.swap_axes);
        if (reading) return reading.value();
        if (reading.error() != AngleFailure::kNotAngles) {
          return Failure{InclinometerFailure::kGarbled};
        }
      }
    }
  }
  if (is_other_address) return Failure{InclinometerFailure::kOtherInstrument};
  return Failure{is_anything_received ? InclinometerFailure::kGarbled
                                      : InclinometerFailure::kNoReply};
}

}  // namespace tbm
