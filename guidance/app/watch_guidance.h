#pragma once

#include <map>
#include <string>
#include <vector>

#include "guidance/app/watch_row.h"
#include "idl/cpp/guidance_messages.h"

namespace tbm {

// What the operator steers by, as rows: alarms, deviations, where the machine looks and goes, what
// it all rests on. What is not known is two dashes, never zero. Knows neither DDS nor clocks nor
// terminals.
class GuidanceBoard {
 public:
  void Add(const dds::Guidance& guidance, WatchInstant received_at);
  void Add(const dds::ShieldPose& pose, WatchInstant received_at);
  void Add(const dds::StationSetUp& set_up, WatchInstant received_at);
  void Add(const dds::AlarmStatus& alarm, WatchInstant received_at);

  bool is_empty() const;
  void Append(const WatchNow& now, std::vector<WatchRow>& rows) const;

 private:
  void AppendAlarms(const WatchNow& now, std::vector<WatchRow>& rows) const;
  void AppendSetUps(const WatchNow& now, std::vector<WatchRow>& rows) const;
  void AppendShields(const WatchNow& now, std::vector<WatchRow>& rows) const;

  std::map<std::string, WatchHeard<dds::Guidance>> guidance_;
  std::map<std::string, WatchHeard<dds::ShieldPose>> shields_;
  std::map<std::string, WatchHeard<dds::StationSetUp>> set_ups_;
  std::map<std::string, WatchHeard<dds::AlarmStatus>> alarms_;
};

namespace watch {

std::string StatusText(dds::Validity validity, std::string_view reason);  // "degraded few_prisms"

// The point that one steers by; null when the message has none of that name.
const dds::GuidedPoint* SteeredPoint(const dds::Guidance& guidance);

}  // namespace watch

}  // namespace tbm
