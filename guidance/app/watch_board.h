#pragma once

#include <map>
#include <string>
#include <vector>

#include "guidance/app/watch_guidance.h"
#include "guidance/app/watch_rail.h"
#include "guidance/app/watch_row.h"
#include "idl/cpp/alarm.h"
#include "idl/cpp/guidance_messages.h"
#include "idl/cpp/messages.h"

namespace tbm {

// What is known of all live topics, as rows for a screen: first what the operator steers by. Knows
// neither DDS nor clocks nor terminals. Not thread-safe.
class WatchBoard {
 public:
  using Instant = WatchInstant;

  void Add(const dds::RelativePose& pose, Instant received_at);
  void Add(const dds::TiltReading& tilt, Instant received_at);
  void Add(const dds::FrameFeatures& features, Instant received_at);
  void Add(const dds::DeviceHealth& health, Instant received_at);
  void Add(const dds::Event& event, Instant received_at);
  void Add(const dds::Alarm& alarm);
  void Add(const dds::Guidance& guidance, Instant received_at);
  void Add(const dds::ShieldPose& pose, Instant received_at);
  void Add(const dds::StationSetUp& set_up, Instant received_at);
  void Add(const dds::AlarmStatus& alarm, Instant received_at);
  void Add(const dds::TrolleyState& state, Instant received_at);
  void Add(const dds::RailLinePiece& piece, Instant received_at);
  void Add(const dds::SettlementPiece& piece, Instant received_at);
  void Add(const dds::CalibrationStatus& status, Instant received_at);

  bool is_empty() const;
  std::vector<WatchRow> Rows(const WatchNow& now) const;

 private:
  template <class Message>
  using Heard = WatchHeard<Message>;

  void AppendPoses(const WatchNow& now, std::vector<WatchRow>& rows) const;
  void AppendTilts(const WatchNow& now, std::vector<WatchRow>& rows) const;
  void AppendFeatures(const WatchNow& now, std::vector<WatchRow>& rows) const;
  void AppendHealth(const WatchNow& now, std::vector<WatchRow>& rows) const;
  void AppendEvents(const WatchNow& now, std::vector<WatchRow>& rows) const;

  // By key in words, so that the order on the screen is the same each time.
  std::map<std::string, Heard<dds::RelativePose>> poses_;
  std::map<std::string, Heard<dds::TiltReading>> tilts_;
  std::map<std::string, Heard<dds::FrameFeatures>> features_;
  std::map<std::string, Heard<dds::DeviceHealth>> health_;
  std::map<std::string, Heard<dds::Event>> events_;
  std::map<std::string, dds::Alarm> alarms_;
  GuidanceBoard guidance_;
  RailBoard rail_;
};

// The rows as text for a terminal of the given width, colours included when wanted.
std::string WatchScreen(const std::vector<WatchRow>& rows, int width_chars, bool with_colours);

// One sample as a line for a pipe: "relative_pose machine=.. stamp_ns=.. status=ok ..". One that is
// stale on arrival says status=stale and gives no numbers.
std::string WatchLine(const dds::RelativePose& pose, double age_s);
std::string WatchLine(const dds::TiltReading& tilt, double age_s);
std::string WatchLine(const dds::FrameFeatures& features, double age_s);
std::string WatchLine(const dds::DeviceHealth& health, double age_s);
std::string WatchLine(const dds::Event& event, double age_s);
std::string WatchLine(const dds::Alarm& alarm);
std::string WatchLine(const dds::Guidance& guidance, double age_s);
std::string WatchLine(const dds::ShieldPose& pose, double age_s);
std::string WatchLine(const dds::StationSetUp& set_up, double age_s);
std::string WatchLine(const dds::AlarmStatus& alarm, double age_s);
std::string WatchLine(const dds::TrolleyState& state, double age_s);
std::string WatchLine(const dds::RailLinePiece& piece, double age_s);
std::string WatchLine(const dds::SettlementPiece& piece, double age_s);
std::string WatchLine(const dds::CalibrationStatus& status, double age_s);

}  // namespace tbm
