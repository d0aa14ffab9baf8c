#pragma once

#include <array>
#include <string>
#include <string_view>

#include "devices/app/station_config.h"
#include "devices/total_station/total_station.h"
#include "guidance/core/alarm_board.h"
#include "guidance/station/station_keeper.h"
#include "idl/cpp/guidance_messages.h"

namespace tbm {

inline constexpr std::string_view kStationSource = "total_station";

// Where the process' messages go: DDS in the process, a list in tests. One call at a time; must not
// block.
class StationSink {
 public:
  virtual ~StationSink() = default;
  virtual void Publish(const dds::StationObservation& message) = 0;
  virtual void Publish(const dds::StationSetUp& message) = 0;
  virtual void Publish(const dds::DeviceHealth& message) = 0;
  virtual void Publish(const dds::Event& message) = 0;
  virtual void Publish(const dds::AlarmStatus& message) = 0;
  virtual void Publish(const dds::CommandReply& message) = 0;
};

enum class StationAlarm {
  kStationMoved,
  kSetUpMissing,
  kSetUpSuspect,
  kReferenceDisagrees,
  kStationSilent,
  kPrismNotFound,
  kWrongPrism,
  kSwappedPrism,
  kStationTilted,
  kLowPower,
};
inline constexpr std::size_t kStationAlarmCount = 10;
// In the order of the enumeration; texts have static life.
std::array<AlarmRule, kStationAlarmCount> StationAlarmRules(const StationConfig& config);

// Who speaks: the two keys of all messages.
struct StationNames {
  std::string machine_id;
  std::string station;
};

// published_at and sample_number are left to the sender.
dds::StationObservation ObservationOf(const StationNames& names,
                                      const KeeperOptions& options,
                                      const Judged& judged,
                                      const Pointed& pointed,
                                      const std::optional<PolarObservation>& measured);
dds::StationSetUp InUseOf(const StationNames& names, const StationKeeper& keeper);
dds::StationSetUp ProposedOf(const StationNames& names, const StationKeeper& keeper);
dds::StationSetUp PreviousOf(const StationNames& names, const StationKeeper& keeper);
dds::DeviceHealth HealthOf(const StationNames& names, const StationHealth& health);
// `detail` goes behind the rule's cause: which prism, which reference.
dds::AlarmStatus AlarmOf(const StationNames& names,
                         const AlarmRule& rule,
                         const Alarm& alarm,
                         std::string_view detail);

}  // namespace tbm
