#include "pose/app/inclinometer_section.h"

#include "pose/base/angle.h"
#include "pose/rig/yaml_section.h"

namespace tbm {
namespace {

void ReadRegisters(const YamlNode& node, ModbusRegisterMap* map) {
  if (!IsSection(node)) return;
  YamlSection section(node);
  section.Integer("function", 3, 4, &map->function);
  std::string format = "int16";
  if (section.Word("format", {"int16", "uint16", "int32", "float32"}, &format)) {
    map->format = format == "uint16"    ? RegisterFormat::kUint16
                  : format == "int32"   ? RegisterFormat::kInt32
                  : format == "float32" ? RegisterFormat::kFloat32
                                        : RegisterFormat::kInt16;
  }
  std::string order = "high_first";
  if (section.Word("word_order", {"high_first", "low_first"}, &order)) {
    map->word_order = order == "low_first" ? WordOrder::kLowFirst : WordOrder::kHighFirst;
  }
  section.Integer("beta_register", 0, 65535, &map->beta_register);
  section.Integer("gamma_register", 0, 65535, &map->gamma_register);
  section.Angle("deg_per_lsb", -90.0, 90.0, &map->rad_per_lsb);
  section.Integer("offset_lsb", 0, 65535, &map->offset_lsb);
  int temperature = -1;
  section.Integer("temperature_register", 0, 65535, &temperature);
  if (temperature >= 0) map->temperature_register = temperature;
  section.Number("celsius_per_lsb", 1e-6, 100.0, "degree C", &map->celsius_per_lsb);
  section.RefuseOthers();
}

}  // namespace

void ReadInclinometerSection(const YamlNode& node, InclinometerConfig* config) {
  if (!IsSection(node)) return;
  YamlSection section(node);
  std::string driver;
  section.Require("driver", "modbus, rion68, bewis77, sim or replay");
  if (section.Word("driver", {"modbus", "rion68", "bewis77", "sim", "replay"}, &driver) &&
      !driver.empty()) {
    config->driver = *InclinometerDriverFromWord(driver);
  }
  section.Text("port", &config->port.path);
  section.Integer("baud", 1200, 921600, &config->port.baud);
  std::string parity = "none";
  if (section.Word("parity", {"none", "even", "odd"}, &parity)) {
    config->port.parity = parity == "even"  ? Parity::kEven
                          : parity == "odd" ? Parity::kOdd
                                            : Parity::kNone;
  }
  section.Integer("stop_bits", 1, 2, &config->port.stop_bits);
  section.Integer("address", 0, 255, &config->address);
  section.Flag("automatic_output", &config->automatic_output);
  section.Integer("automatic_rate_code", 0, 255, &config->automatic_rate_code);
  section.Flag("swap_axes", &config->swap_axes);
  section.Time("poll_period_ms", 5.0, 10'000.0, &config->poll_period);
  section.Time("latency_ms", 0.0, 2000.0, &config->latency);
  section.Time("response_timeout_ms", 5.0, 10'000.0, &config->response_timeout);
  section.Time("byte_timeout_ms", 1.0, 1000.0, &config->byte_timeout);
  section.Time("quiet_time_ms", 0.0, 10'000.0, &config->quiet_time);
  section.Time("reconnect_period_ms", 10.0, 60'000.0, &config->reconnect_period);
  section.Time("silent_after_ms", 10.0, 60'000.0, &config->silent_after);
  section.Time("reopen_after_ms", 0.0, 600'000.0, &config->reopen_after);
  section.Time("frozen_after_ms", 0.0, 86'400'000.0, &config->frozen_after);
  section.Angle("range_deg", 0.01, 90.0, &config->range_rad);
  section.Angle("max_step_deg", 0.001, 90.0, &config->max_step_rad);
  section.Angle("sim_sigma_deg", 0.0, 1.0, &config->sim_sigma_rad);
  section.Angle("sim_resolution_deg", 0.0, 1.0, &config->sim_resolution_rad);
  ReadRegisters(section.Know("registers"), &config->registers);
  section.RefuseOthers();
  for (const ConfigFault& fault : FindFaults(*config)) {
    node.Optional(fault.key).Fault(fault.message);
  }
}

}  // namespace tbm
