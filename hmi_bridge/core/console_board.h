#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "guidance/axis/design_axis.h"
#include "guidance/core/machine.h"
#include "hmi_bridge/core/calibration.h"
#include "hmi_bridge/core/commands.h"
#include "hmi_bridge/core/heard.h"
#include "hmi_bridge/core/history.h"
#include "hmi_bridge/core/own_alarms.h"
#include "hmi_bridge/core/view_json.h"
#include "hmi_bridge/server/console_source.h"
#include "idl/cpp/alarm.h"
#include "idl/cpp/guidance_messages.h"
#include "idl/cpp/messages.h"
#include "pose/rig/rig.h"

namespace tbm::hmi {

// What the console needs to know of the machine beside what is said on the topics.
struct ConsoleMachine {
  Machine machine;
  Rig rig;
  std::string machine_sha256;
  std::string axis_sha256;
  std::vector<Calibration> calibrations;
  Json view;  // section `machine`
};
ConsoleMachine ConsoleMachineOf(const Machine& machine,
                                const Rig& rig,
                                const DesignAxis& axis,
                                std::string machine_sha256,
                                std::vector<Calibration> calibrations);

// What never changes while the bridge runs.
struct BridgeFacts {
  std::string version;
  std::string page_build;
  int dds_domain = 0;
  Timestamp started_at;
};

// All that is known of the machine, as the sections of openapi.yaml. Computes no guidance: it turns
// messages into what people read, remembers them, and says what is missing. Text is made when it is
// asked for and not before. Knows no clock, DDS or thread; one caller at a time.
//
// Messages of another machine are counted and not shown.
class ConsoleBoard {
 public:
  ConsoleBoard(ConsoleMachine machine, BridgeFacts facts, const Moment& now);

  void Add(const dds::Guidance& message, const Arrival& arrival, const Moment& now);
  void Add(const dds::ShieldPose& message, const Arrival& arrival, const Moment& now);
  void Add(const dds::RelativePose& message, const Arrival& arrival, const Moment& now);
  void Add(const dds::FrameFeatures& message, const Arrival& arrival, const Moment& now);
  void Add(const dds::TiltReading& message, const Arrival& arrival, const Moment& now);
  void Add(const dds::StationSetUp& message, const Arrival& arrival, const Moment& now);
  void Add(const dds::StationObservation& message, const Arrival& arrival, const Moment& now);
  void Add(const dds::DeviceHealth& message, const Arrival& arrival, const Moment& now);
  void Add(const dds::AlarmStatus& message, const Arrival& arrival, const Moment& now);
  void Add(const dds::Event& message, const Arrival& arrival, const Moment& now);
  void Add(const dds::CommandReply& message, const Arrival& arrival, const Moment& now);
  void Add(const dds::TrolleyState& message, const Arrival& arrival, const Moment& now);
  void Add(const dds::SettlementPiece& message, const Arrival& arrival, const Moment& now);
  void Add(const dds::Alarm& alarm, const Moment& now);
  void SetNetwork(bool is_running, const Moment& now);

  // What time alone changes: silence, shelves, unanswered commands. A few times a second.
  void Tick(const Moment& now);

  // A command that is about to be sent: its answer may come before the sender knows that it is out.
  void Send(const dds::Command& command, const Moment& now);
  // It could not be sent.
  void Withdraw(const dds::Command& command);
  // One that is for the bridge itself.
  Result<std::string, std::string> Obey(const dds::Command& command, const Moment& now);

  // Whether any section has changed since `version` of all of them together.
  std::uint64_t version() const { return version_; }
  std::vector<Section> Sections();

  const History& history() const { return history_; }
  const OwnAlarms& own_alarms() const { return own_alarms_; }
  OwnAlarms& own_alarms() { return own_alarms_; }
  std::string Metrics(const Moment& now) const;

 private:
  enum Part : std::size_t {
    kBridge,
    kMachine,
    kGuidance,
    kShields,
    kCamera,
    kTilts,
    kStation,
    kDevices,
    kAlarms,
    kEvents,
    kCommands,
    kTrolley,
    kParts
  };
  struct PartText {
    std::uint64_t version = 0;
    bool is_old = true;
    std::shared_ptr<const std::string> json;
  };
  // An alarm of a process as it was last told.
  struct ToldAlarm {
    dds::AlarmStatus status;
    Arrival arrival;
    Timestamp heard_at;
  };

  template <class Message>
  bool IsOurs(const Message& message);
  void Touch(Part part);
  Json ViewOfPart(Part part) const;
  Json BridgeView() const;
  Json CameraView() const;
  Json StationView() const;
  Json AlarmsView() const;
  Json TrolleyView() const;
  void WatchSilence(const Moment& now);
  void WatchCalibrations(const Moment& now);

  ConsoleMachine machine_;
  BridgeFacts facts_;
  Moment begun_;
  Moment last_tick_;
  bool network_runs_ = false;
  Timestamp network_since_;

  std::optional<Heard<dds::Guidance>> guidance_;
  std::map<std::string, Heard<dds::ShieldPose>> shields_;
  std::optional<Heard<dds::RelativePose>> pose_;
  std::optional<Heard<dds::FrameFeatures>> frame_;
  std::map<std::string, Heard<dds::TiltReading>> tilts_;
  std::map<std::string, Heard<dds::StationSetUp>> set_ups_;
  std::map<std::string, dds::StationObservation> observations_;
  std::map<std::string, Heard<dds::DeviceHealth>> devices_;
  std::map<std::string, ToldAlarm> alarms_;
  std::deque<dds::Event> events_;  // newest first
  std::optional<Heard<dds::TrolleyState>> trolley_;
  std::optional<dds::SettlementPiece> settlement_;  // the newest piece: all tell the whole's alert
  OwnAlarms own_alarms_;
  CommandLog commands_;
  History history_;

  std::array<PartText, kParts> texts_;
  std::uint64_t version_ = 0;
  std::uint64_t of_other_machines_ = 0;
};

}  // namespace tbm::hmi
