#pragma once

#include <vector>

#include "pose/base/time.h"
#include "pose/centres/assign_leds.h"
#include "tests/support/render.h"
#include "tests/support/scene.h"

namespace tbm::test {

// Frames of which the cost is counted, and all that comes with them.
struct CostFrame {
  RenderedImage image;
  Timestamp sensed_at;
  TiltObservation target_tilt;
  TiltObservation camera_tilt;
  PosePrior prior;  // the pose of 0.2 s before
};

// 1280 x 1024, lens with distortion, five LEDs, everything a field calibration leaves uncertain.
Rig CostRig();

// Noise of 1..1.5 DN, five LEDs of 2.3 px and 120..220 DN, a pipe four DN brighter than the wall,
// forty hot pixels.
std::vector<CostFrame> DarkFrames(const Rig& rig, int count);

// The same in front of a work lamp (a disc of full scale 120 px across, its light falling off over
// some tens of pixels) and among 300 false spots of 25..200 DN anywhere in the image: 240 glints of
// wet steel (0.3..0.6 px), 40 streaks, 20 round ones like LEDs (1..3 px).
std::vector<CostFrame> GlareFrames(const Rig& rig, int count);

// The dark frame among 300 round spots of 1..4 px: more than a frame ever has.
std::vector<CostFrame> CrowdFrames(const Rig& rig, int count);

}  // namespace tbm::test
