#include "devices/camera/sim_camera.h"

#include <algorithm>
#include <cmath>
#include <thread>
#include <utility>

namespace tbm {

SimCamera::SimCamera(const CameraConfig& config,
                     const Clock& clock,
                     std::shared_ptr<const sim::World> world,
                     const sim::ViewOptions& view)
    : config_(config),
      clock_(clock),
      view_(std::move(world), view),
      pixels_(view_.size_bytes()),
      requested_us_(config.exposure_us),
      period_ns_(std::llround(1e9 / config.frame_rate_hz)) {}

Result<Frame, CameraFailure> SimCamera::WaitFrame(Duration timeout) {
  const std::int64_t now_ns = clock_.Now().ns;
  const bool was_set_back = next_period_ * period_ns_ > now_ns + 2 * period_ns_;
  if (!is_open_ || was_set_back) next_period_ = now_ns / period_ns_ + 1;
  if (!is_open_)
    board_.Update([](CameraHealth& health) { health.state = CameraState::kStreaming; });
  is_open_ = true;

  const Duration until_due(next_period_ * period_ns_ - now_ns);
  if (until_due > Duration::zero()) std::this_thread::sleep_for(std::min(until_due, timeout));
  const Timestamp received_at = clock_.Now();
  if (received_at.ns < next_period_ * period_ns_) return Failure{CameraFailure::kNoFrameInTime};

  // The newest exposure that has ended; those before it found nobody.
  const std::int64_t period = received_at.ns / period_ns_;
  const auto lost = static_cast<std::uint64_t>(period - next_period_);
  next_period_ = period + 1;
  frame_number_ += 1 + lost;

  Frame frame;
  frame.exposure_us =
      std::clamp(requested_us_.load(), config_.exposure_min_us, config_.exposure_max_us);
  frame.received_at = received_at;
  frame.sensed_at =
      Timestamp{period * period_ns_} - Duration(std::llround(500.0 * frame.exposure_us));
  frame.frame_number = frame_number_;
  view_.Render(frame.sensed_at, frame.exposure_us, pixels_.data());
  frame.image = {pixels_.data(), view_.width_px(), view_.height_px(), view_.width_px(), 1, 255};
  board_.Update([&](CameraHealth& health) {
    ++health.frames;
    health.lost += lost;
    health.exposure_us = frame.exposure_us;
    health.last_frame_sensed_at = frame.sensed_at;
  });
  return frame;
}

void SimCamera::Close() {
  is_open_ = false;
  board_.Update([](CameraHealth& health) { health.state = CameraState::kClosed; });
}

}  // namespace tbm
