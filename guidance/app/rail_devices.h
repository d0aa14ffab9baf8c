#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "devices/bus/sleeper.h"
#include "devices/imu/inertial_unit.h"
#include "devices/inclinometer/inclinometer.h"
#include "guidance/app/rail_source.h"
#include "guidance/config/rail_line_file.h"
#include "idl/cpp/participant.h"
#include "idl/cpp/subscriber.h"
#include "pose/base/clock.h"

namespace tbm {

// The instruments of a trolley: inertial unit and inclinometer on their ports, each with a thread
// of its own, and image points of targets as a camera box tells them.
class RailDevices final : public RailSource {
 public:
  // `targets`: how many there are. All that is referred to outlives it.
  RailDevices(const RailLineConfig& config,
              std::size_t targets,
              dds::Participant& participant,
              const Clock& clock);
  ~RailDevices() override;

  void Take(std::chrono::steady_clock::time_point now, std::vector<RailInput>* inputs) override;
  bool has_ended() const override { return false; }
  bool FillHealth(std::string_view device, dds::DeviceHealth* health) const override;

 private:
  void ReadUnit(const std::stop_token& stop);
  void ReadInclinometer(const std::stop_token& stop);
  void Hear(const dds::FrameFeatures& features);
  void Add(RailInput input);

  const RailLineConfig& config_;
  const std::size_t targets_;
  const Clock& clock_;
  SystemSleeper sleeper_;
  std::unique_ptr<InertialUnit> unit_;
  std::unique_ptr<Inclinometer> inclinometer_;  // null: there is none
  mutable std::mutex mutex_;                    // guards the two below
  std::vector<RailInput> inputs_;
  std::uint64_t dropped_ = 0;
  std::optional<dds::Subscriber<dds::FrameFeatures>> features_;
  std::jthread unit_thread_;  // these stop first
  std::jthread inclinometer_thread_;
};

}  // namespace tbm
