#pragma once

#include <array>
#include <string_view>

#include "guidance/core/alarm_board.h"
#include "guidance/core/machine.h"
#include "guidance/core/snapshot.h"

namespace tbm {

// The alarms of the guidance, in the order of the board. Append only.
enum class GuidanceAlarm : std::size_t {
  kDeviationHigh,
  kPredictedDeviationHigh,
  kRollHigh,
  kSigmaHigh,
  kPositionLost,
  kStationLate,
  kCameraLate,
  kTiltLate,
  kSetUpNotGood,
  kPrismsDisagree,
  kPrismsExchanged,
  kAxisEnds,
  kMountingMoved,
};
inline constexpr std::size_t kGuidanceAlarmCount = 13;

// A rule, and in which unit and scale its numbers are shown to people.
struct GuidanceAlarmRule {
  AlarmRule rule;  // SI
  std::string_view unit;
  double shown_per_si = 1.0;
};

// One for each GuidanceAlarm, with the machine's limits.
std::array<GuidanceAlarmRule, kGuidanceAlarmCount> GuidanceAlarmRules(const Machine& machine);

// Tells the board what the snapshot says. `axis_end_m`: chainage at which the design ends. A number
// that is not there neither raises nor clears anything.
void UpdateAlarms(const Snapshot& snapshot,
                  const Machine& machine,
                  double axis_end_m,
                  AlarmBoard& board);

}  // namespace tbm
