#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "guidance/config/machine_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto file =
      tbm::ParseMachineFile({reinterpret_cast<const char*>(data), size}, "machine.yaml");
  if (!file) {
    if (file.error().empty()) __builtin_trap();  // refused without saying why
    for (const auto& fault : file.error()) {
      if (fault.Text().empty()) __builtin_trap();
    }
    return 0;
  }
  // What is accepted keeps what machine.h promises.
  const tbm::Machine& machine = file->machine;
  if (machine.prisms.empty() || machine.prisms.size() > tbm::kMaxPrisms) __builtin_trap();
  if (machine.points.empty() || machine.points.size() > tbm::kMaxGuidedPoints) __builtin_trap();
  if (machine.steer_by >= machine.points.size()) __builtin_trap();
  if (machine.points[machine.steer_by].shield != tbm::ShieldName::kFront) __builtin_trap();
  if (!(machine.station.period_s > 0.0) || !(machine.useful_sigma_m > 0.0)) __builtin_trap();
  const auto& camera = machine.geometry.rear_shield_from_camera.b_from_a;
  if (!(std::abs(camera.rotation.norm() - 1.0) < 1e-9)) __builtin_trap();
  return 0;
}
