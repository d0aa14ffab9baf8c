#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "guidance/core/alarm_board.h"
#include "idl/cpp/messages.h"
#include "pose/base/result.h"

namespace tbm::hmi {

// What the bridge itself misses. The code stands in journals: append only.
enum class ConsoleAlarm {
  kGuidanceSilent,
  kCameraBoxSilent,
  kTotalStationSilent,
  kNoNetwork,
  kOtherMachineFile,
  kClockDisagrees,
  kSecondWriter,
  kInterfaceMismatch,
  kIncompatibleQos,
  kSampleRejected,
  kCalibrationDue,
  kDdsStartFailed,
  kTooManyEvents,
};
inline constexpr int kConsoleAlarmCount = 13;

// "guidance_silent".
std::string_view CodeOf(ConsoleAlarm alarm);

// Somebody has answered the alarm of this event: kept over a restart of the bridge.
struct Answer {
  Timestamp event_at;
  std::string by;

  bool operator==(const Answer&) const = default;
};

// The alarms that no process keeps a state for: what the bridge misses, and events of any process
// that stand. Each goes by its key, "source/code". Pure: the same calls give the same states.
//
// A process that raised an event and is gone has not cleared it: it stands until somebody has
// answered it and its process says that it is over.
class OwnAlarms {
 public:
  // Events of so many keys; of more the quiet ones make room, and when none is quiet, it is
  // kTooManyEvents that stands for the rest.
  static constexpr std::size_t kMostEvents = 200;

  struct Entry {
    std::string source{};
    std::string code{};
    bool is_event = false;
    std::string cause{};
    std::string response{};
    Timestamp event_at{};         // of the last event
    Timestamp raised_event_at{};  // of the one that raised it
    std::string acknowledged_by{};
    std::string shelved_by{};
    std::string shelved_because{};
    AlarmBoard board;  // of this one alarm
    // Whether it holds now, for a board that is told the same again with each tick.
    std::optional<double> value{};
    AlarmState logged_state = AlarmState::kNormal;

    const Alarm& alarm() const { return board.alarm(0); }
  };

  OwnAlarms();

  void Add(const dds::Event& event, Timestamp now);
  // Of an event whose alarm its process keeps itself.
  void Forget(std::string_view source, std::string_view code);
  // Whether it holds; empty: not known. `detail` is added to its cause.
  void Set(ConsoleAlarm alarm, std::optional<bool> holds, std::string_view detail = {});
  // True when anything changed.
  bool Tick(Timestamp now);

  // Commands with addressee `hmi_bridge`: acknowledge, shelve, unshelve with "source/code" and, for
  // shelve, minutes. A sentence for the person, either way.
  Result<std::string, std::string> Obey(std::string_view verb,
                                        std::string_view argument,
                                        std::string_view by,
                                        std::string_view because,
                                        Timestamp now);

  const std::map<std::string, std::unique_ptr<Entry>>& entries() const { return entries_; }

  // What has changed its state since it was asked last, a line each, for the log.
  std::vector<std::string> TakeNews();

  // What was answered, for the disk, and back from it before anything else.
  const std::map<std::string, Answer>& answers() const { return answers_; }
  void Restore(std::map<std::string, Answer> answers) { answers_ = std::move(answers); }

 private:
  Entry& NewEntry(std::string source, std::string code, AlarmPriority urgency);
  bool HasRoom() const;
  void MakeRoom();

  std::map<std::string, std::unique_ptr<Entry>> entries_;  // by key; addresses stand
  std::map<std::string, Answer> answers_;
};

}  // namespace tbm::hmi
