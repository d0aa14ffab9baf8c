#pragma once

#include <optional>
#include <string_view>

#include "tbm_idl/relative_pose.h"

#include "pose/base/pose_reason.h"

namespace tbm::dds {

// PoseReason of the house and of the wire, each way. Empty for a number or a word that the contract
// does not know.
v1::PoseReason WireFromReason(PoseReason reason);
std::optional<PoseReason> ReasonFromWire(v1::PoseReason reason);
std::optional<PoseReason> ReasonFromCode(std::string_view code);

}  // namespace tbm::dds
