#include "hmi_bridge/core/commands.h"

#include <algorithm>
#include <array>
#include <utility>

#include "idl/cpp/words.h"

namespace tbm::hmi {
namespace {

struct VerbRow {
  std::string_view verb;
  Role role;
  bool of_guidance;
  bool of_station;
  bool of_bridge;
};

// idl/README.md, "Commands".
constexpr std::array<VerbRow, 11> kVerbs{{
    {"acknowledge", Role::kOperator, true, true, true},
    {"shelve", Role::kOperator, true, true, true},
    {"unshelve", Role::kOperator, true, true, true},
    {"check_references", Role::kSurveyor, false, true, false},
    {"set_up", Role::kSurveyor, false, true, false},
    {"propose_move", Role::kSurveyor, false, true, false},
    {"take_over_move", Role::kSurveyor, false, true, false},
    {"give_up_move", Role::kSurveyor, false, true, false},
    {"undo_move", Role::kSurveyor, false, true, false},
    {"pause", Role::kSurveyor, false, true, false},
    {"resume", Role::kSurveyor, false, true, false},
}};

Failure<ApiFault> Bad(std::string text) {
  return Failure<ApiFault>{ApiFault{400, "bad_request", std::move(text)}};
}

bool HasControls(std::string_view text) {
  return std::any_of(text.begin(), text.end(), [](char c) {
    return static_cast<unsigned char>(c) < 0x20 || c == 0x7f;
  });
}

// Cut off is another command than the one that was meant.
std::optional<std::string> TextFault(std::string_view name,
                                     std::string_view text,
                                     std::size_t most) {
  if (text.size() > most) {
    return std::string(name) + " is longer than " + std::to_string(most) + " bytes";
  }
  if (HasControls(text)) return std::string(name) + " has control characters in it";
  return {};
}

}  // namespace

Result<dds::Command, ApiFault> CommandOf(const CommandRequest& request,
                                         std::string_view user,
                                         Role role) {
  dds::Command command;
  const bool is_guidance = request.addressee == "guidance";
  const bool is_station = request.addressee == "total_station";
  const bool is_bridge = request.addressee == kOwnAddressee;
  if (!is_guidance && !is_station && !is_bridge) {
    return Bad("addressee '" + request.addressee +
               "' is not known; known are guidance, total_station and hmi_bridge");
  }
  const auto row = std::find_if(kVerbs.begin(), kVerbs.end(), [&](const VerbRow& candidate) {
    return candidate.verb == request.verb &&
           ((is_guidance && candidate.of_guidance) || (is_station && candidate.of_station) ||
            (is_bridge && candidate.of_bridge));
  });
  if (row == kVerbs.end()) {
    return Bad(request.addressee + " does not know the verb '" + request.verb + "'");
  }
  if (role < row->role) {
    return Failure<ApiFault>{ApiFault{403,
                                      "forbidden",
                                      "'" + request.verb + "' is for the role " +
                                          std::string(Word(row->role)) + "; you are " +
                                          std::string(Word(role))}};
  }
  for (const auto& fault :
       {TextFault("argument", request.argument, decltype(command.argument)::capacity()),
        TextFault("because", request.because, decltype(command.because)::capacity()),
        TextFault("user", user, decltype(command.by)::capacity())}) {
    if (fault) return Bad(*fault);
  }
  command.addressee = std::string_view(request.addressee);
  command.verb = std::string_view(request.verb);
  command.argument = std::string_view(request.argument);
  command.because = std::string_view(request.because);
  command.by = user;
  return command;
}

void CommandLog::Add(const dds::Command& command, std::int64_t now_steady_ms) {
  if (entries_.size() == kMost) entries_.pop_front();
  entries_.push_back({.command = command, .sent_steady_ms = now_steady_ms});
}

void CommandLog::Withdraw(std::string_view request_id) {
  std::erase_if(entries_,
                [&](const Entry& entry) { return entry.command.request_id.view() == request_id; });
}

bool CommandLog::Add(const dds::CommandReply& reply) {
  for (Entry& entry : entries_) {
    if (!(entry.command.request_id == reply.request_id) ||
        entry.command.addressee.view() != reply.source.view()) {
      continue;
    }
    entry.state = std::string(dds::WordOf(reply.outcome));
    entry.text = std::string(reply.text.view());
    return true;
  }
  return false;
}

bool CommandLog::Tick(std::int64_t now_steady_ms) {
  bool changed = false;
  for (Entry& entry : entries_) {
    if (entry.state != "sent" || now_steady_ms - entry.sent_steady_ms < kAnswerWithin_ms) continue;
    entry.state = "unanswered";
    changed = true;
  }
  return changed;
}

Json CommandLog::View() const {
  Json views = Json::array();
  for (auto entry = entries_.rbegin(); entry != entries_.rend(); ++entry) {
    const dds::Command& command = entry->command;
    views.push_back({{"request_id", std::string(command.request_id.view())},
                     {"addressee", std::string(command.addressee.view())},
                     {"verb", std::string(command.verb.view())},
                     {"argument", std::string(command.argument.view())},
                     {"by", std::string(command.by.view())},
                     {"because", std::string(command.because.view())},
                     {"issued_at_utc_ms", Milliseconds(command.issued_at)},
                     {"state", entry->state},
                     {"text", entry->text}});
  }
  return views;
}

}  // namespace tbm::hmi
