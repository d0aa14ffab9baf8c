#include "devices/camera/frame_id.h"

namespace tbm {
namespace {

constexpr std::uint64_t kIds = 65535;  // 1 .. 65535

}  // namespace

FrameIdCounter::Step FrameIdCounter::Count(std::uint64_t id) {
  if (!has_last_) {
    has_last_ = true;
    last_id_ = id;
    return {++number_, 0, false};
  }
  std::uint64_t forward = 0;
  if (id > kIds || last_id_ > kIds) {
    forward = id > last_id_ ? id - last_id_ : 0;
  } else {
    forward = (id % kIds + kIds - last_id_ % kIds) % kIds;
    if (forward > kIds / 2) forward = 0;
  }
  if (forward == 0) return {number_, 0, true};
  last_id_ = id;
  number_ += forward;
  return {number_, forward - 1, false};
}

}  // namespace tbm
