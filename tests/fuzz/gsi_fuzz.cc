#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "devices/gsi/gsi.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  (void)tbm::LooksLikeGsi(text);
  const auto blocks = tbm::ParseGsi(text, "log.gsi");
  if (!blocks) {
    (void)blocks.error().Text();
    return 0;
  }
  for (const tbm::GsiBlock& block : *blocks) {
    const auto point = tbm::PointOf(block, "log.gsi");
    if (point && *point &&
        !std::isfinite((*point)->east_m + (*point)->north_m + (*point)->height_m)) {
      __builtin_trap();
    }
  }
  return 0;
}
