#pragma once

#include <memory>
#include <string>
#include <vector>

#include "devices/inclinometer/bcd_frame_emulator.h"
#include "devices/inclinometer/modbus_emulator.h"
#include "devices/sim/world.h"
#include "pose/base/result.h"

namespace tbm {

// The two inclinometers of a simulated machine, on pseudo-terminals.
struct TiltEmulatorOptions {
  std::string protocol = "modbus";  // modbus | rion68 | bewis77
  // Symbolic links to be made. The same path twice: both instruments on one wire.
  std::string target_port = "tilt_target";
  std::string camera_port = "tilt_camera";
  int baud = 115200;
};

// Address of each instrument: 1 for the target's, 2 for the camera's.
//
// modbus: input registers 0, 1 hold beta and 2, 3 gamma, as signed 32-bit numbers, high word first,
// of 0.0001 degree. rion68, bewis77: four-byte angles of 0.0001 degree.
class TiltEmulators {
 public:
  static Result<std::unique_ptr<TiltEmulators>, std::string> Start(
      const TiltEmulatorOptions& options,
      const std::shared_ptr<const sim::World>& world,
      const Clock& clock);

 private:
  std::vector<std::unique_ptr<ModbusEmulator>> modbus_;
  std::vector<std::unique_ptr<BcdFrameEmulator>> frames_;
};

}  // namespace tbm
