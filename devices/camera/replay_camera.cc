#include "devices/camera/replay_camera.h"

#include <algorithm>
#include <limits>
#include <thread>
#include <utility>

namespace tbm {
namespace {

FrameFault FaultOf(ImageFileFailure failure) {
  switch (failure) {
    case ImageFileFailure::kMissing:
      return FrameFault::kFileMissing;
    case ImageFileFailure::kUnreadable:
      return FrameFault::kFileUnreadable;
    case ImageFileFailure::kSize:
      return FrameFault::kFileSize;
  }
  return FrameFault::kFileUnreadable;
}

}  // namespace

ReplayCamera::ReplayCamera(const CameraConfig& config, const Clock& clock)
    : config_(config), clock_(clock) {}

bool ReplayCamera::Load() {
  if (run_) return true;
  if (is_bad_) return false;
  auto run = ReadRun(config_.run_folder);
  if (!run) {
    is_bad_ = true;
    std::string lines;
    for (const FileFault& fault : run.error()) lines += (lines.empty() ? "" : "; ") + fault.Text();
    board_.Fail(CameraState::kClosed, CameraFailure::kBadRun, lines);
    return false;
  }
  run_ = std::move(run).value();
  began_ = clock_.Steady();
  board_.Update([](CameraHealth& health) { health.state = CameraState::kStreaming; });
  return true;
}

bool ReplayCamera::WaitUntilDue(Timestamp sensed_at, Duration timeout) {
  if (!config_.real_time) return true;
  const auto due = began_ + (sensed_at - run_->frames.front().sensed_at);
  const Duration left = due - clock_.Steady();
  if (left > Duration::zero()) std::this_thread::sleep_for(std::min(left, timeout));
  return left <= timeout;
}

Result<Frame, CameraFailure> ReplayCamera::WaitFrame(Duration timeout) {
  if (!Load()) return Failure{CameraFailure::kBadRun};
  if (next_ == run_->frames.size()) {
    board_.Fail(CameraState::kClosed, CameraFailure::kEndOfRun, "all frames were replayed");
    return Failure{CameraFailure::kEndOfRun};
  }
  const RecordedFrame& recorded = run_->frames[next_];
  if (!WaitUntilDue(recorded.sensed_at, timeout)) return Failure{CameraFailure::kNoFrameInTime};

  Frame frame;
  frame.sensed_at = recorded.sensed_at;
  frame.received_at = recorded.sensed_at;
  frame.exposure_us = std::numeric_limits<double>::quiet_NaN();
  ImageResult image = ReadFrame(*run_, next_);
  frame.frame_number = ++next_;
  std::string detail;
  if (image) {
    image_ = std::move(image).value();
    frame.image = image_->View();
  } else {
    frame.fault = FaultOf(image.error().failure);
    detail = recorded.file + ": " + image.error().what;
  }
  board_.Update([&](CameraHealth& health) {
    ++health.frames;
    if (!frame.complete()) ++health.incomplete;
    health.detail = detail;
    health.last_frame_sensed_at = frame.sensed_at;
  });
  return frame;
}

void ReplayCamera::Close() {
  board_.Update([](CameraHealth& health) { health.state = CameraState::kClosed; });
}

}  // namespace tbm
