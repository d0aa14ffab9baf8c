#include <cstddef>
#include <cstdint>
#include <string>

#include "guidance/app/chain_input.h"

// The guidance.csv of tbm export as `tbm check` reads it. Whatever is accepted is a track in order
// of time, without a number that is none in what is valid.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto record =
      tbm::ParseGuidanceCsv(std::string(reinterpret_cast<const char*>(data), size), "fuzz.csv");
  if (!record) {
    if (record.error().empty()) __builtin_trap();  // refused without saying why
    return 0;
  }
  for (const auto& [name, track] : record->tracks) {
    for (std::size_t i = 0; i < track.size(); ++i) {
      if (i > 0 && track[i].at <= track[i - 1].at) __builtin_trap();
      if (!track[i].is_valid) continue;
      if (!track[i].p_in_site_m.allFinite() || !track[i].covariance_m2.allFinite()) {
        __builtin_trap();
      }
    }
  }
  return 0;
}
