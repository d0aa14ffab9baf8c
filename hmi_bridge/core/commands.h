#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <string_view>

#include "hmi_bridge/core/view_json.h"
#include "hmi_bridge/server/console_source.h"
#include "idl/cpp/guidance_messages.h"
#include "pose/base/result.h"

namespace tbm::hmi {

inline constexpr std::string_view kOwnAddressee = "hmi_bridge";

// The command that a person of this role may give with these words; addressee, verb and lengths
// are checked, the rest is the addressee's. Otherwise what to answer: 400 for words that make no
// command, 403 for a role that may not.
Result<dds::Command, ApiFault> CommandOf(const CommandRequest& request,
                                         std::string_view user,
                                         Role role);

// What was asked of late and what became of it. Bounded; newest first in the view.
class CommandLog {
 public:
  static constexpr std::size_t kMost = 30;
  // An addressee that lives says at least "accepted" within this.
  static constexpr std::int64_t kAnswerWithin_ms = 8000;

  void Add(const dds::Command& command, std::int64_t now_steady_ms);
  // One that could not be sent after all.
  void Withdraw(std::string_view request_id);
  // False for the answer to somebody else's command.
  bool Add(const dds::CommandReply& reply);
  // True when a command has become "unanswered".
  bool Tick(std::int64_t now_steady_ms);
  Json View() const;

 private:
  struct Entry {
    dds::Command command;
    std::int64_t sent_steady_ms = 0;
    std::string state = "sent";
    std::string text{};
  };

  std::deque<Entry> entries_;  // oldest first
};

}  // namespace tbm::hmi
