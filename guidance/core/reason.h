#pragma once

#include <string_view>

namespace tbm {

// Why a number of the guidance is not valid, or not fully. Append only: the codes go out on DDS and
// into journals; idl/README.md lists them with what they mean.
enum class GuidanceReason {
  kNone,
  kNoSetUp,            // the total station has no set-up
  kNoFix,              // the rear shield's prisms were not seen yet
  kTooFewPrisms,       // not enough of them, and tilt, to say how the rear shield is turned
  kPrismsDisagree,     // they contradict each other, or the drawing
  kNotObservable,      // they leave a direction without a usable sigma
  kStationCoasting,    // the prisms have not been seen for a while
  kStationStale,       // for too long
  kSetUpSuspect,       // the station may have moved; what was seen since is not used
  kPrismLeftOut,       // one prism disagrees with all others
  kPrismsExchanged,    // two were taken for each other and put right
  kNoRelativePose,     // the camera box has never given a pose
  kCameraCoasting,     // no pose of the front shield for a while
  kCameraStale,        // for too long
  kCameraDegraded,     // the camera box calls its pose degraded
  kSigmaTooLarge,      // beyond what is of use
  kBeforeStart,        // of the design axis
  kBeyondEnd,          // of the design axis
  kTooFarFromAxis,     // no foot within reach
  kAmbiguousChainage,  // two places of the axis are equally near
  kFewPrisms,          // so few that nothing checks them; the heading may be that of an earlier fix
};
inline constexpr int kGuidanceReasonCount = static_cast<int>(GuidanceReason::kFewPrisms) + 1;

// "station_coasting"; empty for kNone.
std::string_view ReasonCode(GuidanceReason reason);

}  // namespace tbm
