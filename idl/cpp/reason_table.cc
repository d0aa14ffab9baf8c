#include "idl/cpp/reason_table.h"

#include <array>
#include <cstddef>

#include "pose/base/check.h"

namespace tbm::dds {
namespace {

// Row i is the wire's enumerator i: the order of relative_pose.idl.
constexpr std::array kReasons{
    PoseReason::kNone,
    PoseReason::kFrameMissing,
    PoseReason::kFrameUnreadable,
    PoseReason::kFrameSize,
    PoseReason::kFrameDark,
    PoseReason::kFrameSaturated,
    PoseReason::kStampNotIncreasing,
    PoseReason::kTooFewLeds,
    PoseReason::kNoMatch,
    PoseReason::kAmbiguous,
    PoseReason::kNotObservable,
    PoseReason::kBehindCamera,
    PoseReason::kNotConverged,
    PoseReason::kInconsistent,
    PoseReason::kFewLeds,
    PoseReason::kTwoLeds,
    PoseReason::kLedExcluded,
    PoseReason::kTiltMissing,
    PoseReason::kTiltStale,
    PoseReason::kTiltNotFinite,
    PoseReason::kTiltOutOfRange,
    PoseReason::kTiltDisagrees,
    PoseReason::kMountingMoved,
};
static_assert(kReasons.size() == std::size_t{v1::POSE_REASON_MOUNTING_MOVED} + 1);

}  // namespace

v1::PoseReason WireFromReason(PoseReason reason) {
  for (std::size_t i = 0; i < kReasons.size(); ++i) {
    if (kReasons[i] == reason) return static_cast<v1::PoseReason>(i);
  }
  TBM_CHECK(false);  // a reason was added to pose_reason.h and not here and in relative_pose.idl
  return v1::POSE_REASON_NONE;
}

std::optional<PoseReason> ReasonFromWire(v1::PoseReason reason) {
  const auto index = static_cast<std::size_t>(reason);
  if (index >= kReasons.size()) return std::nullopt;
  return kReasons[index];
}

std::optional<PoseReason> ReasonFromCode(std::string_view code) {
  for (const PoseReason reason : kReasons) {
    if (ReasonCode(reason) == code) return reason;
  }
  return std::nullopt;
}

}  // namespace tbm::dds
