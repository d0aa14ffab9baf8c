#include <cstddef>
#include <cstdint>

#include "devices/replay/image_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // A size as a rig would ask for it, so that a header's promise never takes the machine's memory.
  for (const tbm::ImageSize expected : {tbm::ImageSize{13, 9}, tbm::ImageSize{64, 48}}) {
    const auto image = tbm::ParseImage({data, size}, expected);
    if (!image) continue;
    const std::size_t wanted = static_cast<std::size_t>(expected.width_px) *
                               static_cast<std::size_t>(expected.height_px) *
                               static_cast<std::size_t>(image->bytes_per_pixel);
    if (image->size != expected || image->bytes.size() != wanted) __builtin_trap();
  }
  return 0;
}
