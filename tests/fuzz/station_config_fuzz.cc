#include <cstddef>
#include <cstdint>
#include <string_view>

#include "devices/app/station_config.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  if (const auto config = tbm::ParseStationConfig(text, "fuzz.yaml"); !config) {
    for (const auto& fault : config.error()) {
      if (fault.Text().empty()) __builtin_trap();
    }
  }
  return 0;
}
