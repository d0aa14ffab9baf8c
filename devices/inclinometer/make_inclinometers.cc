#include "devices/inclinometer/make_inclinometers.h"

#include <algorithm>

#include "devices/bus/serial_port.h"
#include "devices/inclinometer/bcd_frame_wire.h"
#include "devices/inclinometer/modbus_wire.h"
#include "devices/inclinometer/polled_inclinometer.h"
#include "devices/inclinometer/replay_inclinometer.h"
#include "devices/inclinometer/streamed_inclinometer.h"
#include "pose/base/check.h"

namespace tbm {
namespace {

FrameFamily FamilyOf(InclinometerDriver driver) {
  return driver == InclinometerDriver::kRion68 ? FrameFamily::kRion68 : FrameFamily::kBewis77;
}

bool IsOnWire(const InclinometerConfig& config) {
  return config.driver != InclinometerDriver::kSim && config.driver != InclinometerDriver::kReplay;
}

struct SharedWire {
  std::shared_ptr<TiltBus> bus;
  int instruments = 0;
};

// One bus a port. It is as quiet as the slowest instrument on it needs.
std::map<std::string, SharedWire> MakeBuses(std::span<const InclinometerConfig> configs,
                                            const Clock& clock,
                                            Sleeper& sleeper) {
  std::map<std::string, SharedWire> wires;
  for (const InclinometerConfig& config : configs) {
    if (!IsOnWire(config) || config.automatic_output) continue;
    SharedWire& shared = wires[config.port.path];
    if (++shared.instruments > 1) continue;
    TiltBus::Timing timing{config.quiet_time, config.reconnect_period, config.reopen_after};
    for (const InclinometerConfig& other : configs) {
      if (other.port.path != config.port.path) continue;
      timing.quiet_time = std::max(timing.quiet_time, other.quiet_time);
    }
    std::unique_ptr<TiltWire> wire;
    if (config.driver == InclinometerDriver::kModbus) {
      wire = std::make_unique<ModbusWire>(config.port);
    } else {
      wire = std::make_unique<BcdFrameWire>(
          FamilyOf(config.driver), std::make_unique<SerialPort>(config.port), clock);
    }
    shared.bus = std::make_shared<TiltBus>(std::move(wire), timing, clock, sleeper);
  }
  return wires;
}

}  // namespace

std::vector<std::unique_ptr<Inclinometer>> MakeInclinometers(
    std::span<const InclinometerConfig> configs,
    const InclinometerSources& sources,
    const Clock& clock,
    Sleeper& sleeper) {
  const auto wires = MakeBuses(configs, clock, sleeper);
  std::vector<std::unique_ptr<Inclinometer>> made;
  for (const InclinometerConfig& config : configs) {
    switch (config.driver) {
      case InclinometerDriver::kSim: {
        const auto truth = sources.truths.find(config.name);
        TBM_CHECK(truth != sources.truths.end());
        made.push_back(
            std::make_unique<SimInclinometer>(config, truth->second, sources.seed, clock, sleeper));
        break;
      }
      case InclinometerDriver::kReplay: {
        const auto recording = sources.recordings.find(config.name);
        TBM_CHECK(recording != sources.recordings.end());
        made.push_back(std::make_unique<ReplayInclinometer>(
            recording->second, sources.replay_start, sources.replay_speed, clock, sleeper));
        break;
      }
      case InclinometerDriver::kModbus:
      case InclinometerDriver::kRion68:
      case InclinometerDriver::kBewis77: {
        if (config.automatic_output) {
          made.push_back(
              std::make_unique<StreamedInclinometer>(config,
                                                     FamilyOf(config.driver),
                                                     std::make_unique<SerialPort>(config.port),
                                                     clock,
                                                     sleeper));
          break;
        }
        const SharedWire& shared = wires.at(config.port.path);
        made.push_back(std::make_unique<PolledInclinometer>(
            config, shared.bus, clock, shared.instruments > 1));
        break;
      }
    }
  }
  return made;
}

}  // namespace tbm
