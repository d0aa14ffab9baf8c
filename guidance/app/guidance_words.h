#pragma once

#include <optional>
#include <string_view>

#include "guidance/core/guidance_core.h"
#include "guidance/core/input.h"
#include "guidance/core/snapshot.h"
#include "idl/cpp/guidance_messages.h"
#include "idl/cpp/messages.h"

namespace tbm {

// What stands in every message of the guidance process and never changes while it runs.
struct GuidanceNames {
  dds::MachineId machine_id;
  dds::BoundedText<64> axis_name;
  dds::BoundedText<64> axis_sha256;
  dds::BoundedText<64> machine_sha256;
  std::string_view steer_by;
};

inline constexpr std::string_view kGuidanceSource = "guidance";

// The words of the topics in those of the core. Empty for what says nothing to it: an attempt that
// failed, a reference, a prism that is not the machine's, another role's set-up.
std::optional<GuidanceInput> InputOf(const dds::StationObservation& message,
                                     const Machine& machine);
std::optional<GuidanceInput> InputOf(const dds::StationSetUp& message);
std::optional<GuidanceInput> InputOf(const dds::RelativePose& message);
std::optional<GuidanceInput> InputOf(const dds::TiltReading& message);

// And back: published_at and sample_number are left to whoever sends.
dds::ShieldPose PoseMessageOf(const Snapshot& snapshot,
                              ShieldName shield,
                              const GuidanceNames& names);
void FillGuidance(const Snapshot& snapshot,
                  const Machine& machine,
                  const GuidanceNames& names,
                  dds::Guidance* message);
dds::AlarmStatus AlarmMessageOf(const GuidanceAlarmRule& rule,
                                const Alarm& alarm,
                                const GuidanceNames& names);

}  // namespace tbm
