#include "guidance/app/rail_replay.h"

#include <algorithm>
#include <cmath>

namespace tbm {

Timestamp StampOf(const RailInput& input) {
  struct Of {
    Timestamp operator()(const ImuSample& sample) const { return sample.ends_at; }
    Timestamp operator()(const TrolleyTilt& tilt) const { return tilt.sensed_at; }
    Timestamp operator()(const TargetImage& image) const { return image.stamped_at; }
    Timestamp operator()(const OdometerReading& reading) const { return reading.sensed_at; }
  };
  return std::visit(Of{}, input);
}

RailReplay::RailReplay(const RailRecording& recording, const RailReplayConfig& config)
    : recording_(recording),
      speed_(config.speed),
      image_delay_(std::llround(config.image_delay_s * 1e9)) {
  if (const auto first = Next()) begins_at_ = first->at;
}

void RailReplay::Take(SteadyTime now, std::vector<RailInput>* inputs) {
  inputs->clear();
  if (!started_at_) started_at_ = now;
  const double played_s = speed_ * std::chrono::duration<double>(now - *started_at_).count();
  const Timestamp up_to = begins_at_ + Duration(std::llround(played_s * 1e9));
  for (auto next = Next(); next && next->at <= up_to; next = Next()) {
    inputs->push_back(Pop(next->list));
  }
}

std::optional<RailReplay::Arrival> RailReplay::Next() const {
  std::optional<Arrival> next;
  const auto offer = [&](std::size_t list, Timestamp at) {
    if (!next || at < next->at) next = {at, list};
  };
  if (tilt_ < recording_.tilts.size()) offer(0, recording_.tilts[tilt_].sensed_at);
  if (image_ < recording_.images.size()) {
    offer(1, recording_.images[image_].stamped_at + image_delay_);
  }
  if (odometer_ < recording_.odometer.size()) {
    offer(2, recording_.odometer[odometer_].sensed_at);
  }
  if (imu_ < recording_.imu.size()) offer(3, recording_.imu[imu_].ends_at);
  return next;
}

RailInput RailReplay::Pop(std::size_t list) {
  switch (list) {
    case 0:
      return recording_.tilts[tilt_++];
    case 1:
      return recording_.images[image_++];
    case 2:
      return recording_.odometer[odometer_++];
    default:
      return recording_.imu[imu_++];
  }
}

}  // namespace tbm
