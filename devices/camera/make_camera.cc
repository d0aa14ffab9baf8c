#include <cstdlib>
#include <utility>

#include "devices/camera/gige_camera.h"
#include "devices/camera/replay_camera.h"
#include "devices/camera/sim_camera.h"
#include "pose/base/check.h"

namespace tbm {

std::unique_ptr<Camera> MakeCamera(const CameraConfig& config,
                                   const Clock& clock,
                                   std::shared_ptr<const sim::World> world) {
  switch (config.driver) {
    case CameraDriver::kGige:
      return std::make_unique<GigeCamera>(config, clock);
    case CameraDriver::kSim:
      TBM_CHECK(world != nullptr);
      return std::make_unique<SimCamera>(config, clock, std::move(world), sim::ViewOptions{});
    case CameraDriver::kReplay:
      return std::make_unique<ReplayCamera>(config, clock);
  }
  std::abort();
}

}  // namespace tbm
