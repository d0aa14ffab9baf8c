#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "devices/bus/byte_link.h"
#include "devices/imu/stim_reading.h"
#include "pose/base/time.h"

namespace tbm {

enum class StimModel {
  kStim300,  // `stim300`
  kStim210,  // `stim210`
  kStim202,  // `stim202`: as the STIM210, by assumption
};
std::optional<StimModel> StimModelFromWord(std::string_view word);
std::string_view WordOf(StimModel model);
StimFamily FamilyOf(StimModel model);

// One unit, in SI units, as it is set up with the vendor's tool. The loader turns keys
// (silent_after_ms, ...) into this.
struct StimConfig {
  StimModel model = StimModel::kStim300;
  SerialSettings port{"", 460800, Parity::kNone, 1};
  StimScales scales;  // output of gyros, accelerometers and inclinometers, range, sample rate

  // What the unit's counter counts; 2000 internal samples a second in all models known.
  double counter_hz = 2000.0;
  // What is constant and stands in no datagram: the group delay of the unit's low-pass filter (its
  // data sheet), and for models without a latency field the unit's own.
  Duration constant_delay{0};

  Duration silent_after = std::chrono::milliseconds(300);
  Duration reconnect_period = std::chrono::milliseconds(100);
  // The port is closed and opened again when it is silent for so long; 0 never.
  Duration reopen_after = std::chrono::seconds(5);
  // No digit of any gyro and accelerometer has changed for so long; 0 never.
  Duration frozen_after = std::chrono::milliseconds(200);

  int CounterStep() const;  // from one sample to the next
};

// Every fault of a config as one line "imu.<key>: <value>: what is right". Empty when it is good.
std::vector<std::string> CheckStimConfig(const StimConfig& config);

}  // namespace tbm
