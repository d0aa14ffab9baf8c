#include "pose/app/box_config.h"

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pose/base/angle.h"

namespace tbm {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;

const std::string kExample = TBM_SOURCE_DIR "/pose/app/example/camera_box.yaml";
const std::string kBadFolder = TBM_SOURCE_DIR "/tests/data/config_bad/camera_box/";

std::string TextOf(const std::string& path) {
  std::ifstream stream(path);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

std::string Joined(const RigFileFaults& faults) {
  std::string text;
  for (const RigFileFault& fault : faults) text += fault.Text() + "\n";
  return text;
}

TEST(BoxConfig, ExampleIsReadIntoSiUnits) {
  const auto config = LoadBoxConfig(kExample);
  ASSERT_TRUE(config) << Joined(config.error());
  EXPECT_EQ(config->machine_id, "TBM-1");
  EXPECT_EQ(config->rig_file, TBM_SOURCE_DIR "/pose/app/example/rig.yaml");
  EXPECT_EQ(config->camera.driver, CameraDriver::kGige);
  EXPECT_EQ(config->camera.address, "127.0.0.1");
  EXPECT_FALSE(config->camera.packet_socket);
  EXPECT_EQ(config->target_inclinometer.driver, InclinometerDriver::kModbus);
  EXPECT_EQ(config->target_inclinometer.poll_period, milliseconds(20));
  EXPECT_EQ(config->target_inclinometer.address, 1);
  EXPECT_EQ(config->camera_inclinometer.address, 2);
  EXPECT_NEAR(config->target_inclinometer.registers.rad_per_lsb, DegToRad(0.0001), 1e-18);
  EXPECT_NEAR(config->target_inclinometer.range_rad, DegToRad(30.0), 1e-15);
  EXPECT_EQ(config->solver.tilt.max_age, milliseconds(100));
  EXPECT_EQ(config->tilt_wait, milliseconds(60));
  EXPECT_NEAR(config->solver.motion_sigma_m_per_s, 0.4, 1e-12);
  EXPECT_THAT(config->dds.interfaces, ::testing::ElementsAre("127.0.0.1"));
  EXPECT_TRUE(config->recording.folder.empty());
  EXPECT_EQ(config->recording.limit_bytes, 2'000'000'000);
}

// The example promises that what it shows is what one gets without the key.
TEST(BoxConfig, ExampleShowsTheDefaults) {
  const auto shown = LoadBoxConfig(kExample);
  const auto bare = ParseBoxConfig(
      "machine_id: TBM-1\nrig: rig.yaml\ncamera: {driver: gige, address: 127.0.0.1}\n"
      "inclinometers:\n  target: {driver: sim}\n  camera: {driver: sim}\n",
      "bare.yaml");
  ASSERT_TRUE(shown);
  ASSERT_TRUE(bare) << Joined(bare.error());
  EXPECT_EQ(shown->camera.socket_buffer_bytes, bare->camera.socket_buffer_bytes);
  EXPECT_EQ(shown->camera.frame_rate_hz, bare->camera.frame_rate_hz);
  EXPECT_EQ(shown->camera.exposure_us, bare->camera.exposure_us);
  EXPECT_EQ(shown->camera.exposure_min_us, bare->camera.exposure_min_us);
  EXPECT_EQ(shown->camera.exposure_max_us, bare->camera.exposure_max_us);
  EXPECT_EQ(shown->camera.packet_resend, bare->camera.packet_resend);
  EXPECT_EQ(shown->camera.stamp_event, bare->camera.stamp_event);
  EXPECT_EQ(shown->target_inclinometer.quiet_time, bare->target_inclinometer.quiet_time);
  EXPECT_EQ(shown->target_inclinometer.silent_after, bare->target_inclinometer.silent_after);
  EXPECT_EQ(shown->solver.tilt.max_age, bare->solver.tilt.max_age);
  EXPECT_EQ(shown->solver.prior_max_age, bare->solver.prior_max_age);
  EXPECT_EQ(shown->tilt_wait, bare->tilt_wait);
  EXPECT_EQ(shown->dds.domain, bare->dds.domain);
  EXPECT_EQ(shown->dds.interfaces, bare->dds.interfaces);
  EXPECT_EQ(shown->recording.run_length, bare->recording.run_length);
  EXPECT_EQ(shown->recording.limit_bytes, bare->recording.limit_bytes);
}

struct BadFile {
  const char* name;
  const char* says;
};

constexpr BadFile kBadFiles[] = {
    {"machine_id_missing", "machine_id: missing; the machine's name"},
    {"machine_id_too_long", "machine_id: must have 1 to 32 characters"},
    {"rig_missing", "rig: missing"},
    {"camera_missing", "camera: missing"},
    {"camera_driver_missing", "camera.driver: missing"},
    {"camera_driver_unknown", "camera.driver: 'usb' is not one of gige, sim, replay"},
    {"camera_address_name", "camera.address"},
    {"camera_key_mistyped", "camera.frame_rate: nobody reads this key"},
    {"frame_rate_word", "camera.frame_rate_hz"},
    {"frame_rate_zero", "camera.frame_rate_hz: 0 is outside; allowed is 0.1 .. 200 Hz"},
    {"exposure_min_above_max", "camera.exposure_max_us: 50000: wanted 60000"},
    {"packet_socket_word", "camera.packet_socket: 'no' is not one of true, false"},
    {"pixel_format_unknown", "'rgb8' is not one of mono8, mono12, mono16"},
    {"inclinometers_list", "inclinometers: must be a map"},
    {"inclinometer_camera_missing", "inclinometers.camera: missing"},
    {"inclinometer_driver_unknown", "inclinometers.target.driver: 'acme' is not one of modbus"},
    {"inclinometer_port_missing", "port"},
    {"inclinometer_baud_odd", "baud"},
    {"inclinometer_poll_period_nan", "inclinometers.target.poll_period_ms"},
    {"inclinometer_quiet_time_negative", "inclinometers.target.quiet_time_ms"},
    {"inclinometer_same_address", "address"},
    {"registers_format_unknown", "registers.format: 'int24' is not one of"},
    {"registers_function_six", "registers.function: '6' must be an integer of 3 .. 4"},
    {"registers_scale_missing", "inclinometers.target"},
    {"tilt_wait_too_long", "solver.tilt_wait_ms: 60000 is outside; allowed is 0 .. 1000 ms"},
    {"domain_too_large", "dds.domain: '300' must be an integer of 0 .. 232"},
    {"interface_mask", "'127.0.0.0/8' is not an IPv4 address"},
    {"interfaces_empty", "interfaces: empty"},
    {"interfaces_text", "dds.interfaces: must be a list"},
    {"recording_limit_small", "recording.limit_mb: 1 is outside; allowed is 10"},
    {"recording_list", "recording: must be a map of keys"},
    {"top_key_unknown", "solvers: nobody reads this key"},
    {"not_yaml", "not YAML"},
    {"empty", "the file must be a map"},
};

TEST(BoxConfig, EveryBadFileIsRefusedInWords) {
  std::set<std::string> tested;
  for (const BadFile& bad : kBadFiles) {
    const std::string path = kBadFolder + bad.name + ".yaml";
    const auto config = LoadBoxConfig(path);
    ASSERT_FALSE(config) << bad.name;
    EXPECT_THAT(Joined(config.error()), HasSubstr(bad.says)) << bad.name;
    EXPECT_THAT(config.error()[0].Text(), HasSubstr(std::string(bad.name) + ".yaml")) << bad.name;
    tested.insert(std::string(bad.name) + ".yaml");
  }
  for (const auto& entry : std::filesystem::directory_iterator(kBadFolder)) {
    EXPECT_EQ(tested.count(entry.path().filename()), 1u) << entry.path();
  }
}

TEST(BoxConfig, FaultsNameTheLine) {
  const auto config = LoadBoxConfig(kBadFolder + "frame_rate_zero.yaml");
  ASSERT_FALSE(config);
  std::istringstream lines(TextOf(kBadFolder + "frame_rate_zero.yaml"));
  std::string line;
  int number = 0;
  while (std::getline(lines, line)) {
    ++number;
    if (line.find("frame_rate_hz") != std::string::npos) break;
  }
  EXPECT_EQ(config.error()[0].line, number);
}

TEST(BoxConfig, AllFaultsComeAtOnce) {
  std::string text = TextOf(kExample);
  for (const auto& [from, to] : {std::pair{"frame_rate_hz: 10", "frame_rate_hz: -3"},
                                 std::pair{"domain: 25", "domain: 999"},
                                 std::pair{"limit_mb: 2000", "limit_mb: much"}}) {
    text.replace(text.find(from), std::string(from).size(), to);
  }
  const auto config = ParseBoxConfig(text, "three.yaml");
  ASSERT_FALSE(config);
  EXPECT_EQ(config.error().size(), 3u) << Joined(config.error());
}

TEST(BoxConfig, MissingFileSaysSo) {
  const auto config = LoadBoxConfig("/nowhere/camera_box.yaml");
  ASSERT_FALSE(config);
  EXPECT_THAT(Joined(config.error()), HasSubstr("cannot be read"));
}

// Cut anywhere, a config is refused or read; nothing else may happen.
TEST(BoxConfig, SurvivesBeingCutAnywhere) {
  const std::string text = TextOf(kExample);
  int refused = 0;
  for (std::size_t size = 0; size < text.size(); size += 7) {
    if (!ParseBoxConfig(text.substr(0, size), "cut.yaml")) ++refused;
  }
  EXPECT_GT(refused, 100);
}

}  // namespace
}  // namespace tbm
