#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "devices/app/station_state_file.h"

// The checksum keeps nearly every input out: it is put right here, so that the lines are reached.
// What is taken must be written and read back the same.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string text(reinterpret_cast<const char*>(data), size);
  if (tbm::ParseKeptStation(text, "fuzz.state")) return 0;
  const std::size_t sum_line = text.rfind("crc32\t");
  if (sum_line != std::string::npos) text.resize(sum_line);
  std::uint32_t crc = 0xffffffffu;
  for (const char byte : text) {
    crc ^= static_cast<unsigned char>(byte);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1u) != 0 ? 0xedb88320u : 0u);
  }
  text += fmt::format("crc32\t{:08x}\n", ~crc);
  const auto kept = tbm::ParseKeptStation(text, "fuzz.state");
  if (!kept) {
    if (kept.error().empty()) __builtin_trap();
    return 0;
  }
  const std::string written = tbm::TextOf(*kept);
  const auto again = tbm::ParseKeptStation(written, "fuzz.state");
  if (!again || tbm::TextOf(*again) != written) __builtin_trap();
  return 0;
}
