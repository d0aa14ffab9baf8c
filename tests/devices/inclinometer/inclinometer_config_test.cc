#include "devices/inclinometer/inclinometer_config.h"

#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tbm {
namespace {

using namespace std::chrono_literals;
using testing::Contains;
using testing::ElementsAre;
using testing::Field;
using testing::IsEmpty;

InclinometerConfig Good(InclinometerDriver driver) {
  InclinometerConfig config;
  config.name = "target";
  config.driver = driver;
  config.port.path = "/dev/ttyS1";
  config.registers.rad_per_lsb = DegToRad(0.001);
  return config;
}

TEST(InclinometerConfig, DefaultsHaveNoFault) {
  for (const auto driver : {InclinometerDriver::kModbus,
                            InclinometerDriver::kRion68,
                            InclinometerDriver::kBewis77,
                            InclinometerDriver::kSim}) {
    EXPECT_THAT(FindFaults(Good(driver)), IsEmpty()) << WordOf(driver);
  }
}

TEST(InclinometerConfig, DriverWordsGoThereAndBack) {
  for (const auto word : {"modbus", "rion68", "bewis77", "sim", "replay"}) {
    const auto driver = InclinometerDriverFromWord(word);
    ASSERT_TRUE(driver) << word;
    EXPECT_EQ(WordOf(*driver), word);
  }
  EXPECT_FALSE(InclinometerDriverFromWord("Modbus"));
}

struct BadKey {
  std::string key;
  std::function<void(InclinometerConfig&)> spoil;
};

TEST(InclinometerConfig, NamesTheKeyOfEveryFault) {
  const std::vector<BadKey> cases = {
      {"port", [](auto& c) { c.port.path.clear(); }},
      {"baud", [](auto& c) { c.port.baud = 9601; }},
      {"baud", [](auto& c) { c.port.baud = 0; }},
      {"stop_bits", [](auto& c) { c.port.stop_bits = 3; }},
      {"address", [](auto& c) { c.address = 0; }},
      {"address", [](auto& c) { c.address = 248; }},
      {"automatic_output", [](auto& c) { c.automatic_output = true; }},
      {"automatic_rate_code", [](auto& c) { c.automatic_rate_code = 0; }},
      {"response_timeout_ms", [](auto& c) { c.response_timeout = 0ms; }},
      {"response_timeout_ms", [](auto& c) { c.port.baud = 1200; }},
      {"byte_timeout_ms", [](auto& c) { c.byte_timeout = 0ms; }},
      {"quiet_time_ms", [](auto& c) { c.quiet_time = 50ms; }},
      {"reconnect_period_ms", [](auto& c) { c.reconnect_period = 0ms; }},
      {"reopen_after_ms", [](auto& c) { c.reopen_after = -1ms; }},
      {"registers.function", [](auto& c) { c.registers.function = 6; }},
      {"registers.beta_register", [](auto& c) { c.registers.beta_register = -1; }},
      {"registers.gamma_register", [](auto& c) { c.registers.gamma_register = 0; }},
      {"registers.temperature_register", [](auto& c) { c.registers.temperature_register = 70000; }},
      {"registers", [](auto& c) { c.registers.gamma_register = 5000; }},
      {"registers.deg_per_lsb", [](auto& c) { c.registers.rad_per_lsb = 0.0; }},
      {"poll_period_ms", [](auto& c) { c.poll_period = 0ms; }},
      {"latency_ms", [](auto& c) { c.latency = -1ms; }},
      {"silent_after_ms", [](auto& c) { c.silent_after = 20ms; }},
      {"frozen_after_ms", [](auto& c) { c.frozen_after = -1ms; }},
      {"range_deg", [](auto& c) { c.range_rad = DegToRad(91.0); }},
      {"range_deg", [](auto& c) { c.range_rad = std::nan(""); }},
      {"max_step_deg", [](auto& c) { c.max_step_rad = -1.0; }},
      {"sim_sigma_deg", [](auto& c) { c.sim_sigma_rad = -1.0; }},
      {"sim_resolution_deg", [](auto& c) { c.sim_resolution_rad = -1.0; }},
  };
  for (const BadKey& bad : cases) {
    InclinometerConfig config = Good(InclinometerDriver::kModbus);
    bad.spoil(config);
    EXPECT_THAT(FindFaults(config), Contains(Field(&ConfigFault::key, bad.key))) << bad.key;
  }
}

TEST(InclinometerConfig, ReportsAllFaultsAtOnce) {
  InclinometerConfig config = Good(InclinometerDriver::kModbus);
  config.port.baud = 1;
  config.address = 500;
  config.range_rad = 0.0;
  EXPECT_GE(FindFaults(config).size(), 3u);
}

TEST(InclinometerConfig, TwoOnOneWireMustAgree) {
  InclinometerConfig a = Good(InclinometerDriver::kModbus);
  InclinometerConfig b = a;
  b.name = "camera";
  b.address = 2;
  EXPECT_THAT(FindSharingFaults(std::vector{a, b}), IsEmpty());

  const auto fault_keys = [&](const InclinometerConfig& second) {
    std::vector<std::string> keys;
    for (const ConfigFault& fault : FindSharingFaults(std::vector{a, second})) {
      keys.push_back(fault.key);
    }
    return keys;
  };
  InclinometerConfig same_address = b;
  same_address.address = a.address;
  EXPECT_THAT(fault_keys(same_address), ElementsAre("camera.address"));
  InclinometerConfig other_protocol = b;
  other_protocol.driver = InclinometerDriver::kRion68;
  EXPECT_THAT(fault_keys(other_protocol), ElementsAre("camera.driver"));
  InclinometerConfig other_baud = b;
  other_baud.port.baud = 19200;
  EXPECT_THAT(fault_keys(other_baud), ElementsAre("camera.baud"));
  InclinometerConfig talker = b;
  talker.automatic_output = true;
  EXPECT_THAT(fault_keys(talker), ElementsAre("camera.automatic_output"));
  InclinometerConfig elsewhere = same_address;
  elsewhere.port.path = "/dev/ttyS2";
  EXPECT_THAT(fault_keys(elsewhere), IsEmpty());
}

}  // namespace
}  // namespace tbm
