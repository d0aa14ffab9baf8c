#include "devices/camera/camera.h"

// Grabs from the camera at argv[1] until it is killed.
int main(int argc, char** argv) {
  if (argc != 2) return 2;
  tbm::CameraConfig config;
  config.driver = tbm::CameraDriver::kGige;
  config.address = argv[1];
  config.packet_size_bytes = 8192;
  const tbm::SystemClock clock;
  const auto camera = tbm::MakeCamera(config, clock);
  for (;;) (void)camera->WaitFrame(std::chrono::milliseconds(100));
}
