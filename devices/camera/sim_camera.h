#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "devices/camera/camera.h"
#include "devices/camera/health_board.h"
#include "devices/sim/camera_view.h"
#include "devices/sim/world.h"

namespace tbm {

// A camera inside the process that looks at a simulated world: no network, no other program.
// Exposures end at whole multiples of the frame period of the clock. A caller that comes late loses
// frames, as with a real camera, and sees it in the frame numbers.
class SimCamera final : public Camera {
 public:
  SimCamera(const CameraConfig& config,
            const Clock& clock,
            std::shared_ptr<const sim::World> world,
            const sim::ViewOptions& view);

  Result<Frame, CameraFailure> WaitFrame(Duration timeout) override;
  void RequestExposure(double exposure_us) override { requested_us_.store(exposure_us); }
  CameraHealth Health() const override { return board_.Read(); }
  void Close() override;

 private:
  const CameraConfig config_;
  const Clock& clock_;
  sim::CameraView view_;
  std::vector<std::uint8_t> pixels_;
  HealthBoard board_;
  std::atomic<double> requested_us_;
  std::int64_t period_ns_;
  std::int64_t next_period_ = 0;  // the exposure due next ends at next_period_ * period_ns_
  std::uint64_t frame_number_ = 0;
  bool is_open_ = false;
};

}  // namespace tbm
