#include <cstddef>
#include <cstdint>
#include <string_view>

#include "guidance/rail_vision/target_mark.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto mark = tbm::ParseTargetMark(text);
  if (!mark) {
    if (std::string_view(tbm::Advice(mark.error())).empty()) __builtin_trap();
    return 0;
  }
  // What is accepted can be looked for.
  const bool is_board = mark->kind == tbm::TargetKind::kBoard;
  if (is_board && (mark->point < 0 || mark->point >= mark->columns * mark->rows)) __builtin_trap();
  if (mark->kind == tbm::TargetKind::kCircle && !(mark->diameter_m > 0.0)) __builtin_trap();
  if (mark->code < 0 || mark->code > 49) __builtin_trap();
  return 0;
}
