#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "devices/camera/camera.h"
#include "devices/camera/health_board.h"
#include "devices/replay/image_file.h"
#include "devices/replay/run_reader.h"

namespace tbm {

// The frames of a recorded run, every row of frames.csv once and in order, also those whose image
// is missing or damaged. Times are the recorded ones; nothing of the computer's clock is in a
// frame. Reading an image allocates.
class ReplayCamera final : public Camera {
 public:
  ReplayCamera(const CameraConfig& config, const Clock& clock);

  Result<Frame, CameraFailure> WaitFrame(Duration timeout) override;
  void RequestExposure(double) override {}
  CameraHealth Health() const override { return board_.Read(); }
  void Close() override;

 private:
  bool Load();
  // In real time: false when the next frame is not due within `timeout`.
  bool WaitUntilDue(Timestamp sensed_at, Duration timeout);

  const CameraConfig config_;
  const Clock& clock_;
  HealthBoard board_;
  std::optional<RecordedRun> run_;
  bool is_bad_ = false;
  std::size_t next_ = 0;
  std::optional<OwnedImage> image_;
  std::chrono::steady_clock::time_point began_;
};

}  // namespace tbm
