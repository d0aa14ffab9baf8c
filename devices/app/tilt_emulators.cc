#include "devices/app/tilt_emulators.h"

#include <chrono>
#include <utility>

#include <fmt/format.h>

#include "pose/base/angle.h"

namespace tbm {
namespace {

// From the end of a request to the begin of the reply, as instruments need it.
constexpr std::chrono::nanoseconds kThinkTime = std::chrono::milliseconds(2);
constexpr std::chrono::nanoseconds kAutomaticPeriod = std::chrono::milliseconds(50);

struct Instrument {
  int address;
  TiltTruth truth;
};

ModbusRegisterMap Registers() {
  ModbusRegisterMap map;
  map.function = 4;
  map.format = RegisterFormat::kInt32;
  map.beta_register = 0;
  map.gamma_register = 2;
  map.rad_per_lsb = DegToRad(0.0001);
  return map;
}

std::unique_ptr<ModbusEmulator> Modbus(const SerialSettings& line,
                                       const std::vector<Instrument>& instruments,
                                       const Clock& clock) {
  std::vector<EmulatedModbusTilt> tilts;
  tilts.reserve(instruments.size());
  for (const Instrument& instrument : instruments) {
    tilts.push_back({instrument.address, Registers(), instrument.truth, 21.0});
  }
  return std::make_unique<ModbusEmulator>(line, std::move(tilts), kThinkTime, clock);
}

std::unique_ptr<BcdFrameEmulator> Frames(FrameFamily family,
                                         const SerialSettings& line,
                                         const std::vector<Instrument>& instruments,
                                         const Clock& clock) {
  std::vector<EmulatedFrameTilt> tilts;
  tilts.reserve(instruments.size());
  for (const Instrument& instrument : instruments) {
    tilts.push_back({static_cast<std::uint8_t>(instrument.address),
                     FrameLayout::kFourByteTemperature,
                     instrument.truth,
                     21.0});
  }
  return std::make_unique<BcdFrameEmulator>(
      line, family, std::move(tilts), kThinkTime, kAutomaticPeriod, clock);
}

}  // namespace

Result<std::unique_ptr<TiltEmulators>, std::string> TiltEmulators::Start(
    const TiltEmulatorOptions& options,
    const std::shared_ptr<const sim::World>& world,
    const Clock& clock) {
  const auto truth = [world](sim::TiltSensor sensor) -> TiltTruth {
    return [world, sensor](Timestamp when) { return world->TiltReading(sensor, when); };
  };
  const Instrument target{1, truth(sim::TiltSensor::kTarget)};
  const Instrument camera{2, truth(sim::TiltSensor::kCamera)};
  std::vector<std::pair<std::string, std::vector<Instrument>>> wires;
  if (options.target_port == options.camera_port) {
    wires = {{options.target_port, {target, camera}}};
  } else {
    wires = {{options.target_port, {target}}, {options.camera_port, {camera}}};
  }

  auto emulators = std::make_unique<TiltEmulators>();
  for (const auto& [path, instruments] : wires) {
    SerialSettings line;
    line.path = path;
    line.baud = options.baud;
    bool is_up = false;
    if (options.protocol == "modbus") {
      emulators->modbus_.push_back(Modbus(line, instruments, clock));
      is_up = emulators->modbus_.back()->IsUp();
    } else {
      const FrameFamily family =
          options.protocol == "rion68" ? FrameFamily::kRion68 : FrameFamily::kBewis77;
      emulators->frames_.push_back(Frames(family, line, instruments, clock));
      is_up = emulators->frames_.back()->IsUp();
    }
    if (!is_up) {
      return Failure{fmt::format(
          "{}: the link to a pseudo-terminal cannot be made: is its folder there and writable, and "
          "is no other file of that name in the way?",
          path)};
    }
  }
  return emulators;
}

}  // namespace tbm
