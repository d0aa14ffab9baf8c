#include "guidance/config/imu_section.h"

#include <string>

#include <fmt/format.h>

#include "pose/rig/yaml_section.h"

namespace tbm {
namespace {

void ReadOutput(YamlSection& section, std::string_view name, StimOutput* output) {
  std::string word = "rate";
  if (section.Word(name, {"rate", "increment"}, &word)) {
    *output = word == "increment" ? StimOutput::kIncrement : StimOutput::kRate;
  }
}

}  // namespace

void ReadImuSection(const YamlNode& node, StimConfig* config) {
  if (!IsSection(node)) return;
  YamlSection section(node);
  const YamlNode model = section.Require("model", "stim300: a unit with accelerometers");
  if (const auto text = model.Text(); text && *text != "stim300") {
    model.Fault(
        fmt::format("'{}' carries no line: must be stim300, which has accelerometers; "
                    "stim210 and stim202 have gyros alone",
                    *text));
  }
  if (const auto port = section.Require("port", "a device such as /dev/ttyUSB0").Text()) {
    config->port.path = *port;
  }
  section.Integer("baud", 1200, 921600, &config->port.baud);
  section.Integer("stop_bits", 1, 2, &config->port.stop_bits);
  section.Number("sample_rate_hz", 1.0, 10'000.0, "Hz", &config->scales.sample_rate_hz);
  ReadOutput(section, "gyro_output", &config->scales.gyro);
  ReadOutput(section, "accel_output", &config->scales.accel);
  ReadOutput(section, "tilt_output", &config->scales.tilt);
  section.Integer("accel_range_g", 1, 1000, &config->scales.accel_range_g);
  section.Number("counter_hz", 1.0, 1e6, "Hz", &config->counter_hz);
  section.Time("constant_delay_ms", 0.0, 100.0, &config->constant_delay);
  section.Time("silent_after_ms", 50.0, 600'000.0, &config->silent_after);
  section.Time("reconnect_period_ms", 20.0, 60'000.0, &config->reconnect_period);
  section.Time("reopen_after_ms", 0.0, 600'000.0, &config->reopen_after);
  section.Time("frozen_after_ms", 0.0, 60'000.0, &config->frozen_after);
  section.RefuseOthers();
  for (const std::string& fault : CheckStimConfig(*config)) {
    // "imu.<key>: <what>"
    const std::size_t dot = fault.find('.');
    const std::size_t colon = fault.find(": ", dot);
    node.Optional(fault.substr(dot + 1, colon - dot - 1)).Fault(fault.substr(colon + 2));
  }
}

}  // namespace tbm
