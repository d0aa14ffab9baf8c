#include "guidance/core/reason.h"

namespace tbm {

std::string_view ReasonCode(GuidanceReason reason) {
  switch (reason) {
    case GuidanceReason::kNone:
      return "";
    case GuidanceReason::kNoSetUp:
      return "no_set_up";
    case GuidanceReason::kNoFix:
      return "no_fix";
    case GuidanceReason::kTooFewPrisms:
      return "too_few_prisms";
    case GuidanceReason::kPrismsDisagree:
      return "prisms_disagree";
    case GuidanceReason::kNotObservable:
      return "not_observable";
    case GuidanceReason::kStationCoasting:
      return "station_coasting";
    case GuidanceReason::kStationStale:
      return "station_stale";
    case GuidanceReason::kSetUpSuspect:
      return "set_up_suspect";
    case GuidanceReason::kPrismLeftOut:
      return "prism_left_out";
    case GuidanceReason::kPrismsExchanged:
      return "prisms_exchanged";
    case GuidanceReason::kNoRelativePose:
      return "no_relative_pose";
    case GuidanceReason::kCameraCoasting:
      return "camera_coasting";
    case GuidanceReason::kCameraStale:
      return "camera_stale";
    case GuidanceReason::kCameraDegraded:
      return "camera_degraded";
    case GuidanceReason::kSigmaTooLarge:
      return "sigma_too_large";
    case GuidanceReason::kBeforeStart:
      return "before_start";
    case GuidanceReason::kBeyondEnd:
      return "beyond_end";
    case GuidanceReason::kTooFarFromAxis:
      return "too_far_from_axis";
    case GuidanceReason::kAmbiguousChainage:
      return "ambiguous_chainage";
    case GuidanceReason::kFewPrisms:
      return "few_prisms";
  }
  return "";
}

}  // namespace tbm
