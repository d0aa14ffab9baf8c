#include "pose/rig/rig_file.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>

#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pose/base/angle.h"
#include "pose/rig/rig_text.h"

namespace tbm {
namespace {

using ::testing::HasSubstr;

const std::string kBadFolder = TBM_SOURCE_DIR "/tests/data/config_bad/";

std::string GoodText() {
  std::ifstream stream(kBadFolder + "rig_good.yaml");
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

struct BadFile {
  const char* name;
  int line;
  const char* key;
};

constexpr BadFile kBadFiles[] = {
    {"camera_missing", 1, "camera"},
    {"target_missing", 1, "target"},
    {"inclinometers_missing", 1, "inclinometers"},
    {"image_width_missing", 3, "camera.image_width"},
    {"image_width_zero", 3, "camera.image_width"},
    {"image_height_real", 4, "camera.image_height"},
    {"distortion_model_fisheye", 5, "camera.distortion_model"},
    {"camera_matrix_eight_numbers", 6, "camera.camera_matrix.data"},
    {"camera_matrix_column_major", 6, "camera.camera_matrix.data"},
    {"focal_length_negative", 6, "camera.camera_matrix.data[0]"},
    {"principal_point_outside", 6, "camera.camera_matrix.data[2]"},
    {"distortion_six_coefficients", 7, "camera.distortion_coefficients.data"},
    {"distortion_nan", 7, "camera.distortion_coefficients.data[0]"},
    {"distortion_folds_back", 7, "camera.distortion_coefficients"},
    {"residual_px_negative", 8, "camera.residual_px"},
    {"intrinsics_sigma_px_three_numbers", 9, "camera.intrinsics_sigma_px"},
    {"gain_zero", 10, "camera.gain_dn_per_electron"},
    {"read_noise_word", 11, "camera.read_noise_dn"},
    {"leds_two", 14, "target.leds"},
    {"leds_map", 13, "target.leds"},
    {"led_id_twice", 17, "target.leds[3].id"},
    {"led_id_with_comma", 17, "target.leds[3].id"},
    {"led_id_missing", 17, "target.leds[3].id"},
    {"led_xyz_missing", 17, "target.leds[3].xyz_mm"},
    {"led_xyz_two_numbers", 17, "target.leds[3].xyz_mm"},
    {"led_xyz_decimal_comma", 17, "target.leds[3].xyz_mm[0]"},
    {"led_xyz_too_far", 17, "target.leds[3].xyz_mm[1]"},
    {"led_sigma_negative", 17, "target.leds[3].sigma_mm"},
    {"leds_on_one_spot", 17, "target.leds[3]"},
    {"leds_on_one_line", 14, "target.leds"},
    {"rotation_missing", 21, "inclinometers.target.rotation"},
    {"rotation_not_orthogonal", 21, "inclinometers.target.rotation"},
    {"rotation_mirror", 21, "inclinometers.target.rotation"},
    {"sign_two", 22, "inclinometers.target.sign[1]"},
    {"sign_half", 22, "inclinometers.target.sign"},
    {"sigma_deg_missing", 26, "inclinometers.camera.sigma_deg"},
    {"sigma_deg_zero", 27, "inclinometers.camera.sigma_deg"},
    {"mounting_sigma_deg_infinite", 24, "inclinometers.target.mounting_sigma_deg"},
    {"points_list", 29, "points"},
    {"point_name_with_blank", 29, "points.shield head"},
    {"point_xyz_missing", 29, "points.shield_head.xyz_mm"},
    {"points_seventeen", 29, "points"},
    {"key_twice", 9, "camera.residual_px"},
    {"not_yaml", 3, ""},
    {"not_a_map", 1, ""},
    {"empty", 0, ""},
};

TEST(RigFile, ReadsEveryValueInSiUnits) {
  const auto loaded = LoadRigFile(kBadFolder + "rig_good.yaml");
  ASSERT_TRUE(loaded.has_value());
  EXPECT_TRUE(loaded->warnings.empty());
  const Rig& rig = loaded->rig;
  EXPECT_EQ(rig.name, "bench");
  EXPECT_EQ(rig.camera.image_width_px, 1280);
  EXPECT_EQ(rig.camera.image_height_px, 1024);
  EXPECT_EQ(rig.camera.fx_px, 3018.9);
  EXPECT_EQ(rig.camera.fy_px, 3017.2);
  EXPECT_EQ(rig.camera.cx_px, 640.1);
  EXPECT_EQ(rig.camera.cy_px, 511.3);
  EXPECT_EQ(rig.camera.k1, -0.09);
  EXPECT_EQ(rig.camera.k2, 0.14);
  EXPECT_EQ(rig.camera.p1, 0.0002);
  EXPECT_EQ(rig.camera.p2, -0.0001);
  EXPECT_EQ(rig.camera.k3, 0.0);
  EXPECT_EQ(rig.calibration_residual_px, 0.08);
  EXPECT_EQ(rig.intrinsics_sigma_px, Eigen::Vector4d(0.45, 0.45, 0.6, 0.6));
  EXPECT_EQ(rig.gain_dn_per_electron, 0.025);
  EXPECT_EQ(rig.read_noise_dn, 1.2);
  ASSERT_EQ(rig.leds.size(), 5u);
  EXPECT_EQ(rig.leds[4].id, "P5");
  EXPECT_LT((rig.leds[4].p_led_in_target - Eigen::Vector3d(0.08, 0.08, 0.25)).norm(), 1e-15);
  EXPECT_DOUBLE_EQ(rig.leds[4].sigma_m, 0.05e-3);
  EXPECT_NEAR(rig.target_tilt.tilt_from_body(1, 2), -1.0, 1e-12);
  EXPECT_NEAR(rig.target_tilt.tilt_from_body(2, 1), 1.0, 1e-12);
  EXPECT_NEAR(rig.camera_tilt.tilt_from_body(1, 2), 1.0, 1e-12);
  EXPECT_EQ(rig.target_tilt.sign, (std::array<double, 2>{1.0, -1.0}));
  EXPECT_EQ(rig.camera_tilt.sign, (std::array<double, 2>{1.0, 1.0}));
  EXPECT_EQ(rig.target_tilt.sigma_rad, DegToRad(0.005));
  EXPECT_EQ(rig.camera_tilt.sigma_rad, DegToRad(0.006));
  EXPECT_EQ(rig.target_tilt.mounting_sigma_rad, DegToRad(0.004));
  EXPECT_EQ(rig.camera_tilt.mounting_sigma_rad, 0.0);
  ASSERT_EQ(rig.points.size(), 1u);
  EXPECT_EQ(rig.points[0].name, "shield_head");
  EXPECT_LT((rig.points[0].p_point_in_target - Eigen::Vector3d(0.003, -0.005, -1.6)).norm(), 1e-15);
  EXPECT_DOUBLE_EQ(rig.points[0].sigma_m, 0.2e-3);
}

TEST(RigFile, EachBadFileNamesItsLineAndKey) {
  for (const BadFile& bad : kBadFiles) {
    SCOPED_TRACE(bad.name);
    const std::string path = kBadFolder + "rig/" + bad.name + ".yaml";
    const auto loaded = LoadRigFile(path);
    ASSERT_FALSE(loaded.has_value());
    ASSERT_FALSE(loaded.error().empty());
    const RigFileFault& fault = loaded.error().front();
    EXPECT_EQ(fault.line, bad.line);
    EXPECT_EQ(fault.key, bad.key);
    EXPECT_EQ(fault.file, path);
    EXPECT_THAT(fault.Text(), HasSubstr(fault.key));
    EXPECT_GT(fault.what.size(), 15u) << "says what would be right: " << fault.what;
  }
}

TEST(RigFile, EveryBadFileIsInTheList) {
  std::set<std::string> listed;
  for (const BadFile& bad : kBadFiles) listed.insert(std::string(bad.name) + ".yaml");
  std::set<std::string> present;
  for (const auto& entry : std::filesystem::directory_iterator(kBadFolder + "rig")) {
    present.insert(entry.path().filename().string());
  }
  EXPECT_EQ(listed, present);
}

TEST(RigFile, CollectsAllFaultsAtOnce) {
  std::string text = Replaced(GoodText(), "image_width: 1280", "image_width: many");
  text = Replaced(text, "id: P2", "id: P1");
  text = Replaced(text, "sigma_deg: 0.006", "sigma_deg: -1");
  text = Replaced(text, "[3.0, -5.0, -1600.0]", "[3.0, -5.0]");
  const auto loaded = ParseRig(text, "rig.yaml");
  ASSERT_FALSE(loaded.has_value());
  std::vector<std::string> keys;
  for (const RigFileFault& fault : loaded.error()) keys.push_back(fault.key);
  EXPECT_THAT(keys,
              ::testing::ElementsAre("camera.image_width",
                                     "target.leds[1].id",
                                     "inclinometers.camera.sigma_deg",
                                     "points.shield_head.xyz_mm"));
}

TEST(RigFile, WarnsOfKeysThatNobodyReads) {
  const auto loaded =
      ParseRig(Replaced(GoodText(), "mounting_sigma_deg", "mounting_sigma_dg"), "rig.yaml");
  ASSERT_TRUE(loaded.has_value());
  ASSERT_EQ(loaded->warnings.size(), 1u);
  EXPECT_EQ(loaded->warnings[0].key, "inclinometers.target.mounting_sigma_dg");
  EXPECT_EQ(loaded->warnings[0].line, 24);
  EXPECT_THAT(loaded->warnings[0].what, HasSubstr("mounting_sigma_deg"));
}

TEST(RigFile, TakesARosCameraInfoWithAllItsKeys) {
  const auto loaded = ParseRig(
      Replaced(
          GoodText(),
          "  residual_px",
          "  camera_name: front\n"
          "  rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}\n"
          "  projection_matrix: {rows: 3, cols: 4, data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]}\n"
          "  residual_px"),
      "rig.yaml");
  ASSERT_TRUE(loaded.has_value());
  EXPECT_TRUE(loaded->warnings.empty());
}

TEST(RigFile, TakesAnOpenCvMatrixAndFourCoefficients) {
  std::string text = Replaced(GoodText(), "  distortion_model: plumb_bob\n", "");
  text = Replaced(
      text,
      "distortion_coefficients: {rows: 1, cols: 5, data: [-0.09, 0.14, 0.0002, -0.0001, 0.0]}",
      "distortion_coefficients: !!opencv-matrix\n"
      "    rows: 4\n    cols: 1\n    dt: d\n"
      "    data: [ -9.0000000000000002e-02, 1.4e-01, 2.e-04, -1.e-04 ]");
  const auto loaded = ParseRig(text, "rig.yaml");
  ASSERT_TRUE(loaded.has_value());
  EXPECT_EQ(loaded->rig.camera.k1, -0.09);
  EXPECT_EQ(loaded->rig.camera.p2, -0.0001);
  EXPECT_EQ(loaded->rig.camera.k3, 0.0);
}

TEST(RigFile, MakesAnExactRotationOfARoundedOne) {
  const auto loaded = ParseRig(Replaced(GoodText(),
                                        "[1, 0, 0, 0, 0, -1, 0, 1, 0]",
                                        "[0.9998, -0.0175, 0, 0, 0, -1, 0.0175, 0.9998, 0]"),
                               "rig.yaml");
  ASSERT_TRUE(loaded.has_value());
  const Eigen::Matrix3d r = loaded->rig.target_tilt.tilt_from_body;
  EXPECT_LT((r * r.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_NEAR(r.determinant(), 1.0, 1e-15);
  EXPECT_NEAR(r(0, 1), -0.0175, 1e-4);
}

TEST(RigFile, SaysWhichFileIsMissing) {
  const auto loaded = LoadRigFile("/nowhere/rig.yaml");
  ASSERT_FALSE(loaded.has_value());
  EXPECT_THAT(loaded.error()[0].Text(), HasSubstr("/nowhere/rig.yaml"));
}

TEST(RigText, WhatIsWrittenIsReadBack) {
  const auto loaded = ParseRig(GoodText(), "rig.yaml");
  ASSERT_TRUE(loaded.has_value());
  Rig rig = loaded->rig;
  rig.name = "north \"tube\": #1\n\\";
  rig.camera.k3 = -1.234567890123456e-7;
  rig.intrinsics_sigma_px[2] = 1.0 / 3.0;
  rig.leds[0].p_led_in_target.x() += 1.23e-6;
  rig.camera_tilt.mounting_sigma_rad = DegToRad(0.012);
  rig.points.push_back({"null", {0.001, 0.002, 0.003}, 0.0});
  const std::string text = RigYaml(rig);
  const auto again = ParseRig(text, "again.yaml");
  ASSERT_TRUE(again.has_value()) << again.error()[0].Text() << "\n" << text;
  EXPECT_TRUE(again->warnings.empty());
  const Rig& got = again->rig;
  EXPECT_EQ(got.name, rig.name);
  EXPECT_EQ(got.camera.image_height_px, 1024);
  EXPECT_EQ(got.camera.fx_px, rig.camera.fx_px);
  EXPECT_EQ(got.camera.cy_px, rig.camera.cy_px);
  EXPECT_EQ(got.camera.p2, rig.camera.p2);
  EXPECT_EQ(got.camera.k3, rig.camera.k3);
  EXPECT_EQ(got.calibration_residual_px, rig.calibration_residual_px);
  EXPECT_LT((got.intrinsics_sigma_px - rig.intrinsics_sigma_px).norm(), 1e-9);
  EXPECT_EQ(got.gain_dn_per_electron, rig.gain_dn_per_electron);
  EXPECT_EQ(got.read_noise_dn, rig.read_noise_dn);
  ASSERT_EQ(got.leds.size(), rig.leds.size());
  for (std::size_t i = 0; i < rig.leds.size(); ++i) {
    EXPECT_EQ(got.leds[i].id, rig.leds[i].id);
    EXPECT_LT((got.leds[i].p_led_in_target - rig.leds[i].p_led_in_target).norm(), 1e-7);
    EXPECT_NEAR(got.leds[i].sigma_m, rig.leds[i].sigma_m, 1e-7);
  }
  for (const auto mount : {&Rig::target_tilt, &Rig::camera_tilt}) {
    EXPECT_LT(((got.*mount).tilt_from_body - (rig.*mount).tilt_from_body).cwiseAbs().maxCoeff(),
              1e-9);
    EXPECT_EQ((got.*mount).sign, (rig.*mount).sign);
    EXPECT_NEAR((got.*mount).sigma_rad, (rig.*mount).sigma_rad, 1e-12);
    EXPECT_NEAR((got.*mount).mounting_sigma_rad, (rig.*mount).mounting_sigma_rad, 1e-12);
  }
  ASSERT_EQ(got.points.size(), 2u);
  EXPECT_EQ(got.points[1].name, "null");
  EXPECT_NEAR(got.points[0].sigma_m, 0.2e-3, 1e-12);
  // Written again it is the same text.
  EXPECT_EQ(RigYaml(got), text);
}

// What a broken transfer leaves must never bring the reader down; that most of it is refused is
// checked above, one fault at a time.
TEST(RigFile, SurvivesCutFlippedAndGluedText) {
  const std::string good = GoodText();
  for (std::size_t size = 0; size < good.size(); size += 7) {
    (void)ParseRig(good.substr(0, size), "cut").has_value();
    EXPECT_FALSE(ParseRig(good.substr(0, size) + std::string(1, '\0') + good, "zero").has_value());
  }
  for (std::size_t at = 0; at < good.size(); at += 11) {
    std::string flipped = good;
    flipped[at] = static_cast<char>(flipped[at] ^ (1 << (at % 8)));
    (void)ParseRig(flipped, "flipped").has_value();
  }
  EXPECT_FALSE(ParseRig(good + good, "glued").has_value());
  EXPECT_FALSE(ParseRig("\x01\x02 garbage: [" + good, "garbage").has_value());
  EXPECT_FALSE(ParseRig(std::string(50'000, '['), "deep").has_value());
  EXPECT_FALSE(ParseRig("camera: &a [*a, *a]\n", "alias").has_value());
}

}  // namespace
}  // namespace tbm
