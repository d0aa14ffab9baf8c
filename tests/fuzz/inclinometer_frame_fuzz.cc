// Arbitrary bytes on the wire of a 0x68 / 0x77 inclinometer.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "devices/inclinometer/bcd_frame_protocol.h"

namespace {

void Decode(tbm::FrameFamily family, const std::uint8_t* data, std::size_t size) {
  tbm::BcdFrameDecoder decoder(family);
  std::size_t frame_bytes = 0;
  for (std::size_t i = 0; i < size; ++i) {
    for (auto frame = decoder.Push(data[i]); frame; frame = decoder.Next()) {
      frame_bytes += frame->data.size() + tbm::kFrameMinLength + 1;
      const auto angles = tbm::DecodeAngles(family, *frame);
      if (!angles) continue;
      // Four digits before the point at most, whatever came in.
      if (!(std::abs(angles->x_deg) < 1000.0) || !(std::abs(angles->y_deg) < 1000.0)) std::abort();
    }
  }
  // Every byte is in a frame, skipped, or still held.
  if (frame_bytes + decoder.skipped_bytes() + decoder.bytes_held() != size) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Decode(tbm::FrameFamily::kRion68, data, size);
  Decode(tbm::FrameFamily::kBewis77, data, size);
  return 0;
}
