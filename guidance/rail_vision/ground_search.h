#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "guidance/rail/rail_line.h"
#include "guidance/rail/rail_recording.h"
#include "guidance/rail_vision/ground_motion.h"
#include "guidance/rail_vision/rail_frames.h"

namespace tbm {

// What two images after each other tell.
struct GroundStep {
  Timestamp from;
  Timestamp to;
  std::optional<GroundDisplacement> displacement;
  std::optional<GroundFailure>
      why_not;  // absent also where an image, or the line, is missing there
};

// How the ground went by from image to image, with the attitudes of `line`: a line that was made
// without these images, of the same samples. `on_step` is told how far it is. The same run gives
// the same bits.
std::vector<GroundStep> SearchGround(const RailSetup& setup,
                                     const RailLine& line,
                                     const RailFrames& frames,
                                     const std::function<void(const GroundStep&)>& on_step);

}  // namespace tbm
