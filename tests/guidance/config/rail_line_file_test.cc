#include "guidance/config/rail_line_file.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tbm {
namespace {

using ::testing::HasSubstr;

TEST(RailLineConfigs, EveryFaultNamesFileLineKeyAndWhatIsRight) {
  const std::string good =
      "machine_id: trolley-1\nruns: runs\nlines: lines\nreplay: {run: played}\n";
  ASSERT_TRUE(ParseRailLineConfig(good, "rail_line.yaml"));
  const std::string devices =
      "machine_id: trolley-1\nruns: runs\nlines: lines\ndevices:\n  setup: trolley\n";
  ASSERT_TRUE(
      ParseRailLineConfig(devices + "  imu: {model: stim300, port: p}\n", "rail_line.yaml"));
  struct Case {
    std::string text;
    std::string key;
    std::string right;
  };
  const std::vector<Case> cases = {
      {"runs: r\nlines: l\nreplay: {run: p}\n", "machine_id", "tbm-7"},
      {"machine_id: t\nlines: l\nreplay: {run: p}\n", "runs", "folder for what is measured"},
      {"machine_id: t\nruns: r\nreplay: {run: p}\n", "lines", "folder for the finished lines"},
      {"machine_id: t\nruns: r\nlines: l\n", "needs either", "recorded run"},
      {"machine_id: t\nruns: r\nlines: l\nreplay: {speed: 1}\n", "replay.run", "rail.yaml"},
      {"machine_id: t\nruns: r\nlines: l\nreplay: {run: p, speed: 0}\n", "replay.speed", "0.1"},
      {"machine_id: " + std::string(33, 'x') + "\nruns: r\nlines: l\nreplay: {run: p}\n",
       "machine_id",
       "1 to 32 characters"},
      {good + "lag_ms: -1\n", "lag_ms", "10000"},
      {good + "imu_silent_after_ms: 5\n", "imu_silent_after_ms", "20"},
      {good + "publish: {step_m: 0}\n", "publish.step_m", "0.001"},
      {good + "publish: {hold_s: -1}\n", "publish.hold_s", "0"},
      {good + "settlement: {level: 0.9}\n", "settlement.base", "line.csv"},
      {good + "settlement: {base: b, level: 1}\n", "settlement.level", "0.9999"},
      {good + "settlement: {base: b, alert_mm: 3}\n", "settlement.alert_mm", "[1, 3, 5]"},
      {good + "settlement: {base: b, alert_mm: [3, 1]}\n", "settlement.alert_mm", "sizes grow"},
      {good + "settlement: {base: b, alert_mm: [1, 2, 3, 4]}\n", "alert_mm", "three"},
      {good + "calibration: {date: 2026-02-30}\n", "calibration.date", "2026-10-31"},
      {good + "calibration: {date: yesterday}\n", "calibration.date", "2026-10-31"},
      {good + "calibration: {due_after_days: 0}\n", "calibration.due_after_days", "36500"},
      {good + "lag: 1\n", "lag", "nobody reads this key"},
      {good + "devices: {}\n", "needs either", "instruments"},
      {devices + "  imu: {port: /dev/ttyS0}\n", "devices.imu.model", "stim300"},
      {devices + "  imu: {model: stim202, port: /dev/ttyS0}\n",
       "devices.imu.model",
       "must be stim300, which has accelerometers; stim210 and stim202 have gyros alone"},
      {devices + "  imu: {model: stim300}\n", "devices.imu.port", "/dev/ttyUSB0"},
      {devices + "  imu: {model: stim300, port: p, sample_rate_hz: 300}\n",
       "devices.imu.sample_rate_hz",
       "125, 250, 500"},
      {devices + "  imu: {model: stim300, port: p, accel_output: both}\n",
       "devices.imu.accel_output",
       "increment"},
      {devices + "  imu: {model: stim300, port: p}\n  inclinometer: {driver: sim}\n",
       "devices.inclinometer.driver",
       "rion68"},
      {devices + "  imu: {model: stim300, port: p}\n  target_pixels: yes\n",
       "devices.target_pixels",
       "frame_features"},
      {"[1]\n", "", "rail_line.yaml"},
  };
  for (const Case& one : cases) {
    const auto config = ParseRailLineConfig(one.text, "my.yaml");
    ASSERT_FALSE(config) << one.text;
    const std::string text = config.error().front().Text();
    EXPECT_THAT(text, HasSubstr("my.yaml:")) << one.text;
    EXPECT_THAT(text, HasSubstr(one.key)) << one.text;
    EXPECT_THAT(text, HasSubstr(one.right)) << one.text;
  }
}

TEST(RailLineConfigs, TheExampleIsGoodAndPathsAreBesideIt) {
  const auto config = LoadRailLineConfig(TBM_SOURCE_DIR "/guidance/app/example/rail_line.yaml");
  ASSERT_TRUE(config) << config.error().front().Text();
  EXPECT_THAT(config->runs_folder, testing::EndsWith("guidance/app/example/rail_runs"));
  EXPECT_EQ(config->replay->speed, 1.0);
  EXPECT_EQ(config->lag_s, RailLineConfig{}.lag_s);
  EXPECT_EQ(config->hold_s, RailLineConfig{}.hold_s);
}

}  // namespace
}  // namespace tbm
