#pragma once

#include <string_view>

namespace tbm {

// How far a pose may be trusted.
enum class PoseStatus {
  kOk,        // everything expected was used and agrees
  kDegraded,  // a pose with honest sigma and bound, but something is missing; see the reason
  kNone,      // no pose; see the reason
};

// Why a frame gave no pose, or only a degraded one. Append only: the codes stand in recordings,
// on DDS and in the console's texts. The first reason that applies in the order of processing wins.
enum class PoseReason {
  kNone = 0,  // status ok

  // No image that can be used. Status none.
  kFrameMissing = 1,        // the file or the frame never came
  kFrameUnreadable = 2,     // cut or damaged
  kFrameSize = 3,           // not the size that the rig's calibration is for
  kFrameDark = 4,           // no light anywhere: lamp, shutter, cable
  kFrameSaturated = 5,      // nearly all of the image at full scale
  kStampNotIncreasing = 6,  // same or older time than the frame before, by up to kClockSetBack

  // Not enough to solve. Status none.
  kTooFewLeds = 10,     // fewer than two LED-like spots in the image
  kNoMatch = 11,        // spots, but no set of them can be the target
  kAmbiguous = 12,      // two assignments fit about equally well
  kNotObservable = 13,  // the geometry leaves some direction without a usable sigma
  kBehindCamera = 14,   // the only solution puts an LED behind the lens
  kNotConverged = 15,   // the solver did not settle
  kInconsistent = 16,   // residuals fail the gate and leaving any one reading out does not mend it

  // A pose, but less than expected. Status degraded (or none where no pose is possible without).
  kFewLeds = 20,         // fewer LEDs than the target has were used, three or more
  kTwoLeds = 21,         // only two: nothing checks them
  kLedExcluded = 22,     // one centre disagreed with all the rest and was left out
  kTiltMissing = 23,     // no reading of one or both inclinometers
  kTiltStale = 24,       // the nearest reading is too old for this frame
  kTiltNotFinite = 25,   // an inclinometer sent NaN
  kTiltOutOfRange = 26,  // an angle no plate can have
  kTiltDisagrees = 27,   // the tilts contradict the image and were left out
  kMountingMoved = 28,   // the monitor says an inclinometer's mounting has moved
};

// The code as it stands in CSV, DDS and logs: "frame_missing". Empty for kNone.
std::string_view ReasonCode(PoseReason reason);

// "ok", "degraded", "none".
std::string_view StatusCode(PoseStatus status);

}  // namespace tbm
