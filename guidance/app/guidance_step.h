#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "guidance/app/guidance_words.h"
#include "guidance/axis/design_axis.h"
#include "guidance/core/guidance_core.h"
#include "pose/rig/rig.h"

namespace tbm {

// What the guidance process listens to.
using GuidanceMessage = std::variant<dds::RelativePose,
                                     dds::TiltReading,
                                     dds::StationObservation,
                                     dds::StationSetUp,
                                     dds::Command>;

// The guidance process without clock, DDS and files: messages in, messages out. The process feeds
// it from DDS, `tbm replay` from a journal, and both get the same bits.
class GuidanceStep {
 public:
  // All three outlive it.
  GuidanceStep(const Machine& machine,
               const Rig& rig,
               const DesignAxis& axis,
               const std::string& machine_sha256);

  // False for another machine's message, which is ignored.
  bool Take(const GuidanceMessage& message);

  struct Output {
    dds::ShieldPose rear;
    dds::ShieldPose front;
    dds::Guidance guidance;
    std::vector<dds::AlarmStatus> alarms;  // those that changed; all of them once a second
    std::vector<dds::Event> events;        // alarms that were raised or cleared
    std::vector<dds::CommandReply> replies;
  };
  // One step with all that was taken since the last one. Stamps of sending are left at `now`. Valid
  // until the next call.
  const Output& Step(Timestamp now);

  const Machine& machine() const { return machine_; }

 private:
  void ObeyAll(Timestamp now);
  void Obey(const dds::Command& command, Timestamp now, AlarmBoard* board);
  void Reply(const dds::Command& command,
             dds::CommandOutcome outcome,
             const std::string& text,
             Timestamp now);
  void ListAlarms(Timestamp now);

  const Machine& machine_;
  GuidanceNames names_;
  GuidanceCore core_;
  std::vector<GuidanceInput> inputs_;
  std::vector<dds::Command> commands_;
  std::array<AlarmState, kGuidanceAlarmCount> told_{};
  std::array<std::optional<Timestamp>, kGuidanceAlarmCount> told_shelf_{};
  std::array<dds::BoundedText<32>, kGuidanceAlarmCount> acknowledged_by_{};
  std::array<dds::Command, kGuidanceAlarmCount> shelved_by_{};  // of meaning while it is shelved
  std::optional<Timestamp> all_told_at_;
  std::uint64_t step_number_ = 0;
  std::uint64_t event_number_ = 0;
  Output output_;
};

}  // namespace tbm
