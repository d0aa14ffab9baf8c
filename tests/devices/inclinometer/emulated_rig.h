#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "devices/inclinometer/bcd_frame_emulator.h"
#include "devices/inclinometer/make_inclinometers.h"
#include "devices/inclinometer/modbus_emulator.h"

namespace tbm::test {

// Angles that a test can move while an emulator reads them.
class MovableTruth {
 public:
  explicit MovableTruth(Inclination angles) : angles_(angles) {}
  void Set(Inclination angles) {
    const std::lock_guard lock(mutex_);
    angles_ = angles;
  }
  TiltTruth Function() {
    return [this](Timestamp) {
      const std::lock_guard lock(mutex_);
      return angles_;
    };
  }

 private:
  std::mutex mutex_;
  Inclination angles_;
};

inline ModbusRegisterMap ThousandthsOfADegree() {
  ModbusRegisterMap map;
  map.rad_per_lsb = DegToRad(0.001);
  return map;
}

// Fast enough that a test is short, with the ratios of the real settings.
inline InclinometerConfig QuickConfig(InclinometerDriver driver, const std::string& path) {
  InclinometerConfig config;
  config.name = "target";
  config.driver = driver;
  config.port.path = path;
  config.port.baud = 115200;
  config.address = driver == InclinometerDriver::kModbus ? 1 : 0;
  config.registers = ThousandthsOfADegree();
  config.poll_period = std::chrono::milliseconds(10);
  config.silent_after = std::chrono::milliseconds(300);
  return config;
}

}  // namespace tbm::test
