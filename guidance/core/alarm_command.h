#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "guidance/core/alarm_board.h"
#include "pose/base/result.h"
#include "pose/base/time.h"

namespace tbm {

// What people may ask of any process that has alarms (idl/README.md, "Commands").
enum class AlarmVerb { kAcknowledge, kShelve, kUnshelve };

struct AlarmOrder {
  std::size_t rule = 0;  // into the board
  AlarmVerb verb = AlarmVerb::kAcknowledge;
  Duration shelf{};  // how long from now; of kShelve alone
};

// "acknowledge", "shelve", "unshelve".
bool IsAlarmVerb(std::string_view verb);

// The order that the words of a command give, found possible as the board stands. `argument` is the
// alarm's code; of "shelve" code and whole minutes, "tilt_late 60", and `because` must not be
// empty. Otherwise a sentence for the person who asked.
Result<AlarmOrder, std::string> AlarmOrderOf(const AlarmBoard& board,
                                             std::string_view verb,
                                             std::string_view argument,
                                             std::string_view because);

// The sentence for the person who asked when it is carried out.
std::string DoneText(const AlarmOrder& order);

// What is not possible any more changes nothing.
void Carry(const AlarmOrder& order, Timestamp now, AlarmBoard* board);

}  // namespace tbm
