#pragma once

#include <chrono>
#include <optional>
#include <vector>

#include "guidance/app/rail_source.h"
#include "guidance/config/rail_line_file.h"
#include "guidance/rail/rail_recording.h"

namespace tbm {

// A recorded run that is played as if its instruments were there: each reading comes when it came
// on that day, counted from the first look; targets of an image by their delay later.
class RailReplay final : public RailSource {
 public:
  using SteadyTime = std::chrono::steady_clock::time_point;

  RailReplay(const RailRecording& recording, const RailReplayConfig& config);  // both outlive it

  void Take(SteadyTime now, std::vector<RailInput>* inputs) override;
  bool has_ended() const override { return !Next(); }
  bool FillHealth(std::string_view, dds::DeviceHealth*) const override { return false; }

 private:
  // The input that comes next, of the lists in this order where two come together.
  struct Arrival {
    Timestamp at;
    std::size_t list = 0;
  };
  std::optional<Arrival> Next() const;
  RailInput Pop(std::size_t list);

  const RailRecording& recording_;
  const double speed_;
  const Duration image_delay_;
  Timestamp begins_at_;
  std::optional<SteadyTime> started_at_;
  std::size_t imu_ = 0;
  std::size_t tilt_ = 0;
  std::size_t image_ = 0;
  std::size_t odometer_ = 0;
};

}  // namespace tbm
