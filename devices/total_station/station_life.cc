#include "devices/total_station/station_life.h"

#include <algorithm>

namespace tbm {

void StationLife::OpeningFailed(SteadyTime now) {
  state_ = StationState::kClosed;
  next_opening_ = now + back_off_;
  back_off_ = std::min(2 * back_off_, longest_back_off_);
}

bool StationLife::Ready() {
  state_ = StationState::kReady;
  back_off_ = first_back_off_;
  const bool is_again = was_ready_;
  was_ready_ = true;
  return is_again;
}

void StationLife::Answered() {
  if (state_ == StationState::kSilent) state_ = StationState::kReady;
}

void StationLife::NotAnswered() {
  if (state_ == StationState::kReady) state_ = StationState::kSilent;
}

// A line that breaks again and again right after each opening is not opened without a pause either.
void StationLife::Lost(SteadyTime now) {
  state_ = StationState::kClosed;
  next_opening_ = now + first_back_off_;
}

}  // namespace tbm
