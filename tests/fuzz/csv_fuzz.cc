#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "devices/replay/csv.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::array<std::string_view, 2> kColumns = {"a", "b"};
  // Half of the inputs get a good header, so that the search does not have to find one.
  std::string text = size % 2 == 0 ? "a,b,c\n" : "";
  text.append(reinterpret_cast<const char*>(data), size);
  auto parsed = tbm::CsvTable::Parse(std::move(text), "f.csv", kColumns);
  if (!parsed) {
    (void)parsed.error().Text();
    return 0;
  }
  const tbm::CsvTable table = std::move(parsed).value();
  for (std::size_t row = 0; row < table.row_count(); ++row) {
    for (std::size_t column = 0; column < table.columns().size(); ++column) {
      (void)table.Finite(row, column).has_value();
      (void)table.Integer(row, column).has_value();
    }
  }
  return 0;
}
