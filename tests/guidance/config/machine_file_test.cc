#include "guidance/config/machine_file.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/replay/csv.h"
#include "guidance/axis/design_axis.h"
#include "pose/base/angle.h"
#include "pose/geometry/rigid3.h"

namespace tbm {
namespace {

using ::testing::HasSubstr;

const std::string kExample = TBM_SOURCE_DIR "/guidance/app/example/machine.yaml";

std::string ExampleText() { return *ReadTextFile(kExample); }

std::string Joined(const RigFileFaults& faults) {
  std::string text;
  for (const RigFileFault& fault : faults) text += fault.Text() + "\n";
  return text;
}

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  if (at != std::string::npos) text.replace(at, from.size(), to);
  return text;
}

TEST(MachineFile, ExampleIsReadIntoSiUnits) {
  const auto file = LoadMachineFile(kExample);
  ASSERT_TRUE(file) << Joined(file.error());
  const Machine& machine = file->machine;
  EXPECT_EQ(machine.machine_id, "TBM-1");
  EXPECT_EQ(file->rig_file, TBM_SOURCE_DIR "/guidance/app/example/rig.yaml");
  EXPECT_EQ(file->axis_file, TBM_SOURCE_DIR "/guidance/app/example/axis.xml");
  EXPECT_EQ(file->sha256.size(), 64u);

  const UncertainRigid3& camera = machine.geometry.rear_shield_from_camera;
  EXPECT_LT((camera.b_from_a.translation - Eigen::Vector3d(-1.5, 1.1, 1.6)).norm(), 1e-12);
  EXPECT_LT((camera.b_from_a.rotation * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitX()).norm(),
            1e-12)
      << "the camera looks forward";
  EXPECT_LT((camera.b_from_a.rotation * Eigen::Vector3d::UnitY() + Eigen::Vector3d::UnitZ()).norm(),
            1e-12)
      << "its image is upright";
  EXPECT_NEAR(camera.covariance(0, 0), std::pow(DegToRad(0.003), 2), 1e-18);
  EXPECT_NEAR(camera.covariance(5, 5), 9e-8, 1e-15);
  EXPECT_EQ(camera.covariance(0, 5), 0.0);
  const Rigid3& target = machine.geometry.front_shield_from_target.b_from_a;
  EXPECT_LT((target.rotation * Eigen::Vector3d::UnitZ() + Eigen::Vector3d::UnitX()).norm(), 1e-12)
      << "the board looks back";

  ASSERT_EQ(machine.prisms.size(), 4u);
  EXPECT_EQ(machine.prisms[2].name, "RS3");
  EXPECT_LT((machine.prisms[2].prism.p_in_rear_shield - Eigen::Vector3d(-0.9, 1.0, 2.5)).norm(),
            1e-12);
  EXPECT_NEAR(machine.prisms[2].prism.sigma_m, 3e-4, 1e-15);
  ASSERT_EQ(machine.points.size(), 5u);
  EXPECT_EQ(machine.points[0].name, "cutter_face");
  EXPECT_EQ(machine.points[0].shield, ShieldName::kFront);
  EXPECT_NEAR(machine.points[0].p_in_shield.x() - target.translation.x(), 5.0, 1e-12);
  EXPECT_EQ(machine.points[4].shield, ShieldName::kRear);
  EXPECT_EQ(machine.steer_by, 0u);
  ASSERT_TRUE(machine.rings.has_value());
  EXPECT_EQ(machine.rings->first_number, 1);
  EXPECT_EQ(machine.rings->first_chainage_m, 2000.0);
  EXPECT_EQ(machine.rings->length_m, 1.5);
  EXPECT_EQ(machine.closed_joint_m, 5.9);
}

// The axis that the example names is there, is in order, and holds the whole simulated drive.
TEST(MachineFile, ExampleAxisIsInOrder) {
  const auto file = LoadMachineFile(kExample);
  ASSERT_TRUE(file);
  const auto loaded = LoadAxisFile(file->axis_file, file->axis_options);
  ASSERT_TRUE(loaded);
  EXPECT_TRUE(Inspect(loaded->description).empty());
  const auto axis = DesignAxis::Build(loaded->description);
  ASSERT_TRUE(axis);
  EXPECT_EQ(axis->start().m, 2000.0);
  EXPECT_NEAR(axis->end().m, 2600.0, 1e-6);
  EXPECT_EQ(axis->equations().section_count(), 2);
  EXPECT_TRUE(axis->At({2300.0})->up_m.has_value());
}

void ExpectSame(const AlarmLimit& a, const AlarmLimit& b) {
  EXPECT_NEAR(a.raise_above, b.raise_above, 1e-12);
  EXPECT_NEAR(a.clear_below, b.clear_below, 1e-12);
}

// The example promises that what it shows is what one gets without the key.
TEST(MachineFile, ExampleShowsTheDefaults) {
  const auto file = LoadMachineFile(kExample);
  ASSERT_TRUE(file);
  const Machine& shown = file->machine;
  const Machine bare;
  EXPECT_EQ(shown.station.period_s, bare.station.period_s);
  EXPECT_EQ(shown.station.stale_after_s, bare.station.stale_after_s);
  EXPECT_EQ(shown.camera.period_s, bare.camera.period_s);
  EXPECT_EQ(shown.camera.stale_after_s, bare.camera.stale_after_s);
  EXPECT_EQ(shown.tilt.period_s, bare.tilt.period_s);
  EXPECT_EQ(shown.tilt.stale_after_s, bare.tilt.stale_after_s);
  EXPECT_EQ(shown.fix_window_s, bare.fix_window_s);
  EXPECT_NEAR(shown.useful_sigma_m, bare.useful_sigma_m, 1e-12);
  EXPECT_NEAR(shown.coast.along_m_per_s, bare.coast.along_m_per_s, 1e-12);
  EXPECT_NEAR(shown.coast.across_m_per_s, bare.coast.across_m_per_s, 1e-12);
  EXPECT_NEAR(shown.coast.turn_rad_per_s, bare.coast.turn_rad_per_s, 1e-12);
  EXPECT_EQ(shown.trend_length_m, bare.trend_length_m);
  EXPECT_NEAR(shown.track.steering_per_sqrt_m, bare.track.steering_per_sqrt_m, 1e-12);
  EXPECT_NEAR(shown.track.crab_sigma_per_m, bare.track.crab_sigma_per_m, 1e-12);
  EXPECT_NEAR(shown.track.start_slope_sigma, bare.track.start_slope_sigma, 1e-12);
  EXPECT_NEAR(shown.track.least_step_m, bare.track.least_step_m, 1e-12);
  EXPECT_NEAR(shown.track.back_m, bare.track.back_m, 1e-12);
  ExpectSame(shown.deviation_m, bare.deviation_m);
  ExpectSame(shown.predicted_deviation_m, bare.predicted_deviation_m);
  ExpectSame(shown.roll_rad, bare.roll_rad);
  ExpectSame(shown.sigma_m, bare.sigma_m);
}

TEST(MachineFile, OptionalKeysGoTheirOwnWay) {
  std::string text = ExampleText();
  text = Replaced(text, "site_origin_m: [0, 0, 0]", "site_origin_m: [1000, 5000, 100]");
  text = Replaced(text, "alignment: \"\"", "alignment: main");
  text = Replaced(text, "profile: \"\"", "profile: gradient");
  text = Replaced(text, "along_mm_per_min: 60", "along_mm_per_min: 120");
  text = Replaced(text, "turn_mm_per_m_per_min: 0.048", "turn_mm_per_m_per_min: 0.6");
  text = Replaced(text, "raise_above_mm_per_m: 17.5", "raise_above_mm_per_m: 20");
  text = Replaced(text, "steer_by: cutter_face", "steer_by: articulation");
  text = Replaced(text, "useful_sigma_mm: 25", "useful_sigma_mm: 40");
  const auto file = ParseMachineFile(text, "folder/machine.yaml");
  ASSERT_TRUE(file) << Joined(file.error());
  EXPECT_EQ(file->axis_file, "folder/axis.xml");
  EXPECT_EQ(file->axis_options.site_origin, Eigen::Vector3d(1000.0, 5000.0, 100.0));
  EXPECT_EQ(file->axis_options.alignment, "main");
  EXPECT_EQ(file->axis_options.profile, "gradient");
  EXPECT_NEAR(file->machine.coast.along_m_per_s, 0.002, 1e-15);
  EXPECT_NEAR(file->machine.coast.turn_rad_per_s, 1e-5, 1e-18);
  EXPECT_NEAR(file->machine.roll_rad.raise_above, 0.020, 1e-15);
  EXPECT_EQ(file->machine.steer_by, 2u);
  EXPECT_NEAR(file->machine.useful_sigma_m, 0.040, 1e-15);

  text = Replaced(
      ExampleText(), "rings: {first_number: 1, first_chainage_m: 2000.0, length_mm: 1500}", "");
  text = Replaced(text, "closed_joint_mm: 5900", "");
  const auto bare = ParseMachineFile(text, "machine.yaml");
  ASSERT_TRUE(bare) << Joined(bare.error());
  EXPECT_FALSE(bare->machine.rings.has_value());
  EXPECT_FALSE(bare->machine.closed_joint_m.has_value());
  EXPECT_NE(bare->sha256, file->sha256);
}

TEST(MachineFile, RotationRoundedInTheSeventhDecimalBecomesARotation) {
  const auto file = ParseMachineFile(Replaced(ExampleText(),
                                              "rotation: [0, 0, 1, -1, 0, 0, 0, -1, 0]",
                                              "rotation: [0.0348995, 0, 0.9993908, -0.9993908, 0, "
                                              "0.0348995, 0, -1, 0]"),
                                     "machine.yaml");
  ASSERT_TRUE(file) << Joined(file.error());
  const Eigen::Quaterniond& q = file->machine.geometry.rear_shield_from_camera.b_from_a.rotation;
  EXPECT_NEAR(q.norm(), 1.0, 1e-15);
  const Eigen::Vector3d forward = q * Eigen::Vector3d::UnitZ();
  EXPECT_NEAR(std::atan2(forward.y(), forward.x()), DegToRad(2.0), 2e-7);
}

struct BadCase {
  const char* from;
  const char* to;
  const char* says;
};

const BadCase kBadCases[] = {
    {"machine_id: TBM-1", "machine: TBM-1", "machine_id: missing; the machine's name"},
    {"machine_id: TBM-1", "machine: TBM-1", "machine: nobody reads this key"},
    {"TBM-1", "TBM-1-in-the-long-tunnel-of-the-north", "machine_id: must have 1 to 32 characters"},
    {"rig: rig.yaml", "", "rig: missing; path of the rig file"},
    {"rig: rig.yaml", "rig: \"\"", "rig: is empty"},
    {"rig: rig.yaml", "rig: [a]", "rig: must be a plain word"},
    {"file: axis.xml", "path: axis.xml", "axis.file: missing"},
    {"file: axis.xml", "file: \"\"", "axis.file: is empty"},
    {"alignment: \"\"", "alignment: [a]", "axis.alignment: must be a plain word"},
    {"profile: \"\"", "profile: {a: b}", "axis.profile: must be a plain word"},
    {"[0, 0, 0]   #", "[0, 0]   #", "axis.site_origin_m: must be a list of 3 numbers, has 2"},
    {"[0, 0, 0]   #", "[0, .nan, 0]   #", "axis.site_origin_m[1]: '.nan' is not a number"},
    {"built_in:", "builtin:", "built_in: missing; a map with rear_shield_from_camera"},
    {"  rear_shield_from_camera:", "  rear_from_camera:", "rear_shield_from_camera: missing"},
    {"  front_shield_from_target:", "  other:", "front_shield_from_target: missing"},
    {"xyz_mm: [-1500.0, 1100.0, 1600.0]",
     "xyz_m: [-1.5, 1.1, 1.6]",
     "built_in.rear_shield_from_camera.xyz_mm: missing; [x, y, z] in rear_shield"},
    {"[-4200.0, 1100.0, 1600.0]",
     "[-4200000.0, 1100.0, 1600.0]",
     "built_in.front_shield_from_target.xyz_mm[0]: -4200000 is outside; allowed is -50000 .. 50000 "
     "mm"},
    {"rotation: [0, 0, 1, -1, 0, 0, 0, -1, 0]",
     "rotation: [0, 0, 1, -1, 0, 0, 0, -1]",
     "rear_shield_from_camera.rotation: must be a list of 9 numbers, has 8"},
    {"rotation: [0, 0, 1, -1, 0, 0, 0, -1, 0]",
     "rotation: [0, 0, 0.9999, -1, 0, 0, 0, -1, 0]",
     "rear_shield_from_camera.rotation: is not a rotation: its rows are off unit length or right "
     "angles by 0.0002; allowed is 0 .. 1e-06"},
    {"rotation: [0, 0, 1, -1, 0, 0, 0, -1, 0]",
     "rotation: [0, 0, 1, -1, 0, 0, 0, 1, 0]",
     "rear_shield_from_camera.rotation: is a mirror image"},
    {"rotation: [0, 0, 1, -1, 0, 0, 0, -1, 0]", "", "rear_shield_from_camera.rotation: missing"},
    {"sigma_deg: 0.003", "sigma_deg: -1", "sigma_deg: -1 is outside; allowed is 0 .. 10 degree"},
    {"sigma_mm: 0.3\n    sigma_deg",
     "sigma_m: 0.0003\n    sigma_deg",
     "built_in.rear_shield_from_camera.sigma_m: nobody reads this key"},
    {"sigma_mm: 0.3\n    sigma_deg",
     "sigma_mm: 2000\n    sigma_deg",
     "rear_shield_from_camera.sigma_mm: 2000 is outside"},
    {"prisms:", "prism:", "prisms: missing; a map"},
    {"RS1: {", "left prism: {", "a name must be 1 to 16 letters, digits"},
    {"RS1: {", "RS1_behind_the_tank: {", "a name must be 1 to 16 letters, digits"},
    {"RS2: {", "RS1: {", "prisms.RS1: stands here for the second time"},
    {"xyz_mm: [-4200.0, -2200.0, 600.0]",
     "xyz_mm: [-4200.0, 2210.0, 620.0]",
     "prisms.RS2: is less than 50 mm from RS1"},
    {"xyz_mm: [-4200.0, -2200.0, 600.0]", "xyz_mm: 3", "prisms.RS2.xyz_mm: must be a list of 3"},
    {"{xyz_mm: [-4200.0, -2200.0, 600.0], sigma_mm: 0.3}", "", "prisms.RS2: is empty"},
    {"{xyz_mm: [-4200.0, -2200.0, 600.0], sigma_mm: 0.3}", "4", "prisms.RS2: must be a map"},
    {"600.0], sigma_mm: 0.3}", "600.0], sigma: 0.3}", "prisms.RS1.sigma: nobody reads this key"},
    {"points:", "point:", "points: missing; a map"},
    {"cutter_face: {shield: front,",
     "cutter_face: {shield: middle,",
     "points.cutter_face.shield: 'middle' is not one of front, rear"},
    {"cutter_face: {shield: front,", "cutter_face: {", "points.cutter_face.shield: missing"},
    {"xyz_mm: [800.0, 0.0, 0.0]", "xyz_mm: [800.0, a, 0.0]", "'a' is not a number"},
    {"[800.0, 0.0, 0.0], sigma_mm: 0.2",
     "[800.0, 0.0, 0.0], sigma_mm: x",
     "points.cutter_face.sigma_mm: 'x' is not a number"},
    {"steer_by: cutter_face", "", "steer_by: missing; the name of a point on the front shield"},
    {"steer_by: cutter_face",
     "steer_by: tail",
     "steer_by: 'tail' is no point on the front shield; there: cutter_face, front, articulation"},
    {"first_number: 1", "first_number: 1.5", "rings.first_number: '1.5' must be an integer"},
    {"first_number: 1, ", "", "rings.first_number: missing"},
    {"first_chainage_m: 2000.0, ", "", "rings.first_chainage_m: missing"},
    {"length_mm: 1500",
     "length_mm: 1.5",
     "rings.length_mm: 1.5 is outside; allowed is 100 .. 5000"},
    {"length_mm: 1500", "length_m: 1.5", "rings.length_mm: missing"},
    {"closed_joint_mm: 5900", "closed_joint_mm: wide", "closed_joint_mm: 'wide' is not a number"},
    {"station: {period_s: 30,", "station: {period_ms: 30,", "sources.station.period_ms: nobody"},
    {"period_s: 30,", "period_s: 0,", "sources.station.period_s: 0 is outside"},
    {"stale_after_s: 900", "stale_after_s: -5", "sources.station.stale_after_s: -5 is outside"},
    {"stale_after_s: 900",
     "stale_after_s: 45",
     "sources.station: stale_after_s 45 must be at least twice period_s 30"},
    {"camera: {period_s: 0.5, stale_after_s: 120}",
     "camera: fast",
     "sources.camera: must be a map"},
    {"tilt: {period_s: 0.5", "tilt: {period_s: x", "sources.tilt.period_s: 'x' is not a number"},
    {"fix_window_s: 60", "fix_window_s: 0", "sources.fix_window_s: 0 is outside"},
    {"useful_sigma_mm: 25", "useful_sigma_mm: 0", "trust.useful_sigma_mm: 0 is outside"},
    {"along_mm_per_min: 60", "along_mm_per_min: -60", "trust.coast.along_mm_per_min: -60"},
    {"across_mm_per_min: 1.2", "across_mm_per_min: a", "trust.coast.across_mm_per_min: 'a'"},
    {"turn_mm_per_m_per_min: 0.048",
     "turn_mm_per_m_per_min: 101",
     "trust.coast.turn_mm_per_m_per_min: 101 is outside"},
    {"length_m: 5", "length_m: 0.1", "trend.length_m: 0.1 is outside"},
    {"steering_mm_per_m: 1", "steering_mm_per_m: 0", "trend.steering_mm_per_m: 0 is outside"},
    {"crab_mm_per_m: 3", "crab_mm_per_m: 0", "trend.crab_mm_per_m: 0 is outside"},
    {"start_slope_mm_per_m: 20", "start_slope_mm_per_m: 0", "trend.start_slope_mm_per_m: 0 is"},
    {"least_step_mm: 20", "least_step_mm: 0", "trend.least_step_mm: 0 is outside"},
    {"back_mm: 500", "back_mm: 0", "trend.back_mm: 0 is outside"},
    {"{raise_above_mm: 50, clear_below_mm: 45}",
     "{raise_above_mm: 45, clear_below_mm: 50}",
     "alarms.deviation: clear_below_mm 50 must not be above raise_above_mm 45"},
    {"raise_above_mm: 80", "raise_above_mm: 0", "alarms.predicted_deviation.raise_above_mm: 0 is"},
    {"clear_below_mm: 70", "clear_below_mm: a", "alarms.predicted_deviation.clear_below_mm: 'a'"},
    {"raise_above_mm_per_m: 17.5",
     "raise_above_deg: 1",
     "alarms.roll.raise_above_deg: nobody reads this key; known here: clear_below_mm_per_m"},
    {"raise_above_mm: 15",
     "raise_above_mm: .inf",
     "alarms.sigma.raise_above_mm: '.inf' is not a number"},
    {"alarms:", "alarm:", "alarm: nobody reads this key"},
    {"trend:", "- trend:", "not YAML"},
};

TEST(MachineFile, EachFaultNamesItsKeyAndWhatWouldBeRight) {
  const std::string good = ExampleText();
  for (const BadCase& bad : kBadCases) {
    const auto file = ParseMachineFile(Replaced(good, bad.from, bad.to), "machine.yaml");
    ASSERT_FALSE(file) << bad.from << " -> " << bad.to;
    EXPECT_THAT(Joined(file.error()), HasSubstr(bad.says)) << bad.from << " -> " << bad.to;
    for (const RigFileFault& fault : file.error()) EXPECT_GT(fault.line, 0) << fault.Text();
  }
}

TEST(MachineFile, FaultsNameTheirLineAndAllAreCollected) {
  std::string text = Replaced(ExampleText(), "closed_joint_mm: 5900", "closed_joint_mm: wide");
  text = Replaced(text, "fix_window_s: 60", "fix_window_s: 0");
  text = Replaced(text, "steer_by: cutter_face", "steer_by: nose");
  const auto file = ParseMachineFile(text, "machine.yaml");
  ASSERT_FALSE(file);
  ASSERT_EQ(file.error().size(), 3u) << Joined(file.error());
  const auto line =
      std::count(text.begin(), text.begin() + text.find("closed_joint_mm: wide"), '\n');
  EXPECT_THAT(Joined(file.error()),
              HasSubstr("machine.yaml:" + std::to_string(line + 1) + ": closed_joint_mm: "));
}

TEST(MachineFile, CountsArePartOfTheRules) {
  std::string many;
  for (int i = 0; i < 5; ++i)
    many += "  more" + std::to_string(i) + ": {xyz_mm: [0, 0, " + std::to_string(100 * i) +
            "], sigma_mm: 0.3}\n";
  const auto prisms =
      ParseMachineFile(Replaced(ExampleText(), "prisms:\n", "prisms:\n" + many), "machine.yaml");
  ASSERT_FALSE(prisms);
  EXPECT_THAT(Joined(prisms.error()), HasSubstr("prisms: has 9 prisms; allowed is 1 .. 8"));
  many.clear();
  for (int i = 0; i < 12; ++i) {
    many += "  more" + std::to_string(i) + ": {shield: rear, xyz_mm: [0, 0, 0]}\n";
  }
  const auto points =
      ParseMachineFile(Replaced(ExampleText(), "points:\n", "points:\n" + many), "machine.yaml");
  ASSERT_FALSE(points);
  EXPECT_THAT(Joined(points.error()), HasSubstr("points: has 17 points; allowed is 1 .. 16"));
}

TEST(MachineFile, WhatCannotBeReadOrIsNoMapIsRefusedInWords) {
  const auto none = LoadMachineFile("/nowhere/machine.yaml");
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error()[0].Text(), HasSubstr("cannot be read; give the path of a machine.yaml"));
  for (const char* text : {"", "[1, 2]", "word", "\xff\xfe", ": :"}) {
    const auto file = ParseMachineFile(text, "machine.yaml");
    ASSERT_FALSE(file) << text;
    EXPECT_THAT(file.error()[0].Text(), HasSubstr("machine.yaml"));
  }
}

TEST(MachineFile, SurvivesCutFlippedAndGluedText) {
  const std::string good = ExampleText();
  for (std::size_t size = 0; size < good.size(); size += 23) {
    const auto cut = ParseMachineFile(good.substr(0, size), "machine.yaml");
    EXPECT_TRUE(cut || !cut.error().empty());
  }
  for (std::size_t at = 0; at < good.size(); at += 11) {
    std::string flipped = good;
    flipped[at] = static_cast<char>(flipped[at] ^ (1 << (at / 11 % 8)));
    const auto read = ParseMachineFile(flipped, "machine.yaml");
    EXPECT_TRUE(read || !read.error().empty());
  }
  EXPECT_FALSE(ParseMachineFile(good + good, "machine.yaml")) << "every key stands twice";
  EXPECT_FALSE(ParseMachineFile("}\n" + good, "machine.yaml"));
}

}  // namespace
}  // namespace tbm
