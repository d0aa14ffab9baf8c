#include "guidance/core/alarm_command.h"

#include <optional>

#include "pose/base/parse_number.h"

namespace tbm {
namespace {

using std::chrono::minutes;

constexpr std::string_view kBlanks = " \t";

std::optional<AlarmVerb> VerbOf(std::string_view word) {
  if (word == "acknowledge") return AlarmVerb::kAcknowledge;
  if (word == "shelve") return AlarmVerb::kShelve;
  if (word == "unshelve") return AlarmVerb::kUnshelve;
  return {};
}

std::string_view Trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

Failure<std::string> Sentence(std::string text) { return Failure<std::string>{std::move(text)}; }

std::string MinutesText(Duration span) {
  const auto count = std::chrono::duration_cast<minutes>(span).count();
  return std::to_string(count) + (count == 1 ? " minute" : " minutes");
}

Result<AlarmOrder, std::string> ShelfOf(const AlarmBoard& board,
                                        std::string_view argument,
                                        std::string_view because) {
  const std::size_t blank = argument.find_last_of(kBlanks);
  if (blank == std::string_view::npos) {
    return Sentence("wanted the alarm's code and for how many minutes, like 'tilt_late 60'");
  }
  const std::string_view code = Trimmed(argument.substr(0, blank));
  const std::string_view number = argument.substr(blank + 1);
  const auto rule = board.Find(code);
  if (!rule) return Sentence("no alarm has the code '" + std::string(code) + "'");
  const Duration longest = AlarmBoard::LongestShelf(board.rule(*rule).priority);
  const auto asked = ParseInteger(number);
  if (!asked || *asked < 1) {
    return Sentence("'" + std::string(number) + "' is no number of minutes; wanted 1 to " +
                    MinutesText(longest));
  }
  if (*asked > std::chrono::duration_cast<minutes>(longest).count()) {
    return Sentence(std::string(code) + " may be shelved for at most " + MinutesText(longest));
  }
  if (Trimmed(because).empty())
    return Sentence("say why: an alarm is not shelved without a reason");
  return AlarmOrder{*rule, AlarmVerb::kShelve, minutes(*asked)};
}

}  // namespace

bool IsAlarmVerb(std::string_view verb) { return VerbOf(verb).has_value(); }

Result<AlarmOrder, std::string> AlarmOrderOf(const AlarmBoard& board,
                                             std::string_view verb,
                                             std::string_view argument,
                                             std::string_view because) {
  const auto known = VerbOf(verb);
  if (!known) return Sentence("known are acknowledge, shelve and unshelve");
  argument = Trimmed(argument);
  if (*known == AlarmVerb::kShelve) return ShelfOf(board, argument, because);
  const auto rule = board.Find(argument);
  if (!rule) return Sentence("no alarm has the code '" + std::string(argument) + "'");
  const Alarm& alarm = board.alarm(*rule);
  if (*known == AlarmVerb::kUnshelve) {
    if (!alarm.shelved_until) return Sentence("it is not shelved");
  } else if (!alarm.is_unanswered()) {
    return Sentence("there is nothing to acknowledge");
  }
  return AlarmOrder{*rule, *known, {}};
}

std::string DoneText(const AlarmOrder& order) {
  switch (order.verb) {
    case AlarmVerb::kAcknowledge:
      return "acknowledged";
    case AlarmVerb::kShelve:
      return "shelved for " + MinutesText(order.shelf) + "; unshelve ends it earlier";
    case AlarmVerb::kUnshelve:
      return "no longer shelved";
  }
  return "";
}

void Carry(const AlarmOrder& order, Timestamp now, AlarmBoard* board) {
  if (order.rule >= board->size()) return;
  switch (order.verb) {
    case AlarmVerb::kAcknowledge:
      (void)board->Acknowledge(order.rule, now);
      break;
    case AlarmVerb::kShelve:
      (void)board->Shelve(order.rule, now + order.shelf, now);
      break;
    case AlarmVerb::kUnshelve:
      (void)board->Unshelve(order.rule);
      break;
  }
}

}  // namespace tbm
