#include "pose/base/pose_reason.h"

#include "pose/base/check.h"

namespace tbm {

std::string_view ReasonCode(PoseReason reason) {
  switch (reason) {
    case PoseReason::kNone:
      return "";
    case PoseReason::kFrameMissing:
      return "frame_missing";
    case PoseReason::kFrameUnreadable:
      return "frame_unreadable";
    case PoseReason::kFrameSize:
      return "frame_size";
    case PoseReason::kFrameDark:
      return "frame_dark";
    case PoseReason::kFrameSaturated:
      return "frame_saturated";
    case PoseReason::kStampNotIncreasing:
      return "stamp_not_increasing";
    case PoseReason::kTooFewLeds:
      return "too_few_leds";
    case PoseReason::kNoMatch:
      return "no_match";
    case PoseReason::kAmbiguous:
      return "ambiguous";
    case PoseReason::kNotObservable:
      return "not_observable";
    case PoseReason::kBehindCamera:
      return "behind_camera";
    case PoseReason::kNotConverged:
      return "not_converged";
    case PoseReason::kInconsistent:
      return "inconsistent";
    case PoseReason::kFewLeds:
      return "few_leds";
    case PoseReason::kTwoLeds:
      return "two_leds";
    case PoseReason::kLedExcluded:
      return "led_excluded";
    case PoseReason::kTiltMissing:
      return "tilt_missing";
    case PoseReason::kTiltStale:
      return "tilt_stale";
    case PoseReason::kTiltNotFinite:
      return "tilt_not_finite";
    case PoseReason::kTiltOutOfRange:
      return "tilt_out_of_range";
    case PoseReason::kTiltDisagrees:
      return "tilt_disagrees";
    case PoseReason::kMountingMoved:
      return "mounting_moved";
  }
  TBM_CHECK(false);
  return "";
}

std::string_view StatusCode(PoseStatus status) {
  switch (status) {
    case PoseStatus::kOk:
      return "ok";
    case PoseStatus::kDegraded:
      return "degraded";
    case PoseStatus::kNone:
      return "none";
  }
  TBM_CHECK(false);
  return "";
}

}  // namespace tbm
