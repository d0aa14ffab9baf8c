#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "guidance/config/guidance_file.h"
#include "hmi_bridge/core/console_board.h"
#include "tests/support/temp_folder.h"

// A board with the example's machine, what it hears and what it shows, for its tests.
namespace tbm::hmi {

inline constexpr std::int64_t kMs = 1'000'000;  // [ns]

inline const GuidedMachine& Example() {
  static const GuidedMachine machine = [] {
    const test::TempFolder folder;
    for (const char* file : {"guidance/app/example/machine.yaml",
                             "guidance/app/example/axis.xml",
                             "pose/app/example/rig.yaml"}) {
      const std::filesystem::path from = std::string(TBM_SOURCE_DIR "/") + file;
      std::filesystem::copy_file(from, folder / from.filename().string());
    }
    MachineFaults warnings;
    auto loaded = LoadGuidedMachine(folder / "machine.yaml", &warnings);
    return std::move(loaded).value();
  }();
  return machine;
}

// A board of the example's machine, and its clock.
struct Console {
  Moment now{{1'800'000'000'000 * kMs}, 5'000'000};
  ConsoleBoard board{ConsoleMachineOf(Example().machine,
                                      Example().rig,
                                      Example().axis,
                                      Example().machine_sha256,
                                      {{"camera", {0}, {1'800'000'100'000 * kMs}}}),
                     {"1.2.3", "build-7", 25, now.utc},
                     now};

  void Wait(std::int64_t ms) {
    now.utc = now.utc + std::chrono::milliseconds(ms);
    now.steady_ms += ms;
    board.Tick(now);
  }
  template <class Message>
  void Hear(Message message) {
    message.machine_id = "TBM-1";
    board.Add(message, {now.steady_ms, false}, now);
  }
  Json Part(std::string_view name) {
    for (const Section& section : board.Sections()) {
      if (section.name == name) return Json::parse(*section.json);
    }
    ADD_FAILURE() << "no section " << name;
    return nullptr;
  }
  std::vector<std::string> Alarms() {
    std::vector<std::string> keys;
    const Json alarms = Part("alarms");
    for (const Json& alarm : alarms["list"]) {
      keys.push_back(alarm["source"].get<std::string>() + "/" + alarm["code"].get<std::string>() +
                     " " + alarm["phase"].get<std::string>());
    }
    return keys;
  }
  Json AlarmOf(const std::string& code) {
    const Json alarms = Part("alarms");
    for (const Json& alarm : alarms["list"]) {
      if (alarm["code"] == code) return alarm;
    }
    return nullptr;
  }
  Result<std::string, std::string> Ask(const char* verb,
                                       const char* argument,
                                       const char* because = "") {
    dds::Command command;
    command.addressee = kOwnAddressee;
    command.verb = verb;
    command.argument = argument;
    command.by = "ann";
    command.because = because;
    return board.Obey(command, now);
  }
};

inline dds::Guidance GuidanceAt(Timestamp valid_at, double chainage_m = 100.0) {
  dds::Guidance guidance;
  guidance.valid_at = valid_at;
  guidance.validity = dds::Validity::kValid;
  guidance.steer_by = "cutter_face";
  guidance.machine_sha256 = std::string_view(Example().machine_sha256);
  guidance.axis_sha256 = std::string_view(Example().axis.file_sha256());
  dds::GuidedPoint point;
  point.name = "cutter_face";
  point.shield = "front";
  point.validity = dds::Validity::kValid;
  point.deviation_right_m = 0.0123456;
  point.deviation_up_m = -0.00000001;
  point.chainage_m = chainage_m;
  guidance.points.push_back(point);
  return guidance;
}

inline dds::AlarmStatus AlarmNow(const char* code,
                                 dds::AlarmPhase phase,
                                 dds::AlarmUrgency urgency) {
  dds::AlarmStatus alarm;
  alarm.source = "guidance";
  alarm.code = code;
  alarm.phase = phase;
  alarm.urgency = urgency;
  return alarm;
}

inline dds::Event EventNow(const char* code, bool active, Timestamp at) {
  dds::Event event;
  event.source = "camera_box";
  event.code = code;
  event.severity = dds::Severity::kAlarm;
  event.active = active;
  event.at = at;
  event.text = "the lens is covered";
  return event;
}

}  // namespace tbm::hmi
