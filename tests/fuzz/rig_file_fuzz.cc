#include <cstddef>
#include <cstdint>
#include <string_view>

#include "pose/rig/rig_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto loaded = tbm::ParseRig({reinterpret_cast<const char*>(data), size}, "rig.yaml");
  if (!loaded) {
    if (loaded.error().empty()) __builtin_trap();  // refused without saying why
    for (const auto& fault : loaded.error()) (void)fault.Text();
  } else if (loaded->rig.leds.size() < tbm::kMinLeds || loaded->rig.camera.image_width_px < 16) {
    __builtin_trap();
  }
  return 0;
}
