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
  // `targets`: how many there are. `clock` stamps what is measured. All that is referred to
  // outlives it.
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
  void Hear(const dds::FrameFeatures& features, const dds::SampleFacts& facts);
  void Add(RailInput input);
  void FillUnitHealth(dds::DeviceHealth* health) const;
  void FillInclinometerHealth(dds::DeviceHealth* health) const;
  void FillTargetsHealth(dds::DeviceHealth* health) const;

  const RailLineConfig& config_;
  const std::size_t targets_;
  const Clock& clock_;
  SystemSleeper sleeper_;
  std::unique_ptr<InertialUnit> unit_;
  std::unique_ptr<Inclinometer> inclinometer_;  // null: there is none
  mutable std::mutex mutex_;                    // guards those below, up to the threads
  std::vector<RailInput> inputs_;
  std::uint64_t dropped_ = 0;        // inputs that nobody took
  std::uint64_t without_force_ = 0;  // samples of a unit that sends rates only
  bool lacks_force_ = false;         // the last one did
  std::uint64_t frames_ = 0;         // of the camera box, with targets or without
  std::uint64_t contested_ = 0;      // and those that two boxes claim to be of this machine
  bool is_contested_ = false;        // the last one was
  std::optional<std::chrono::steady_clock::time_point> frame_at_;
  std::optional<dds::Subscriber<dds::FrameFeatures>> features_;
  std::jthread unit_thread_;  // these stop first
  std::jthread inclinometer_thread_;
};

}  // namespace tbm
