// guidance.yaml; and, told apart by the first byte, the records that stand in its journal beside
// the topics.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "guidance/config/guidance_file.h"
#include "guidance/journal/local_record.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size > 0 && data[0] == 0) {
    const tbm::BytesView bytes(reinterpret_cast<const std::byte*>(data), size);
    const auto file = tbm::FileFrom(bytes);
    if (file && !(tbm::FileFrom(tbm::Encoded(*file)) == file)) __builtin_trap();
    const auto step = tbm::StepFrom(bytes);
    if (step && !(tbm::StepFrom(tbm::Encoded(*step)) == step)) __builtin_trap();
    return 0;
  }
  const auto config =
      tbm::ParseGuidanceConfig({reinterpret_cast<const char*>(data), size}, "guidance.yaml");
  if (!config) {
    if (config.error().empty()) __builtin_trap();  // refused without saying why
    for (const auto& fault : config.error()) {
      if (fault.Text().empty()) __builtin_trap();
    }
    return 0;
  }
  if (config->dds.interfaces.empty() || config->dds.domain < 0) __builtin_trap();
  if (config->journal_limit_bytes < 1'000'000) __builtin_trap();
  return 0;
}
