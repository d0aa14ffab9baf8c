#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "guidance/rail/rail_filter.h"
#include "guidance/rail/rail_recording.h"
#include "guidance/rail/rail_start.h"
#include "guidance/rail_vision/find_targets.h"
#include "guidance/rail_vision/rail_frames.h"
#include "pose/base/result.h"

namespace tbm {

// What the filter expects of an image that is exposed now: all targets, by its whole state. The
// filter's covariance has been brought forward.
ExpectedImage ExpectImage(const FusionFilter& filter,
                          const CameraModel& camera,
                          const std::vector<SurveyedTarget>& targets);

struct FrameOutcome {
  Timestamp stamped_at;
  bool is_readable = false;  // there are pixels, of the camera's size
  bool is_in_run = false;    // between the first sample of the unit and the last
  TargetsInImage targets;
};

enum class SearchFault {
  kStart,      // RailStartFailure says what
  kNoHeading,  // not given, and nothing that names itself is seen while the trolley rests
};
struct SearchFailure {
  SearchFault fault = SearchFault::kStart;
  RailStartFailure start;
};

// Finds the targets of a run's images one after the other, each where the filter expects it by all
// that came before: inertial unit, inclinometer, wheel, and the targets of the images before.
// `marks`: how each target of the recording looks; none: it is not looked for. The recording's own
// images are not looked at. `on_frame` is told how far it is. The same run gives the same bits.
Result<std::vector<FrameOutcome>, SearchFailure> SearchTargets(
    const RailSetup& setup,
    const RailRecording& recording,
    const std::vector<std::optional<TargetMark>>& marks,
    const RailFrames& frames,
    const std::function<void(const FrameOutcome&)>& on_frame);

}  // namespace tbm
