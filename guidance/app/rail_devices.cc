#include "guidance/app/rail_devices.h"

#include <utility>

#include "devices/bus/serial_port.h"
#include "devices/imu/stim_unit.h"
#include "devices/inclinometer/make_inclinometers.h"

namespace tbm {
namespace {

// How long a thread may take to notice that it is to end.
constexpr std::chrono::milliseconds kPatience{100};
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
                        if (!facts.contested) Hear(features);
                      });
  }
}

RailDevices::~RailDevices() { features_.reset(); }

void RailDevices::ReadUnit(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    const auto sample = unit_->Read(clock_.Steady() + kPatience);
    if (!sample || !sample->specific_force_m_s2) continue;
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
void RailDevices::Hear(const dds::FrameFeatures& features) {
  if (features.machine_id.view() != config_.machine_id) return;
  TargetImage image{features.sensed_at, {}};
  for (const dds::Spot& spot : features.spots) {
    if (spot.led_index < 0 || static_cast<std::size_t>(spot.led_index) >= targets_) continue;
    TargetPixel pixel;
    pixel.target = spot.led_index;
    pixel.pixel_px = spot.centre.pixel_px;
    image.pixels.push_back(pixel);
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
  if (device == "imu") {
    const InertialHealth of = unit_->Health();
    health->state = StateOf(of.state);
    health->samples_good = of.counters.good;
    health->samples_lost = of.counters.lost;
    health->errors = of.counters.garbled + of.counters.faulty + of.counters.overloads;
    health->reconnects = of.counters.reconnects;
    if (of.last_failure) health->detail = FailureCode(*of.last_failure);
    return true;
  }
  if (device == "inclinometer" && inclinometer_ != nullptr) {
    const InclinometerHealth of = inclinometer_->Health();
    health->state = StateOf(of.state);
    health->samples_good = of.counters.good;
    health->errors = of.counters.garbled + of.counters.implausible + of.counters.no_reply;
    health->reconnects = of.counters.reconnects;
    if (of.last_failure) health->detail = FailureCode(*of.last_failure);
    return true;
  }
  return false;
}

}  // namespace tbm
