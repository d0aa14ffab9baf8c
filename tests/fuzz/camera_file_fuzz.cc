#include <cstddef>
#include <cstdint>
#include <string_view>

#include "guidance/config/camera_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto camera =
      tbm::ParseCameraFile({reinterpret_cast<const char*>(data), size}, "camera.yaml");
  if (!camera) {
    if (camera.error().empty()) __builtin_trap();  // refused without saying why
    for (const auto& fault : camera.error()) (void)fault.Text();
    return 0;
  }
  // What is accepted can be inverted in the corners of its image.
  if (!tbm::NormalisedFromPixel(*camera, {0.0, 0.0})) __builtin_trap();
  return 0;
}
