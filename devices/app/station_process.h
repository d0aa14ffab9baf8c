#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <mutex>
#include <stop_token>
#include <string>
#include <vector>

#include "devices/app/station_messages.h"
#include "devices/app/station_pointer.h"
#include "devices/bus/sleeper.h"
#include "idl/cpp/alarm.h"
#include "pose/base/clock.h"

namespace tbm {

// The total station's process without DDS: measures what its keeper asks for, publishes what the
// keeper says of it, keeps the set-up on disk, and does what it is commanded.
//
// Threads: one that works with the instrument (Step), and one that beats (Beat), so that health,
// alarms and set-up go out once a second also while a search takes half a minute.
class StationProcess {
 public:
  // All references outlive it.
  StationProcess(const StationConfig& config,
                 const Machine& machine,
                 TotalStation& instrument,
                 const Clock& clock,
                 Sleeper& sleeper,
                 StationSink& sink);

  // From any thread.
  void Hear(const dds::Command& command);
  void Hear(const dds::ShieldPose& pose);
  void Report(const dds::Alarm& alarm);  // of the DDS side: goes out as an event

  // The working thread: what was heard, then one pointing or a short wait. Returns soon after
  // `is_ending` says so.
  void Step(const std::function<bool()>& is_ending = [] { return false; });
  // The beating thread, about ten times a second.
  void Beat();
  // Both, until `stop` is asked for. `on_alive` (may be empty) is called by the beating thread as
  // long as the working one does not hang.
  void Run(const std::stop_token& stop, const std::function<void()>& on_alive = {});

  // The working thread's.
  const StationKeeper& keeper() const { return keeper_; }

 private:
  struct Pending {
    dds::Command command;
    std::vector<KeeperNews::Kind> done;
    std::vector<KeeperNews::Kind> failed;
  };

  void Restore();
  bool TakeInbox();
  void Obey(const dds::Command& command);
  void ObeyVerb(const dds::Command& command, const std::string& verb);
  void ObeyAlarmVerb(const dds::Command& command);
  void TakeOver(const dds::Command& command,
                Result<KeptStation, std::string> changed,
                bool is_move);
  // "E,N,U,DEG" or "E,N,U,REFERENCE", where the telescope is aimed at that reference.
  Result<Station, std::string> RoughStation(std::string_view argument);
  void Begun(const dds::Command& command,
             const StationKeeper::Asked& asked,
             std::vector<KeeperNews::Kind> done,
             std::vector<KeeperNews::Kind> failed);
  void Reply(const dds::Command& command, dds::CommandOutcome outcome, std::string_view text);

  bool StayConnected();
  void MeetInstrument(const StationIdentity& identity);
  void ApplySettings();
  void Idle();
  void Measure(const Pointing& pointing, const std::function<bool()>& is_ending);
  void Tell(const Judged& judged, const StationPointer::Outcome& outcome);
  void AfterWork();
  void Save();
  void TellNews();

  // With mutex_ held.
  void Conclude();
  void SendAlarms(bool all);
  void SendSetUps(bool all);
  void Raise(std::string_view code, dds::Severity severity, bool active, std::string_view text);

  const StationConfig config_;
  const StationNames names_;
  TotalStation& instrument_;
  const Clock& clock_;
  Sleeper& sleeper_;
  StationSink& sink_;

  // The working thread's.
  StationKeeper keeper_;
  std::uint64_t saved_revision_ = 0;
  bool was_told_unsaved_ = false;
  std::vector<Pending> pending_;
  std::vector<std::string> answered_;  // the last requests, so that none is carried out twice
  std::optional<std::int64_t> serial_number_;
  bool is_constant_set_ = false;
  bool is_air_set_ = false;
  std::chrono::steady_clock::time_point answered_at_;
  std::chrono::steady_clock::time_point power_read_at_{};
  std::atomic<std::chrono::steady_clock::rep> step_at_{0};  // for the watchdog

  std::mutex inbox_mutex_;  // guards the two below
  std::vector<dds::Command> commands_;
  std::optional<dds::ShieldPose> pose_;

  std::mutex mutex_;  // guards all below, and the sink
  AlarmBoard board_;
  std::array<std::optional<double>, kStationAlarmCount> watched_;
  std::array<std::string, kStationAlarmCount> details_;
  std::array<AlarmState, kStationAlarmCount> told_{};
  std::array<std::optional<Timestamp>, kStationAlarmCount> told_shelf_{};
  std::array<dds::BoundedText<32>, kStationAlarmCount> acknowledged_by_;
  std::array<dds::Command, kStationAlarmCount> shelved_by_;  // of meaning while it is shelved
  std::map<std::string, dds::StationSetUp> set_ups_;         // by role, as last concluded
  std::map<std::string, dds::StationSetUp> told_set_ups_;
  dds::DeviceHealth health_;
  std::uint64_t observations_ = 0;
  std::uint64_t observations_good_ = 0;
  std::uint64_t observations_lost_ = 0;
  std::uint64_t events_ = 0;
  std::chrono::steady_clock::time_point beaten_at_{};
};

}  // namespace tbm
