#pragma once

#include <chrono>
#include <string_view>
#include <variant>
#include <vector>

#include "guidance/rail/rail_recording.h"
#include "idl/cpp/messages.h"

namespace tbm {

// What the instruments of a trolley say.
using RailInput = std::variant<ImuSample, TrolleyTilt, TargetImage, OdometerReading>;

Timestamp StampOf(const RailInput& input);

// Where it comes from.
class RailSource {
 public:
  virtual ~RailSource() = default;

  // What has come since the last look, in the order in which it came. `inputs` is emptied first.
  virtual void Take(std::chrono::steady_clock::time_point now, std::vector<RailInput>* inputs) = 0;

  virtual bool has_ended() const = 0;

  // How an instrument ("imu", "inclinometer", "targets") stands, where it can tell: state, counts
  // and detail are filled in. False where only what has come tells.
  virtual bool FillHealth(std::string_view device, dds::DeviceHealth* health) const = 0;
};

}  // namespace tbm
