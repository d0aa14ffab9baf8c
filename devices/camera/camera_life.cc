#include "devices/camera/camera_life.h"

#include <algorithm>

namespace tbm {

Duration CameraLife::UntilOpening(Instant now) const {
  if (!next_opening_ || now >= *next_opening_) return Duration::zero();
  return *next_opening_ - now;
}

void CameraLife::Opening() { state_ = CameraState::kOpening; }

void CameraLife::OpeningFailed(Instant now) {
  state_ = CameraState::kClosed;
  next_opening_ = now + back_off_;
  back_off_ = std::min(2 * back_off_, kLongestBackOff);
}

void CameraLife::Opened(Instant now) {
  state_ = CameraState::kStreaming;
  silent_from_ = now + std::max(silent_after_, kFirstFrameGrace);
}

void CameraLife::GotFrame(Instant now) {
  state_ = CameraState::kStreaming;
  back_off_ = kFirstBackOff;
  silent_from_ = now + silent_after_;
}

void CameraLife::GotNothing(Instant now) {
  if (state_ != CameraState::kStreaming || now < silent_from_) return;
  state_ = CameraState::kSilent;
  next_question_ = now + kGiveUpAfter;
}

bool CameraLife::ShouldAsk(Instant now) const {
  return state_ == CameraState::kSilent && now >= next_question_;
}

void CameraLife::Lost(Instant now) {
  state_ = CameraState::kClosed;
  next_opening_ = now;
}

}  // namespace tbm
