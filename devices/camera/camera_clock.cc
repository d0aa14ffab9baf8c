#include "devices/camera/camera_clock.h"

#include <algorithm>

namespace tbm {

CameraClock::SteadyTime CameraClock::ToHost(std::int64_t stamp_ns, SteadyTime received_at) {
  const auto at = [](std::int64_t steady_ns) {
    return SteadyTime(std::chrono::nanoseconds(steady_ns));
  };
  const std::int64_t received_ns =
      std::chrono::duration_cast<std::chrono::nanoseconds>(received_at.time_since_epoch()).count();
  const std::int64_t difference_ns = received_ns - stamp_ns;
  if (count_ == 0 || difference_ns < Smallest() - kStepNs) {
    Restart();
  } else if (difference_ns > Smallest() + kStepNs) {
    smallest_of_high_ns_ =
        high_in_a_row_ == 0 ? difference_ns : std::min(smallest_of_high_ns_, difference_ns);
    if (++high_in_a_row_ < kStepFrames) return at(stamp_ns + Smallest());
    const std::int64_t offset_ns = smallest_of_high_ns_;
    Restart();
    Keep(offset_ns);
    return at(stamp_ns + offset_ns);
  }
  high_in_a_row_ = 0;
  Keep(difference_ns);
  return at(stamp_ns + Smallest());
}

void CameraClock::Restart() {
  count_ = 0;
  next_ = 0;
  high_in_a_row_ = 0;
}

void CameraClock::Keep(std::int64_t difference_ns) {
  differences_ns_[next_] = difference_ns;
  next_ = (next_ + 1) % kWindow;
  count_ = std::min(count_ + 1, kWindow);
}

std::int64_t CameraClock::Smallest() const {
  return *std::min_element(differences_ns_.begin(),
                           differences_ns_.begin() + static_cast<std::ptrdiff_t>(count_));
}

}  // namespace tbm
