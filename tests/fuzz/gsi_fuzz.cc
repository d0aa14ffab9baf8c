#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "devices/gsi/gsi.h"
#include "devices/gsi/gsi_record.h"
#include "devices/gsi/survey_csv.h"

namespace {

// What a record holds can be written, or the reason said; what is written is a block again.
void WriteAgain(const tbm::GsiRecord& record) {
  const auto line = tbm::GsiLine(record, 1, {});
  if (!line) {
    if (line.error().empty()) __builtin_trap();
    return;
  }
  const auto again = tbm::ParseGsi(*line, "again.gsi");
  if (!again || again->size() != 1 || !tbm::RecordOf(again->front(), "again.gsi")) __builtin_trap();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  (void)tbm::LooksLikeGsi(text);
  (void)tbm::ReadSurveyCsv(std::string(text), "log.csv").has_value();
  const auto blocks = tbm::ParseGsi(text, "log.gsi");
  if (!blocks) {
    (void)blocks.error().Text();
    return 0;
  }
  for (const tbm::GsiBlock& block : *blocks) {
    const auto record = tbm::RecordOf(block, "log.gsi");
    if (record && *record) WriteAgain(**record);
    const auto point = tbm::PointOf(block, "log.gsi");
    if (point && *point &&
        !std::isfinite((*point)->east_m + (*point)->north_m + (*point)->height_m)) {
      __builtin_trap();
    }
  }
  return 0;
}
