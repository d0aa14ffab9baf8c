#include "guidance/app/rail_devices.h"

#include <utility>

#include "devices/bus/serial_port.h"
#include "devices/imu/stim_unit.h"
#include "devices/inclinometer/make_inclinometers.h"

namespace tbm {
namespace {

// How long a thread may take to notice that it is to end.
constexpr std::chrono::milliseconds kPatience{100};
// A camera box speaks with each frame, targets or not.
constexpr std::chrono::seconds kFramesSilent{2};
// Half a minute of the fastest unit: beyond it the process hangs.
constexpr std::size_t kMostInputs = 60'000;

dds::DeviceState StateOf(InertialState state) {
  switch (state) {
    case InertialState::kClosed:
      return dds::DeviceState::kClosed;
    case InertialState::kOpening:
      return dds::DeviceState::kOpening;
    case InertialState::kStreaming:
      return dds::DeviceState::kStreaming;
    case InertialState::kSilent:
      return dds::DeviceState::kSilent;
  }
  return dds::DeviceState::kFault;
}

dds::DeviceState StateOf(InclinometerState state) {
  switch (state) {
    case InclinometerState::kClosed:
      return dds::DeviceState::kClosed;
    case InclinometerState::kOpening:
      return dds::DeviceState::kOpening;
    case InclinometerState::kStreaming:
      return dds::DeviceState::kStreaming;
    case InclinometerState::kSilent:
      return dds::DeviceState::kSilent;
  }
  return dds::DeviceState::kFault;
}

}  // namespace

RailDevices::RailDevices(const RailLineConfig& config,
                         std::size_t targets,
                         dds::Participant& participant,
                         const Clock& clock)
    : config_(config), targets_(targets), clock_(clock) {
  const RailDevicesConfig& devices = *config.devices;
  unit_ = std::make_unique<StimUnit>(
      devices.imu, std::make_unique<SerialPort>(devices.imu.port), clock_, sleeper_);
  unit_thread_ = std::jthread([this](const std::stop_token& stop) { ReadUnit(stop); });
  if (devices.inclinometer) {
    inclinometer_ = std::move(
        MakeInclinometers(std::span(&*devices.inclinometer, 1), {}, clock_, sleeper_).front());
    inclinometer_thread_ =
        std::jthread([this](const std::stop_token& stop) { ReadInclinometer(stop); });
  }
  if (devices.has_target_pixels) {
    features_.emplace(participant,
                      [this](const dds::FrameFeatures& features, const dds::SampleFacts& facts) {
                        Hear(features, facts);
                      });
  }
}

RailDevices::~RailDevices() { features_.reset(); }

void RailDevices::ReadUnit(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    const auto sample = unit_->Read(clock_.Steady() + kPatience);
    if (!sample) continue;
    {
      const std::lock_guard lock(mutex_);
      lacks_force_ = !sample->specific_force_m_s2;
      if (lacks_force_) ++without_force_;
    }
    if (!sample->specific_force_m_s2) continue;
    Add(ImuSample{.ends_at = sample->ends_at,
                  .interval_s = sample->interval_s,
                  .gyro_rad_s = sample->rate_rad_s,
                  .accel_m_s2 = *sample->specific_force_m_s2});
  }
}

void RailDevices::ReadInclinometer(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    const auto reading = inclinometer_->Read(clock_.Steady() + kPatience);
    if (!reading) continue;
    Add(TrolleyTilt{reading->sensed_at, {reading->raw.beta_rad, reading->raw.gamma_rad}});
  }
}

// A spot of a target is named by its row in targets.csv.
void RailDevices::Hear(const dds::FrameFeatures& features, const dds::SampleFacts& facts) {
  if (features.machine_id.view() != config_.machine_id) return;
  {
    const std::lock_guard lock(mutex_);
    is_contested_ = facts.contested;
    ++(facts.contested ? contested_ : frames_);
    frame_at_ = clock_.Steady();
  }
  if (facts.contested) return;
  TargetImage image{features.sensed_at, {}};
  for (const dds::Spot& spot : features.spots) {
    if (spot.led_index < 0 || static_cast<std::size_t>(spot.led_index) >= targets_) continue;
    const double sigma_px = spot.centre.sigma_px > 0.0 ? spot.centre.sigma_px : 0.0;  // or NaN
    image.pixels.push_back({spot.led_index, spot.centre.pixel_px, sigma_px});
  }
  if (!image.pixels.empty()) Add(std::move(image));
}

void RailDevices::Add(RailInput input) {
  const std::lock_guard lock(mutex_);
  if (inputs_.size() < kMostInputs) {
    inputs_.push_back(std::move(input));
  } else {
    ++dropped_;
  }
}

void RailDevices::Take(std::chrono::steady_clock::time_point, std::vector<RailInput>* inputs) {
  inputs->clear();
  const std::lock_guard lock(mutex_);
  std::swap(*inputs, inputs_);
}

bool RailDevices::FillHealth(std::string_view device, dds::DeviceHealth* health) const {
  if (device == "rail_line") {
    const std::lock_guard lock(mutex_);
    health->samples_lost += dropped_;
  } else if (device == "imu") {
    FillUnitHealth(health);
  } else if (device == "inclinometer" && inclinometer_ != nullptr) {
    FillInclinometerHealth(health);
  } else if (device == "targets") {
    FillTargetsHealth(health);
  } else {
    return false;
  }
  return true;
}

void RailDevices::FillUnitHealth(dds::DeviceHealth* health) const {
  const std::lock_guard lock(mutex_);
  const InertialHealth of = unit_->Health();
  health->state = StateOf(of.state);
  health->samples_good = of.counters.good - without_force_;
  health->samples_lost = of.counters.lost;
  health->errors =
      of.counters.garbled + of.counters.faulty + of.counters.overloads + without_force_;
  health->reconnects = of.counters.reconnects;
  if (of.last_failure) {
    health->detail = FailureCode(*of.last_failure);
  } else if (lacks_force_) {
    health->state = dds::DeviceState::kFault;
    health->detail =
        "no specific force in its samples: set it to send accelerations; gyros alone carry no line";
  }
}

void RailDevices::FillInclinometerHealth(dds::DeviceHealth* health) const {
  const InclinometerHealth of = inclinometer_->Health();
  health->state = StateOf(of.state);
  health->samples_good = of.counters.good;
  health->errors = of.counters.garbled + of.counters.implausible + of.counters.no_reply;
  health->reconnects = of.counters.reconnects;
  if (of.last_failure) health->detail = FailureCode(*of.last_failure);
}

void RailDevices::FillTargetsHealth(dds::DeviceHealth* health) const {
  const std::lock_guard lock(mutex_);
  health->samples_good = frames_;
  health->errors = contested_;
  if (!features_) {
    health->state = dds::DeviceState::kClosed;
  } else if (!frame_at_) {
    health->state = dds::DeviceState::kOpening;
    health->detail = "no camera box has spoken for this machine";
  } else if (clock_.Steady() - *frame_at_ > kFramesSilent) {
    health->state = dds::DeviceState::kSilent;
  } else if (is_contested_) {
    health->state = dds::DeviceState::kFault;
    health->detail = "two camera boxes speak for this machine: neither is used";
  } else {
    health->state = dds::DeviceState::kStreaming;
  }
}

}  // namespace tbm
