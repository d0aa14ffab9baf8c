#include <cmath>
#include <filesystem>
#include <functional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "guidance/app/calibrate_command.h"
#include "guidance/app/target_input.h"
#include "guidance/config/calibration_parts.h"
#include "pose/base/angle.h"
#include "pose/rig/rig_file.h"
#include "pose/rig/rig_text.h"
#include "tests/support/command.h"
#include "tests/support/random.h"
#include "tests/support/scene.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using test::Ran;
using test::Random;
using test::ReadText;
using test::Rows;
using test::TempFolder;
using test::WriteText;
using ::testing::AllOf;
using ::testing::HasSubstr;

const std::string kDrawing =
    "led,x_mm,y_mm,z_mm\nP1,-250,0,100\nP2,250,0,100\nP3,0,250,0\nP4,0,-250,0\nP5,80,80,250\n";

void Replace(std::string* text, const std::string& from, const std::string& to) {
  const std::size_t at = text->find(from);
  ASSERT_NE(at, std::string::npos) << from;
  text->replace(at, from.size(), to);
}

TEST(CalibrationBytes, CutFlippedAndGluedTablesAndPartsAreRefusedOrReadAsTheyStand) {
  const auto leds = ParseLedDrawing(kDrawing, "d.csv");
  ASSERT_TRUE(leds);
  const std::string csv =
      "stamp_ns,point,x_mm,y_mm,z_mm\n,P1,1,2,3\n,P2,100.5,2,3\n,P1,1.1,2,3\n,R,1,1,1\n";
  const std::string gsi =
      "*110001+00000000000000P1 81..46+0000000045128358 82..46+0000000120808102 "
      "83..46+0000000004089988 \r\n";
  std::string part = RigYaml(test::FieldRig());
  part += "calibrated: {covariance: [1, 2], camera: {image_width: 640, camera_matrix: {}}}\n";
  const auto faults_are_said = [](const auto& result) {
    if (result) return;
    EXPECT_FALSE(result.error().empty());
    for (const auto& fault : result.error()) EXPECT_GT(fault.Text().size(), 10u);
  };
  const auto read = [&](const std::string& text) {
    faults_are_said(ParseLedDrawing(text, "d.csv"));
    const auto points = ParsePlacement(text, "p.csv", *leds, 5.0);
    faults_are_said(points);
    if (points) {
      for (const auto& led : points->led_in_site_m) EXPECT_TRUE(!led || led->allFinite());
    }
    faults_are_said(ParseCameraPart(text, "c.yaml"));
    faults_are_said(ParseTiltPart(text, "t.yaml"));
    faults_are_said(ParseTargetPart(text, "t.yaml"));
    faults_are_said(ParsePointsPart(text, "p.yaml"));
    faults_are_said(ParseLeds(text, "l.yaml"));
  };
  Random random("calibration bytes");
  for (const std::string& whole : {kDrawing, csv, gsi, part}) {
    const std::size_t step = whole.size() > 500 ? 29 : 3;
    for (std::size_t length = 0; length <= whole.size(); length += step) {
      read(whole.substr(0, length));
    }
    for (int i = 0; i < 150; ++i) {
      std::string text = whole;
      const auto at = static_cast<std::size_t>(random.Index(static_cast<int>(text.size())));
      text[at] = static_cast<char>(text[at] ^ (1 << random.Index(8)));
      read(text);
    }
    read(whole + whole);
  }
}

// The four files that a rig is put together from.
class CalibrateRig : public ::testing::Test {
 protected:
  CalibrateRig() {
    rig_ = test::FieldRig();
    rig_.calibration_residual_px = 0.03;
    rig_.intrinsics_sigma_px << 0.45, 0.46, 0.6, 0.7;
    rig_.gain_dn_per_electron = 0.025;
    for (Led& led : rig_.leds) led.sigma_m = 0.04e-3;
    rig_.camera_tilt.mounting_sigma_rad = DegToRad(0.015);
    rig_.target_tilt.mounting_sigma_rad = DegToRad(0.009);
    rig_.target_tilt.sign = {1.0, -1.0};
    rig_.points = {{"shield_head", {0.003, -0.005, -1.6}, 0.2e-3},
                   {"cutter_face", {0.0, 0.0, -4.8}, 1e-3}};
    Reset();
  }

  void Reset() const {
    WriteText(folder_ / "camera.yaml", CameraSectionYaml(rig_) + Covariance());
    WriteText(folder_ / "tilt.yaml",
              "inclinometers:\n  camera:\n" + TiltMountYaml(rig_.camera_tilt) + "calibrated:\n" +
                  FoundWith());
    WriteText(
        folder_ / "target.yaml",
        TargetYaml(rig_.leds) + "inclinometers:\n  target:\n" + TiltMountYaml(rig_.target_tilt));
    WriteText(folder_ / "points.yaml", "rig_name: north_2\n" + PointsYaml(rig_.points));
  }
  // The camera's section once more, as a part of another.
  std::string FoundWith() const {
    std::string text;
    std::istringstream lines(CameraSectionYaml(rig_));
    for (std::string line; std::getline(lines, line);) text += "  " + line + "\n";
    return text;
  }
  std::string Covariance(double fx_px2 = 0.45 * 0.45) const {
    const std::vector<double> variances = {
        fx_px2, 0.46 * 0.46, 0.36, 0.49, 4e-6, 4e-4, 2.5e-9, 3.6e-9};
    std::string list;
    for (std::size_t i = 0; i < 64; ++i) {
      const double k1_k2 = i == 4 * 8 + 5 || i == 5 * 8 + 4 ? -0.8 * 2e-3 * 2e-2 : 0.0;
      list += fmt::format("{}{:.6e}", i == 0 ? "" : ", ", i % 9 == 0 ? variances[i / 9] : k1_k2);
    }
    return "calibrated:\n  covariance: [" + list + "]\n";
  }

  CalibrateRigRequest Request() const {
    CalibrateRigRequest request;
    request.camera = folder_ / "camera.yaml";
    request.tilt = folder_ / "tilt.yaml";
    request.target = folder_ / "target.yaml";
    request.points = folder_ / "points.yaml";
    request.out = folder_ / "rig.yaml";
    return request;
  }
  Outcome Refused(const CalibrateRigRequest& request) const {
    const Outcome outcome = Ran(RunCalibrateRig, request);
    EXPECT_EQ(outcome.code, ExitCode::kBadInput);
    EXPECT_FALSE(fs::exists(request.out));
    return outcome;
  }

  Rig rig_;
  TempFolder folder_;
};

TEST_F(CalibrateRig, TheLoaderReadsItWithEverySigmaAndWithoutAWarning) {
  const auto request = Request();
  const Outcome outcome = Ran(RunCalibrateRig, request);
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  const auto loaded = LoadRigFile(request.out);
  ASSERT_TRUE(loaded.has_value()) << loaded.error()[0].Text();
  EXPECT_TRUE(loaded->warnings.empty());
  Rig wanted = rig_;
  wanted.name = "north_2";
  EXPECT_EQ(RigYaml(loaded->rig), RigYaml(wanted)) << "to the last figure of the file";
  // An old rig file stands for every part of a new one.
  auto again = Request();
  again.camera = again.tilt = again.target = again.points = request.out;
  again.out = folder_ / "again.yaml";
  again.name = "south";
  const Outcome second = Ran(RunCalibrateRig, again);
  ASSERT_EQ(second.code, ExitCode::kDone) << second.err;
  EXPECT_THAT(second.err, HasSubstr("what the distortion is worth is not known"));
  EXPECT_THAT(second.out, HasSubstr("not known"));
  wanted.name = "south";
  EXPECT_EQ(RigYaml(LoadRigFile(again.out)->rig), RigYaml(wanted));
}

TEST_F(CalibrateRig, ItSaysWhatEachSourceIsWorthAtEachPoint) {
  auto request = Request();
  request.report = folder_ / "report";
  request.distance_m = 5.0;
  const Outcome outcome = Ran(RunCalibrateRig, request);
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  EXPECT_THAT(outcome.out,
              AllOf(HasSubstr("shield_head, 6."),
                    HasSubstr("principal point, 0.60 / 0.70 px"),
                    HasSubstr("target's inclinometer, 0.009 deg"),
                    HasSubstr("= total")));
  const auto rows = Rows(ReadText(request.report + "/rig.csv"));
  EXPECT_EQ(
      rows[0],
      (std::vector<std::string>{"point", "source", "right_mm", "up_mm", "along_mm", "all_mm"}));
  ASSERT_EQ(rows.size(), 1u + 2u * 14u);
  const auto json = nlohmann::json::parse(ReadText(request.report + "/rig.json"));
  for (std::size_t point = 0; point < 2; ++point) {
    const auto& sigma = json["points"][point]["sigma_mm"];
    const auto square = [&](const char* source, const char* direction) {
      const double mm = sigma[source][direction].get<double>();
      return mm * mm;
    };
    for (const char* direction : {"right", "up", "along", "all"}) {
      SCOPED_TRACE(direction);
      const double calibration =
          square("camera", direction) + square("lens_residual", direction) +
          square("led_coordinates", direction) + square("camera_mounting", direction) +
          square("target_mounting", direction) + square("point_coordinates", direction);
      EXPECT_NEAR(square("calibration", direction), calibration, 1e-9);
      EXPECT_NEAR(square("total", direction),
                  calibration + square("centre_noise", direction) + square("tilt_noise", direction),
                  1e-9);
      // These do not correlate here.
      EXPECT_NEAR(square("camera", direction),
                  square("focal_length", direction) + square("principal_point", direction) +
                      square("distortion", direction),
                  1e-9);
    }
    // 0.1 per mille of focal length is as much of the distance.
    EXPECT_NEAR(std::sqrt(square("focal_length", "along")), 5000.0 * 0.455 / 3020.0, 0.25);
    EXPECT_GT(square("distortion", "all"), 0.0);
  }
  // Numbers in CSV and JSON are the same.
  EXPECT_EQ(rows[14][1], "total");
  EXPECT_NEAR(
      std::stod(rows[14][5]), json["points"][0]["sigma_mm"]["total"]["all"].get<double>(), 1e-5);
  // The longer lever is worth more.
  EXPECT_GT(std::stod(rows[28][5]), std::stod(rows[14][5]));
}

TEST_F(CalibrateRig, EachFaultOfAPartNamesFileLineAndKey) {
  struct Case {
    const char* file;
    std::string from;
    std::string to;
    std::vector<std::string> words;
  };
  const std::vector<Case> cases = {
      {"camera.yaml", "image_width: 1280", "image_width: x", {"camera.yaml:2: camera.image_width"}},
      {"camera.yaml", "residual_px", "residual", {"camera.residual_px: missing", "0 .. 100"}},
      {"camera.yaml", "intrinsics_sigma_px", "sigma_px", {"camera.intrinsics_sigma_px: missing"}},
      {"camera.yaml", "intrinsics_sigma_px", "sigma_px", {"camera.sigma_px: nobody reads"}},
      {"camera.yaml", "covariance: [", "covariance: [1, ", {"calibrated.covariance", "64 numbers"}},
      {"camera.yaml",
       "2.025000e-01",
       "2.5e-01",
       {"camera.yaml:11: calibrated.covariance", "does not belong to intrinsics_sigma_px"}},
      {"camera.yaml", "-3.200000e-05", "-3.2e-03", {"calibrated.covariance: is no covariance"}},
      {"tilt.yaml",
       "rotation: [",
       "rotation: [0.5, ",
       {"tilt.yaml:4: inclinometers.camera.rotation"}},
      {"tilt.yaml",
       "mounting_sigma_deg",
       "mounting_sigma",
       {"inclinometers.camera.mounting_sigma_deg: missing"}},
      {"tilt.yaml",
       "inclinometers",
       "inclinometer",
       {"tilt.yaml:1: inclinometers: missing", "tbm calibrate tilt"}},
      {"tilt.yaml",
       "image_width: 1280",
       "image_width: x",
       {"tilt.yaml:9: calibrated.camera.image_width"}},
      {"tilt.yaml", "camera_matrix", "matrix", {"calibrated.camera.camera_matrix: missing"}},
      {"tilt.yaml",
       "calibrated",
       "with",
       {"tilt.yaml:1: calibrated.camera: missing", "belongs to the camera it was found with"}},
      {"target.yaml",
       "inclinometers",
       "inclinometer",
       {"target.yaml:1: inclinometers: missing", "two placements"}},
      {"target.yaml",
       "sigma_mm: 0.0400",
       "sigma: 0.04",
       {"target.yaml:3: target.leds[0].sigma_mm: missing"}},
      {"target.yaml", "id: P2", "id: P1", {"target.yaml:4: target.leds[1].id", "two LEDs"}},
      {"target.yaml", "sign: [+1, -1]", "sign: [+1, 2]", {"inclinometers.target.sign[1]"}},
      {"points.yaml", "points:", "point:", {"points.yaml:1: points: missing", "shield_head"}},
      {"points.yaml",
       ", sigma_mm: 0.2000",
       "",
       {"points.yaml:3: points.shield_head.sigma_mm: missing"}},
      {"points.yaml", "rig_name: north_2\n", "", {"points.yaml: rig_name: missing", "--name"}},
      {"points.yaml", "shield_head", "shield head", {"points.yaml:3: points.shield head"}},
      {"points.yaml", "rig_name", "{", {"points.yaml:2", "not YAML"}}};
  for (const Case& one : cases) {
    SCOPED_TRACE(one.from + " -> " + one.to);
    Reset();
    std::string text = ReadText(folder_ / one.file);
    Replace(&text, one.from, one.to);
    WriteText(folder_ / one.file, text);
    const Outcome outcome = Refused(Request());
    for (const std::string& word : one.words) EXPECT_THAT(outcome.err, HasSubstr(word));
  }
  // Of all files at once.
  Reset();
  auto request = Request();
  request.camera = folder_ / "no.yaml";
  request.tilt = folder_ / "target.yaml";
  EXPECT_THAT(
      Refused(request).err,
      AllOf(HasSubstr("no.yaml: cannot be read"), HasSubstr("inclinometers.camera: missing")));
}

TEST_F(CalibrateRig, ARotationThatWasFoundWithAnotherCameraIsRefused) {
  const CameraModel good = rig_.camera;
  const auto refused = [&](const std::string& tilt, const std::string& name) {
    auto request = Request();
    request.tilt = tilt;
    EXPECT_THAT(Refused(request).err,
                AllOf(HasSubstr("the rotation was found with another camera: " + name + " is "),
                      HasSubstr("run tbm calibrate tilt with --camera " + request.camera)));
  };
  struct Case {
    const char* name;
    std::function<void(CameraModel*)> move;
  };
  const std::vector<Case> cases = {
      {"image_width", [](CameraModel* c) { c->image_width_px += 1; }},
      {"image_height", [](CameraModel* c) { c->image_height_px -= 1; }},
      {"fx", [](CameraModel* c) { c->fx_px += 0.1; }},
      {"fy", [](CameraModel* c) { c->fy_px += 0.1; }},
      {"cx", [](CameraModel* c) { c->cx_px -= 0.1; }},
      {"cy", [](CameraModel* c) { c->cy_px -= 0.1; }},
      {"k1", [](CameraModel* c) { c->k1 += 1e-4; }},
      {"k2", [](CameraModel* c) { c->k2 += 1e-4; }},
      {"p1", [](CameraModel* c) { c->p1 += 1e-5; }},
      {"p2", [](CameraModel* c) { c->p2 += 1e-5; }},
      {"k3", [](CameraModel* c) { c->k3 += 1e-4; }}};
  // An old rig file as the tilt's part of a new rig: what its rotation was found with is its own
  // camera.
  auto request = Request();
  request.out = folder_ / "old.yaml";
  ASSERT_EQ(Ran(RunCalibrateRig, request).code, ExitCode::kDone);
  for (const Case& one : cases) {
    SCOPED_TRACE(one.name);
    rig_.camera = good;
    one.move(&rig_.camera);
    WriteText(folder_ / "camera.yaml", CameraSectionYaml(rig_) + Covariance());
    refused(folder_ / "tilt.yaml", one.name);
    refused(folder_ / "old.yaml", one.name);
  }
  // Written down is what counts, whatever camera stands in the same file.
  rig_.camera = good;
  Reset();
  rig_.camera.fx_px += 1.0;
  WriteText(folder_ / "tilt.yaml", ReadText(folder_ / "tilt.yaml") + CameraSectionYaml(rig_));
  EXPECT_EQ(Ran(RunCalibrateRig, Request()).code, ExitCode::kDone);
}

TEST_F(CalibrateRig, APlacementThatCannotBeIsRefused) {
  auto request = Request();
  request.distance_m = 0.7;
  EXPECT_THAT(Refused(request).err,
              AllOf(HasSubstr("--distance-m 0.7"), HasSubstr("LED P1 lies outside the image")));
  request.distance_m = 900.0;
  EXPECT_THAT(Refused(request).err, AllOf(HasSubstr("--distance-m 900"), HasSubstr("no pose")));
  request = Request();
  request.facing = {0.0, 1.0, 0.0};
  EXPECT_THAT(Refused(request).err, HasSubstr("--facing")) << "straight up";
  request.facing = {0.0, 0.0, 0.0};
  EXPECT_THAT(Refused(request).err, HasSubstr("--facing must be three numbers"));
  request.facing = {0.3, 0.0, 1.0};
  EXPECT_EQ(Ran(RunCalibrateRig, request).code, ExitCode::kDone);

  std::string text = ReadText(folder_ / "points.yaml");
  Replace(&text, "[3.0000, -5.0000, -1600.0000]", "[2000, 0, 110]");
  Replace(&text, "[0.0000, 0.0000, -4800.0000]", "[-2000, 0, 110]");
  WriteText(folder_ / "points.yaml", text);
  request = Request();
  request.out = folder_ / "beside.yaml";
  EXPECT_THAT(Refused(request).err, HasSubstr("--facing X Y Z says it"));
  Reset();
  text = ReadText(folder_ / "tilt.yaml");
  const std::size_t at = text.find("[", text.find("rotation"));
  text.replace(at, text.find("]") + 1 - at, "[1, 0, 0, 0, 1, 0, 0, 0, 1]");
  WriteText(folder_ / "tilt.yaml", text);
  EXPECT_THAT(Refused(request).err,
              AllOf(HasSubstr("tilt.yaml: inclinometers.camera.rotation"), HasSubstr("steeply")));
}

TEST_F(CalibrateRig, NothingIsReplacedUnlessForced) {
  auto request = Request();
  WriteText(request.out, "mine");
  EXPECT_THAT(Ran(RunCalibrateRig, request).err, HasSubstr("exists already"));
  EXPECT_EQ(ReadText(request.out), "mine");
  request.force = true;
  EXPECT_EQ(Ran(RunCalibrateRig, request).code, ExitCode::kDone);
  EXPECT_TRUE(LoadRigFile(request.out).has_value());
}

}  // namespace
}  // namespace tbm
