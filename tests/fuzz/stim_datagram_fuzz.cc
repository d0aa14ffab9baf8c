// Arbitrary bytes on the wire of a Sensonor unit.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "devices/imu/counter_clock.h"
#include "devices/imu/stim_encoder.h"

namespace {

void CheckReading(const tbm::StimDatagram& datagram) {
  for (const auto output : {tbm::StimOutput::kRate, tbm::StimOutput::kIncrement}) {
    tbm::StimScales scales;
    scales.gyro = scales.accel = scales.tilt = output;
    const tbm::StimReading reading = tbm::ReadingFromStim(datagram, scales);
    if (!reading.rate_rad_s.allFinite()) std::abort();
    if (reading.specific_force_m_s2 && !reading.specific_force_m_s2->allFinite()) std::abort();
    if (reading.tilt_force_m_s2 && !reading.tilt_force_m_s2->allFinite()) std::abort();
  }
}

void Decode(tbm::StimFamily family, const std::uint8_t* data, std::size_t size) {
  tbm::StimDecoder decoder(family, 4);
  tbm::CounterClock clock({});
  std::size_t datagram_bytes = 0;
  std::chrono::steady_clock::time_point now{};
  for (std::size_t i = 0; i < size; ++i) {
    now += std::chrono::microseconds(10 * data[i]);
    for (auto datagram = decoder.Push(data[i]); datagram; datagram = decoder.Next()) {
      const tbm::StimLayout* layout = tbm::FindStimLayout(family, datagram->id);
      if (layout == nullptr) std::abort();
      // Written again it is as long as it was.
      const std::size_t length = tbm::StimLength(family, *layout);
      if (tbm::EncodeStim(family, *datagram, false).size() != length) std::abort();
      datagram_bytes += length;
      CheckReading(*datagram);
      const auto time = clock.Next({datagram->counter, datagram->follows, now});
      if (time && time->ticks < 0) std::abort();
    }
  }
  // Every byte is in a datagram, between two, skipped, or still held.
  const tbm::StimCounts& counts = decoder.counts();
  const std::size_t accounted = datagram_bytes + counts.terminator_bytes + counts.skipped_bytes;
  if (accounted + decoder.bytes_held() != size) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Decode(tbm::StimFamily::kStim300, data, size);
  Decode(tbm::StimFamily::kStim210, data, size);
  return 0;
}
