#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "guidance/app/guidance_step.h"
#include "guidance/config/guidance_file.h"
#include "guidance/journal/local_record.h"
#include "guidance/journal/mcap_reader.h"

namespace tbm {

// Takes the steps of a guidance process again from its journal, and compares every bit of what it
// concluded then. Give it the messages in the order of the files.
class JournalReplay {
 public:
  // With a machine of one's own the journal's inputs are taken through another drawing or other
  // limits: then every message differs and the differences say what the change does.
  explicit JournalReplay(std::optional<ReadFile> other_machine = {});
  ~JournalReplay();

  void Take(const McapChannel& channel, const McapMessage& message);

  // Of the point that one steers by.
  struct Difference {
    std::uint64_t step_number = 0;
    Timestamp at;
    std::string topic;
    std::string what;
  };
  struct Report {
    std::uint64_t runs = 0;      // starts of the process
    std::uint64_t steps = 0;     // taken again
    std::uint64_t compared = 0;  // messages
    std::uint64_t different = 0;
    std::uint64_t skipped = 0;     // inputs and steps before the first start in the journal
    std::uint64_t lost = 0;        // inputs that the journal did not keep
    std::uint64_t unreadable = 0;  // messages that are not of this contract
    double largest_right_m = 0.0;  // difference of deviation, of the point that one steers by
    double largest_up_m = 0.0;
    std::vector<Difference> first;    // at most ten
    std::vector<std::string> faults;  // of the files in the journal
  };
  const Report& report() const { return report_; }

 private:
  struct Run;

  bool IsNew(const std::string& stream, std::uint32_t sequence, bool counts_gaps);
  void TakeFile(BytesView data);
  void TakeStep(BytesView data);
  template <class Message>
  void TakeInput(BytesView data);
  template <class Message>
  void Compare(std::string_view topic, const Message& said, std::optional<Message> now);
  void CompareGuidance(BytesView data);
  void CompareShield(BytesView data);
  void CompareAlarm(const McapMessage& message);
  void Note(std::string_view topic, std::string what);

  std::optional<ReadFile> other_machine_;
  std::map<std::string, ReadFile> files_;
  std::unique_ptr<Run> run_;
  std::map<std::string, std::uint32_t> last_sequence_;  // of each stream that counts
  Report report_;
};

}  // namespace tbm
