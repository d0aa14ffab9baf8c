// What the station's process reads: its configuration, a table of references, its own state.

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/app/reference_table.h"
#include "devices/app/station_config.h"
#include "devices/app/station_state_file.h"
#include "pose/base/angle.h"
#include "tests/support/random.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using namespace std::chrono_literals;
using test::ReadText;
using test::WriteText;
using testing::HasSubstr;

const std::string kExample = TBM_SOURCE_DIR "/devices/app/example/total_station.yaml";
const std::string kReferences = TBM_SOURCE_DIR "/guidance/app/example/references.csv";

// The example beside its table of references, as tools/run lays them out.
class StationFiles : public testing::Test {
 protected:
  StationFiles() {
    WriteText(folder_ / "references.csv", ReadText(kReferences));
    good_ = ReadText(kExample);
  }
  Result<StationConfig, RigFileFaults> Parse(const std::string& yaml) const {
    return ParseStationConfig(yaml, folder_ / "total_station.yaml");
  }
  static std::string Joined(const RigFileFaults& faults) {
    std::string text;
    for (const RigFileFault& fault : faults) text += fault.Text() + "\n";
    return text;
  }
  test::TempFolder folder_;
  std::string good_;
};

TEST_F(StationFiles, ExampleIsReadIntoSiUnits) {
  const auto config = Parse(good_);
  ASSERT_TRUE(config) << Joined(config.error());
  EXPECT_EQ(config->machine_file, folder_ / "machine.yaml");
  EXPECT_EQ(config->state_file, folder_ / "station.state");
  EXPECT_EQ(config->station, "TS-1");
  EXPECT_EQ(config->instrument.tcp_port, 1212);
  const KeeperOptions& keeper = config->keeper;
  ASSERT_EQ(keeper.references.size(), 6u);
  EXPECT_EQ(keeper.references[0].name, "R1");
  EXPECT_NEAR(keeper.references[0].reference.sigma_m, 0.001, 1e-15);
  EXPECT_FALSE(keeper.references[0].is_control);
  EXPECT_TRUE(keeper.references[5].is_control);
  EXPECT_NEAR(keeper.start.circle_zero_bearing_rad, DegToRad(123.4), 1e-12);
  EXPECT_NEAR(keeper.angle_sigma_rad, DegToRad(1.0 / 3600), 1e-15);
  EXPECT_NEAR(keeper.closure_tolerance_m, 0.005, 1e-15);
  EXPECT_EQ(keeper.check_period, 10min);
  EXPECT_EQ(keeper.control_max_age, 12h);
  ASSERT_TRUE(keeper.shield_start);
  // Heading 40 degrees: more north than east, nose down by 0.86 degrees.
  const Eigen::Vector3d ahead = keeper.shield_start->rotation * Eigen::Vector3d::UnitX();
  EXPECT_NEAR(ahead.x(), std::sin(DegToRad(40)) * std::cos(DegToRad(0.86)), 1e-9);
  EXPECT_NEAR(ahead.y(), std::cos(DegToRad(40)) * std::cos(DegToRad(0.86)), 1e-9);
  EXPECT_NEAR(ahead.z(), -std::sin(DegToRad(0.86)), 1e-9);
  EXPECT_FALSE(keeper.known[0]);
}

// The example promises that what it shows is what one gets without the key.
TEST_F(StationFiles, ExampleShowsTheDefaults) {
  const auto shown = Parse(good_);
  const auto bare = Parse(
      "machine: machine.yaml\nstate_file: station.state\ninstrument: {driver: geocom_tcp}\n"
      "start: {xyz_m: [1, 2, 3], circle_zero_deg: 1}\nreferences_file: references.csv\n");
  ASSERT_TRUE(shown);
  ASSERT_TRUE(bare) << Joined(bare.error());
  const KeeperOptions& a = shown->keeper;
  const KeeperOptions& b = bare->keeper;
  EXPECT_NEAR(a.angle_sigma_rad, b.angle_sigma_rad, 2e-7);
  EXPECT_EQ(a.slope_sigma_m, b.slope_sigma_m);
  EXPECT_EQ(a.slope_sigma_ppm, b.slope_sigma_ppm);
  EXPECT_NEAR(a.largest_axis_error_rad, b.largest_axis_error_rad, 5e-6);
  EXPECT_EQ(a.start_within_m, b.start_within_m);
  EXPECT_NEAR(a.start_within_rad, b.start_within_rad, 1e-3);
  EXPECT_NEAR(a.window.horizontal_rad, b.window.horizontal_rad, 3e-3);
  EXPECT_NEAR(a.window.vertical_rad, b.window.vertical_rad, 1e-3);
  EXPECT_EQ(a.cycle_period, b.cycle_period);
  EXPECT_EQ(a.check_period, b.check_period);
  EXPECT_EQ(a.doubt_period, b.doubt_period);
  EXPECT_EQ(a.retry_period, b.retry_period);
  EXPECT_EQ(a.checks_in_two_faces, b.checks_in_two_faces);
  EXPECT_EQ(a.closure_tolerance_m, b.closure_tolerance_m);
  EXPECT_EQ(a.control_max_age, b.control_max_age);
  EXPECT_EQ(a.must_see_m, b.must_see_m);
  EXPECT_EQ(a.gross_m, b.gross_m);
  EXPECT_EQ(a.set_up.worst_sigma_m, b.set_up.worst_sigma_m);
  EXPECT_NEAR(a.set_up.worst_sigma_rad, b.set_up.worst_sigma_rad, 2e-6);
  EXPECT_EQ(a.set_up.sight.refraction_k, b.set_up.sight.refraction_k);
  EXPECT_EQ(a.set_up.sight.earth_radius_m, b.set_up.sight.earth_radius_m);
  EXPECT_EQ(a.watch.floor_m, b.watch.floor_m);
  EXPECT_EQ(a.watch.unknown_speed_sigma_m_per_s, b.watch.unknown_speed_sigma_m_per_s);
  EXPECT_EQ(shown->distance.air.temperature_celsius, bare->distance.air.temperature_celsius);
  EXPECT_EQ(shown->instrument.motion_timeout, bare->instrument.motion_timeout);
  EXPECT_EQ(shown->silent_after, bare->silent_after);
  EXPECT_EQ(shown->low_power_percent, bare->low_power_percent);
  EXPECT_EQ(shown->missed_rounds, bare->missed_rounds);
  EXPECT_EQ(shown->dds.domain, bare->dds.domain);
}

struct BadConfig {
  const char* from;
  const char* to;
  const char* says;
};

constexpr BadConfig kBadConfigs[] = {
    {"machine: machine.yaml", "", "machine: missing; path of the machine file"},
    {"station: TS-1", "station: \"\"", "station: must have 1 to 32 characters"},
    {"state_file: station.state", "", "state_file: missing; where the set-up is kept"},
    {"driver: geocom_tcp", "driver: leica", "instrument.driver: 'leica' is not one of geocom_tcp"},
    {"  driver: geocom_tcp", "  nothing: 1", "instrument.driver: missing; geocom_tcp or"},
    {"address: 127.0.0.1",
     "address: station.local",
     "instrument.address: \"station.local\": wanted an IP"},
    {"tcp_port: 1212", "tcp_port: 70000", "instrument.tcp_port: '70000' must be an integer of 1"},
    {"checksum: auto", "checksum: yes", "'yes' is not one of auto, on, off"},
    {"measure_timeout_ms: 15000", "measure_timeout_ms: 1000", "measure_timeout_ms"},
    {"slope_sigma_mm: 1.0", "slope_sigma_mm: nan", "accuracy.slope_sigma_mm"},
    {"angle_sigma_arcsec: 1.0",
     "angle_sigma_arcsec: 0",
     "accuracy.angle_sigma_arcsec: 0 is outside; allowed is 0.05"},
    {"pressure_hpa: 1013.25", "pressure_hpa: 101325", "distance.pressure_hpa: 101325 is outside"},
    {"refraction_k: 0.13", "refraction: 0.13", "distance.refraction: nobody reads this key"},
    {"circle_zero_deg: 123.4", "circle_zero_rad: 2.1", "start.circle_zero_deg: missing"},
    {"xyz_m: [1017.8, 5017.7, 101.6]",
     "xyz_m: [1017.8, 5017.7]",
     "start.xyz_m: must be a list of 3 numbers"},
    {"heading_deg: 40",
     "heading_deg: north",
     "rear_shield_start.heading_deg: 'north' is not a number"},
    {"references_file: references.csv", "", "wanted either references (a list"},
    {"references_file: references.csv", "references_file: nowhere.csv", "references_file: "},
    {"references_file: references.csv", "references: 5", "references: must be a list"},
    {"references_file: references.csv",
     "references: []",
     "references: 0 references; wanted 1 .. 16"},
    {"references_file: references.csv",
     "references: [{name: R1, xyz_m: [1, 2, 3], sigma_mm: 1}]",
     "references: a free station needs two references"},
    {"references_file: references.csv",
     "references: [{name: R1, xyz_m: [1, 2, 3], sigma_mm: 1}, {name: R1, xyz_m: [9, 2, 3], "
     "sigma_mm: 1}]",
     "'R1' names two references; names must differ"},
    {"references_file: references.csv",
     "references: [{name: R1, xyz_m: [1, 2, 3]}, {name: R2, xyz_m: [9, 2, 3], sigma_mm: 1}]",
     "references[0].sigma_mm: missing"},
    {"references_file: references.csv",
     "references: [{name: R1, xyz_m: [1, 2, 3], sigma_mm: 1, controll: true}]",
     "references[0].controll: nobody reads this key"},
    {"check_period_s: 600",
     "check_period_s: 1",
     "schedule.check_period_s: 1 is outside; allowed is 5"},
    {"closure_mm: 5 ",
     "closure_mm: -5 ",
     "tolerances.closure_mm: -5 is outside; allowed is 0.1 .. 100 mm"},
    {"missed_rounds: 3",
     "missed_rounds: 0",
     "tolerances.missed_rounds: '0' must be an integer of 1"},
    {"domain: 25", "domain: 300", "dds.domain: '300' must be an integer of 0 .. 232"},
    {"machine: machine.yaml", "machine: [", "not YAML"},
    {"schedule:", "shedule:", "shedule: nobody reads this key; known here:"},
};

TEST_F(StationFiles, EveryFaultNamesFileLineKeyAndWhatIsRight) {
  for (const BadConfig& bad : kBadConfigs) {
    std::string text = good_;
    const std::size_t at = text.find(bad.from);
    ASSERT_NE(at, std::string::npos) << bad.from;
    text.replace(at, std::string(bad.from).size(), bad.to);
    const auto config = Parse(text);
    ASSERT_FALSE(config) << bad.to;
    EXPECT_THAT(Joined(config.error()), HasSubstr(bad.says)) << bad.to;
    EXPECT_THAT(config.error()[0].Text(), testing::ContainsRegex("total_station.yaml:[0-9]+: "))
        << bad.to;
  }
  // All at once, the second with its own line.
  std::string text = good_;
  text.replace(text.find("domain: 25"), 10, "domain: -1");
  text.replace(text.find("closure_mm: 5"), 13, "closure_mm: 0");
  const auto config = Parse(text);
  ASSERT_FALSE(config);
  EXPECT_EQ(config.error().size(), 2u);
  EXPECT_NE(config.error()[0].line, config.error()[1].line);
}

TEST_F(StationFiles, NoTextMakesTheLoaderStumble) {
  for (std::size_t size = 0; size < good_.size(); size += 13) (void)Parse(good_.substr(0, size));
  test::Random random("station_config_flips");
  for (int i = 0; i < 300; ++i) {
    std::string text = good_;
    for (int k = 0; k < 3; ++k) {
      auto& byte = text[static_cast<std::size_t>(random.Index(static_cast<int>(text.size())))];
      byte = static_cast<char>(byte ^ (1 << random.Index(8)));
    }
    const auto config = Parse(text);
    if (!config) {
      EXPECT_FALSE(config.error().empty());
    }
  }
  (void)Parse(good_ + good_);
}

TEST_F(StationFiles, ATableOfReferencesNamesItsFaults) {
  const std::string head = "name,x_m,y_m,z_m,sigma_mm,prism_constant_mm,control\n";
  const struct {
    std::string text;
    const char* says;
  } cases[] = {
      {"name,x_m,y_m,z_m\nR1,1,2,3\n", "sigma_mm"},
      {head + "R1,1,2,3,1,0,0\nR2,1,zwei,3,1,0,0\n", ":3: column y_m"},
      {head + "R1,1,2,inf,1,0,0\n", ":2: column z_m"},
      {head + "R1,1,2,3,-1,0,0\n", ":2: column sigma_mm"},
      {head + "R1,1,2,3,1,0,2\n", ":2: column control"},
      {head + "R1,1,2\n", ":2:"},
      {"", "references.csv"},
  };
  for (const auto& one : cases) {
    WriteText(folder_ / "references.csv", one.text);
    const auto rows = ReadReferenceTable(folder_ / "references.csv");
    ASSERT_FALSE(rows) << one.text;
    EXPECT_THAT(rows.error(), HasSubstr(one.says)) << one.text;
    EXPECT_THAT(rows.error(), HasSubstr("references.csv")) << one.text;
  }
  WriteText(folder_ / "references.csv", head + "R1,1,2,3,1.5,17.5,1\n");
  const auto rows = ReadReferenceTable(folder_ / "references.csv");
  ASSERT_TRUE(rows) << rows.error();
  EXPECT_TRUE((*rows)[0].is_control);
  EXPECT_NEAR((*rows)[0].constant_m, 0.0175, 1e-15);
}

KeptSetUp SomeSetUp(test::Random& random, std::uint64_t number) {
  KeptSetUp kept;
  kept.number = number;
  kept.station = {random.Normal3(1e3), random.Uniform(0, 6)};
  kept.covariance = Eigen::Vector4d(1e-7, 2e-7, 3e-7, 1e-11).asDiagonal();
  kept.axis_errors = {random.Normal(1e-5), random.Normal(1e-5)};
  kept.axis_sigma_rad = 1e-6;
  kept.set_up_at = {1'790'000'000'000'000'001};
  kept.last_good_check_at = {1'790'000'100'000'000'003};
  kept.chi2 = random.Unit();
  kept.dof = 7;
  if (number % 2 == 0) kept.sees_m = 0.002;
  kept.instrument = 3512345;
  for (int i = 0; i < 3; ++i) {
    KeptReference row{"Ref " + std::to_string(i), i != 1, i == 1 ? "moved" : "", {}};
    if (i != 2) {
      row.residual = SightingResidual{i, 1e-6, -2e-6, {}, 1e-4, 2e-4, 0.6, 1.2};
      if (i == 0) row.residual->slope_m = -1e-3;
    }
    kept.references.push_back(row);
    ReferenceSighting sighting{i, {random.Unit(), random.Unit(), {}}, {1e-6, 2e-6, 1e-3}};
    if (i != 1) sighting.reading.slope_m = random.Uniform(10, 100);
    kept.sightings.push_back(sighting);
  }
  return kept;
}

KeptStation SomeStation() {
  test::Random random("kept_station");
  KeptStation kept;
  kept.last_number = 12;
  kept.in_use = SomeSetUp(random, 12);
  kept.previous = SomeSetUp(random, 11);
  kept.controls = {{"left", {1'790'000'000'000'000'000}, {1.25, -2.5, 1.0 / 3.0}}};
  return kept;
}

TEST(StationState, ReadsBackToTheBit) {
  const KeptStation kept = SomeStation();
  const std::string text = TextOf(kept);
  const auto again = ParseKeptStation(text, "f");
  ASSERT_TRUE(again) << again.error();
  EXPECT_EQ(TextOf(*again), text);
  EXPECT_EQ(again->in_use->station.p_axes_in_site, kept.in_use->station.p_axes_in_site);
  EXPECT_EQ(again->in_use->covariance, kept.in_use->covariance);
  EXPECT_EQ(again->in_use->references[1].reason, "moved");
  EXPECT_FALSE(again->in_use->references[2].residual);
  EXPECT_FALSE(again->previous->sees_m);
  EXPECT_FALSE(again->in_use->sightings[1].reading.slope_m);
  EXPECT_EQ(again->in_use->sightings[2].reading.slope_m, kept.in_use->sightings[2].reading.slope_m);
  EXPECT_EQ(again->controls[0].p_in_site, kept.controls[0].p_in_site);
  const auto empty = ParseKeptStation(TextOf({}), "f");
  ASSERT_TRUE(empty);
  EXPECT_FALSE(empty->in_use);
}

TEST(StationState, AnyChangedByteIsNoticed) {
  const std::string text = TextOf(SomeStation());
  for (std::size_t i = 0; i < text.size(); ++i) {
    std::string changed = text;
    changed[i] = static_cast<char>(changed[i] ^ (1 << (i % 8)));
    EXPECT_FALSE(ParseKeptStation(changed, "f")) << i;
  }
  EXPECT_FALSE(ParseKeptStation(text + text, "f"));
  EXPECT_FALSE(ParseKeptStation(text + "\n", "f"));
  EXPECT_FALSE(ParseKeptStation("", "f"));
}

// A checksum that fits, because somebody has edited the file with it: what stands in it must make
// sense all the same.
TEST(StationState, SaysWhichLineMakesNoSense) {
  const auto sealed = [](std::string text) {
    text.resize(text.rfind("crc32\t"));
    std::uint32_t crc = 0xffffffffu;  // as in the file's own words: CRC-32
    for (const char byte : text) {
      crc ^= static_cast<unsigned char>(byte);
      for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1u) != 0 ? 0xedb88320u : 0u);
    }
    char line[32];
    std::snprintf(line, sizeof line, "crc32\t%08x\n", ~crc);
    return text + line;
  };
  const std::string text = TextOf(SomeStation());
  ASSERT_TRUE(ParseKeptStation(sealed(text), "f"));
  const struct {
    const char* from;
    const char* to;
    const char* says;
  } cases[] = {
      {"tbm_station\t1", "tbm_station\t2", "f:1: not the state of a total station"},
      {"last_number\t12", "last_number\t-1", "f:2: wanted last_number"},
      {"last_number\t12", "last_number\t3", "a set-up's number is beyond last_number"},
      {"set_up\tin_use\t12", "set_up\tin_use\t0", "f:3: wanted set_up"},
      {"station_m_rad\t", "station_m_rad\tnan\t", "f:4: wanted station_m_rad"},
      {"covariance\t1e-07", "covariance\t-1e-07", "f:5: the covariance is none"},
      {"times_ns\t1", "times_ns\t-1", "wanted times_ns"},
      {"fit\t", "fit\t-", "wanted fit"},
      {"reference\tRef 0", "reference\t", "a reference's name"},
      {"residual\t", "residual\tx\t", "wanted residual"},
      {"sighting\t0\t", "sighting\t9\t", "wanted sighting, a reference above"},
      {"control\tleft\t", "control\tleft\t0\t", "nobody knows this line"},
  };
  for (const auto& one : cases) {
    std::string changed = text;
    const std::size_t at = changed.find(one.from);
    ASSERT_NE(at, std::string::npos) << one.from;
    changed.replace(at, std::string(one.from).size(), one.to);
    const auto kept = ParseKeptStation(sealed(changed), "f");
    ASSERT_FALSE(kept) << one.to;
    EXPECT_THAT(kept.error(), HasSubstr(one.says)) << one.to;
  }
}

}  // namespace
}  // namespace tbm
