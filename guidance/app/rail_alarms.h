#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "guidance/core/alarm_board.h"
#include "idl/cpp/guidance_messages.h"
#include "idl/cpp/messages.h"

namespace tbm {

enum class RailAlarm {
  kImuSilent,
  kStartFailed,
  kComesTooLate,
  kRunNotWritten,
  kLineNotWritten,
  kSettlementFound,
  kCalibrationDue,
  kClockSet,
  kDatumShift,
  kTargetsSilent,
  kInclinometerSilent,
  kMeasurementsLost,
};
inline constexpr std::size_t kRailAlarmCount = 12;

// The alarms of the process rail_line, and what people ask of them. One thread.
class RailAlarms {
 public:
  explicit RailAlarms(std::string_view machine_id);

  // Nothing known: the alarm stays as it is. `what`: said of it when it is raised.
  void Watch(RailAlarm alarm, std::optional<double> value, Timestamp now, std::string what = "");

  // A verb of IsAlarmVerb.
  Result<std::string, std::string> Obey(const dds::Command& command, Timestamp now);

  // Those that changed, or all of them, and an event for each that was raised or cleared.
  struct News {
    std::vector<dds::AlarmStatus> alarms;
    std::vector<dds::Event> events;
  };
  News Take(bool all, Timestamp now);

 private:
  const dds::MachineId machine_id_;
  AlarmBoard board_;
  std::array<std::string, kRailAlarmCount> what_;
  std::array<Alarm, kRailAlarmCount> told_{};
  std::array<dds::BoundedText<32>, kRailAlarmCount> acknowledged_by_{};
  std::array<dds::Command, kRailAlarmCount> shelved_by_{};  // of meaning while it is shelved
};

}  // namespace tbm
