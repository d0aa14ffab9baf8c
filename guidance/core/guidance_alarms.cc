#include "guidance/core/guidance_alarms.h"

#include <cmath>
#include <numbers>
#include <optional>

namespace tbm {
namespace {

using std::chrono::seconds;

constexpr int kLookAhead_m = 10;
constexpr double kAxisWarning_m = 50.0;
constexpr double kDegPerRad = 180.0 / std::numbers::pi;

AlarmRule Limit(std::string_view code,
                AlarmPriority priority,
                const AlarmLimit& limit,
                std::string_view cause,
                std::string_view response) {
  return {code,
          priority,
          cause,
          response,
          limit.raise_above,
          limit.clear_below,
          seconds(2),
          seconds(2)};
}
AlarmRule Condition(std::string_view code,
                    AlarmPriority priority,
                    Duration raise_after,
                    std::string_view cause,
                    std::string_view response) {
  return {code, priority, cause, response, 0.5, 0.5, raise_after, seconds(2)};
}

double Is(bool holds) { return holds ? 1.0 : 0.0; }
bool IsLate(const SourceState& source) { return source.freshness != Freshness::kFresh; }

std::optional<double> Off(double right_m, std::optional<double> up_m) {
  return std::hypot(right_m, up_m.value_or(0.0));
}

}  // namespace

std::array<GuidanceAlarmRule, kGuidanceAlarmCount> GuidanceAlarmRules(const Machine& machine) {
  using enum AlarmPriority;
  return {{
      {Limit("deviation_high",
             kHigh,
             machine.deviation_m,
             "the machine is further from the design axis than allowed",
             "steer back in small steps; tell the shift engineer"),
       "mm",
       1e3},
      {Limit("predicted_deviation_high",
             kMedium,
             machine.predicted_deviation_m,
             "in 10 m the machine will be too far from the design axis",
             "change the jacks' pressures now: the deviation still grows for some metres"),
       "mm",
       1e3},
      {Limit("roll_high",
             kMedium,
             machine.roll_rad,
             "the front shield has rolled",
             "reverse the cutter head's turning direction"),
       "deg",
       kDegPerRad},
      {Limit("sigma_high",
             kMedium,
             machine.sigma_m,
             "the position is less certain than it should be",
             "look at the sources: which is old or degraded? clean the window, free the sight"),
       "mm",
       1e3},
      {Condition("position_lost",
                 kHigh,
                 seconds(2),
                 "there is no valid position of the front shield",
                 "do not steer by it; bring back the source that is named, or stop"),
       "",
       1.0},
      {Condition("station_late",
                 kMedium,
                 seconds(10),
                 "the total station has not fixed the rear shield in time",
                 "is the sight to the prisms free? look at the station's alarms"),
       "",
       1.0},
      {Condition("camera_late",
                 kMedium,
                 seconds(3),
                 "the camera box gives no pose of the front shield",
                 "clean window and LEDs; look at camera and LEDs on the camera page"),
       "",
       1.0},
      {Condition("tilt_late",
                 kLow,
                 seconds(5),
                 "an inclinometer is silent",
                 "check its cable and supply"),
       "",
       1.0},
      {Condition("set_up_not_good",
                 kHigh,
                 seconds(1),
                 "the total station's place is not known, or may have changed",
                 "have the references checked; set the station up again if they disagree"),
       "",
       1.0},
      {Condition("prisms_disagree",
                 kMedium,
                 seconds(1),
                 "a prism of the rear shield is not where the drawing says, or they contradict",
                 "look for a prism that is loose, dirty or replaced; measure the machine again"),
       "",
       1.0},
      {Condition("prisms_exchanged",
                 kLow,
                 seconds(1),
                 "two prisms of the rear shield were taken for each other",
                 "none at once: it was put right; check the prisms' names"),
       "",
       1.0},
      {Limit("axis_ends",
             kMedium,
             {-kAxisWarning_m, -kAxisWarning_m - 1.0},
             "the design axis ends in front of the machine",
             "load the axis of the next section"),
       "m",
       1.0},
      {Condition("mounting_moved",
                 kMedium,
                 seconds(5),
                 "an inclinometer's mounting on a shield has moved",
                 "have the mounting calibrated again"),
       "",
       1.0},
  }};
}

void UpdateAlarms(const Snapshot& snapshot,
                  const Machine& machine,
                  double axis_end_m,
                  AlarmBoard& board) {
  const auto tell = [&](GuidanceAlarm alarm, std::optional<double> value) {
    board.Update(static_cast<std::size_t>(alarm), value, snapshot.at);
  };
  const PointState& steer_by = snapshot.points[machine.steer_by];
  const bool has_place = steer_by.worth != Worth::kInvalid;
  std::optional<double> off;
  std::optional<double> sigma;
  std::optional<double> to_end;
  if (has_place) {
    const Deviation& deviation = steer_by.deviation;
    off = Off(deviation.right_m, deviation.up_m);
    sigma = std::max(deviation.right_sigma_m, deviation.up_sigma_m);
    to_end = deviation.chainage.m - axis_end_m;
  }
  tell(GuidanceAlarm::kDeviationHigh, off);
  tell(GuidanceAlarm::kSigmaHigh, sigma);
  tell(GuidanceAlarm::kAxisEnds, to_end);
  std::optional<double> off_ahead;
  if (has_place && snapshot.ahead.size() >= kLookAhead_m) {
    const AheadState& ahead = snapshot.ahead[kLookAhead_m - 1];
    std::optional<double> up;
    if (ahead.up) up = ahead.up->off_m;
    off_ahead = Off(ahead.right.off_m, up);
  }
  tell(GuidanceAlarm::kPredictedDeviationHigh, off_ahead);
  std::optional<double> roll;
  if (snapshot.front.worth != Worth::kInvalid) roll = std::abs(snapshot.front.attitude.roll_rad);
  tell(GuidanceAlarm::kRollHigh, roll);
  tell(GuidanceAlarm::kPositionLost, Is(!has_place));
  tell(GuidanceAlarm::kStationLate, Is(IsLate(snapshot.station)));
  tell(GuidanceAlarm::kCameraLate, Is(IsLate(snapshot.camera)));
  tell(GuidanceAlarm::kTiltLate, Is(IsLate(snapshot.target_tilt) || IsLate(snapshot.camera_tilt)));
  tell(GuidanceAlarm::kSetUpNotGood,
       Is(snapshot.set_up_number == 0 || snapshot.fix_trouble == GuidanceReason::kSetUpSuspect));
  // While nothing new is measured nothing is known of the prisms.
  std::optional<double> disagree;
  std::optional<double> exchanged;
  if (snapshot.fix && snapshot.station.freshness == Freshness::kFresh) {
    disagree = Is(snapshot.fix->left_out.has_value());
    exchanged = Is(snapshot.fix->exchanged.has_value());
  }
  if (snapshot.fix_trouble == GuidanceReason::kPrismsDisagree) disagree = 1.0;
  tell(GuidanceAlarm::kPrismsDisagree, disagree);
  tell(GuidanceAlarm::kPrismsExchanged, exchanged);
  std::optional<double> moved;
  if (snapshot.camera.freshness == Freshness::kFresh) {
    moved = Is(snapshot.camera_trouble == PoseReason::kMountingMoved);
  }
  tell(GuidanceAlarm::kMountingMoved, moved);
}

}  // namespace tbm
