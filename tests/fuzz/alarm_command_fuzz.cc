#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "guidance/core/alarm_command.h"

// What somebody on the machine's network asks of the alarms. A shelf is never longer than its alarm
// allows, and a refusal says why.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tbm;
  constexpr std::array kRules{AlarmRule{"a", AlarmPriority::kHigh, "", ""},
                              AlarmRule{"tilt_late", AlarmPriority::kLow, "", ""}};
  constexpr std::array<std::string_view, 4> kVerbs = {"acknowledge", "shelve", "unshelve", "dance"};
  if (size == 0) return 0;
  const std::string_view text(reinterpret_cast<const char*>(data) + 1, size - 1);
  AlarmBoard board(kRules);
  const Timestamp now{1'700'000'000'000'000'000};
  const auto order = AlarmOrderOf(board, kVerbs[data[0] % kVerbs.size()], text, "why");
  if (!order) {
    if (order.error().empty()) __builtin_trap();
    return 0;
  }
  Carry(*order, now, &board);
  if (order->verb != AlarmVerb::kShelve) __builtin_trap();  // nothing stands on this board
  const auto until = board.alarm(order->rule).shelved_until;
  const Duration longest = AlarmBoard::LongestShelf(board.rule(order->rule).priority);
  if (!until || *until <= now || *until - now > longest) __builtin_trap();
  return 0;
}
