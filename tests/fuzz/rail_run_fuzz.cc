// A rail run of which one file comes from outside: the first byte says which, and whether its bytes
// are the file or lie over a good one from a place on. What is accepted is solved.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <string>

#include "guidance/rail/rail_line.h"
#include "tests/guidance/rail/small_rail_run.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const tbm::RailRunTexts kWhole = tbm::test::SmallRailRun();
  if (size < 3) return 0;
  tbm::RailRunTexts texts = kWhole;
  auto file = texts.begin();
  std::advance(file, data[0] % texts.size());
  const std::string bytes(reinterpret_cast<const char*>(data) + 3, size - 3);
  if (data[0] & 0x80) {
    const std::size_t at = (data[1] * 256u + data[2]) % file->second.size();
    file->second.replace(at, std::min(bytes.size(), file->second.size() - at), bytes);
  } else {
    file->second = bytes;
  }
  const auto run = tbm::ParseRailRun("run", std::move(texts));
  if (!run) {
    if (run.error().empty()) __builtin_trap();  // refused without saying why
    for (const auto& fault : run.error()) {
      if (fault.Text().empty()) __builtin_trap();
    }
    return 0;
  }
  const auto line = tbm::SolveRailLine(run->setup, run->recording, tbm::RailMethod::kSmoothed);
  if (!line) return 0;
  for (const tbm::RailPoint& point : line->points) {
    if (!point.position_world_m.allFinite()) __builtin_trap();
    if (!(point.sigma_world_m.minCoeff() > 0.0)) __builtin_trap();
  }
  return 0;
}
