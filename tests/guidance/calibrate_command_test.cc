#include "guidance/app/calibrate_command.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/app/calibrate_input.h"
#include "guidance/config/calibration_parts.h"
#include "guidance/config/camera_file.h"
#include "pose/base/angle.h"
#include "pose/calibrate/view_fit.h"
#include "pose/rig/rig_file.h"
#include "tests/support/board_picture.h"
#include "tests/support/calibration_data.h"
#include "tests/support/command.h"
#include "tests/support/random.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using test::BoardCamera;
using test::Outcome;
using test::Ran;
using test::Random;
using test::ReadText;
using test::TempFolder;
using test::WriteText;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

namespace fs = std::filesystem;

const std::string kBoard = test::kWorkshopBoard;

// A folder with what a surveyor brings home: pictures/ for the camera.
class CalibrateCamera : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = new TempFolder;
    fs::create_directory(*shared_ / "pictures");
    test::MakeCameraPictures(*shared_ / "pictures");
    WriteText(*shared_ / "pictures/notes.txt", "not a picture");
  }
  static void TearDownTestSuite() {
    delete shared_;
    shared_ = nullptr;
  }

  CalibrateCameraRequest Request() const {
    CalibrateCameraRequest request;
    request.folder = *shared_ / "pictures";
    request.board = kBoard;
    request.out = folder_ / "camera.yaml";
    return request;
  }
  // The same pictures under other names, so that a test may spoil some.
  std::string OwnPictures(int from, int to) const {
    const std::string own = folder_ / "own";
    fs::create_directory(own);
    for (int i = from; i < to; ++i) {
      const std::string name = fmt::format("/p{:02}.pgm", i);
      fs::copy_file(*shared_ / "pictures" + name, own + name);
    }
    return own;
  }

  inline static TempFolder* shared_ = nullptr;
  TempFolder folder_;
};

TEST_F(CalibrateCamera, ItsYamlIsTheCameraPartOfARigFile) {
  auto request = Request();
  request.picture = folder_ / "residuals.png";
  request.coverage = folder_ / "coverage.png";
  const Outcome outcome = Ran(RunCalibrateCamera, request);
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("18 pictures"), HasSubstr("fx_px"), HasSubstr("+-")));
  EXPECT_THAT(outcome.out, Not(HasSubstr("k3")));
  for (const std::string& picture : {request.picture, request.coverage}) {
    EXPECT_THAT(ReadText(picture), StartsWith("\x89PNG")) << picture;
  }
  // Pasted over the camera of a rig file, with what calibration adds below it.
  std::string rig = ReadText(TBM_SOURCE_DIR "/tests/data/run_small/rig.yaml");
  const std::size_t from = rig.find("camera:\n");
  const std::size_t to = rig.find("target:\n");
  ASSERT_LT(from, to);
  const std::string camera = ReadText(request.out);
  rig.replace(from, to - from, camera.substr(0, camera.find("# What")));
  const auto loaded = ParseRig(rig, "rig.yaml");
  ASSERT_TRUE(loaded.has_value()) << loaded.error()[0].Text();
  EXPECT_TRUE(loaded->warnings.empty());
  const CameraModel truth = BoardCamera();
  const Rig& got = loaded->rig;
  EXPECT_EQ(got.camera.image_width_px, 640);
  EXPECT_NEAR(got.camera.fx_px, truth.fx_px, 4.0 * got.intrinsics_sigma_px(0));
  EXPECT_NEAR(got.camera.fy_px, truth.fy_px, 4.0 * got.intrinsics_sigma_px(1));
  EXPECT_NEAR(got.camera.cx_px, truth.cx_px, 4.0 * got.intrinsics_sigma_px(2));
  EXPECT_NEAR(got.camera.cy_px, truth.cy_px, 4.0 * got.intrinsics_sigma_px(3));
  EXPECT_GT(got.intrinsics_sigma_px.minCoeff(), 0.001);
  EXPECT_LT(got.intrinsics_sigma_px.maxCoeff(), 1.0);
  EXPECT_GT(got.calibration_residual_px, 0.005);
  EXPECT_LT(got.calibration_residual_px, 0.06);
  // Whole, it is a camera's file too.
  const auto alone = LoadCameraFile(request.out);
  ASSERT_TRUE(alone.has_value());
  EXPECT_EQ(alone->fx_px, got.camera.fx_px);
  EXPECT_EQ(IntrinsicsOf(*alone), IntrinsicsOf(got.camera));
}

TEST_F(CalibrateCamera, NothingIsReplacedUnlessForced) {
  auto request = Request();
  WriteText(request.out, "mine");
  const Outcome kept = Ran(RunCalibrateCamera, request);
  EXPECT_EQ(kept.code, ExitCode::kBadInput);
  EXPECT_THAT(kept.err, HasSubstr("exists already"));
  EXPECT_EQ(ReadText(request.out), "mine");
  request.out = folder_ / "other.yaml";
  request.picture = folder_ / "camera.yaml";
  EXPECT_EQ(Ran(RunCalibrateCamera, request).code, ExitCode::kBadInput);
  EXPECT_FALSE(fs::exists(request.out)) << "found out before the work";
}

TEST_F(CalibrateCamera, WhatIsMissingIsShownAndSaid) {
  auto request = Request();
  request.folder = OwnPictures(0, 6);  // the upper row and the middle one
  const Outcome outcome = Ran(RunCalibrateCamera, request);
  EXPECT_EQ(outcome.code, ExitCode::kBadInput);
  EXPECT_THAT(outcome.err, HasSubstr("lower left"));
  EXPECT_THAT(outcome.err, HasSubstr("lower right"));
  EXPECT_THAT(outcome.err, Not(HasSubstr("upper left")));
  EXPECT_FALSE(fs::exists(request.out));
  EXPECT_THAT(ReadText(folder_ / "camera_coverage.png"), StartsWith("\x89PNG"));
  EXPECT_THAT(outcome.err, HasSubstr("camera_coverage.png"));

  fs::remove_all(request.folder);
  fs::create_directory(request.folder);
  const Outcome empty = Ran(RunCalibrateCamera, request);
  EXPECT_EQ(empty.code, ExitCode::kBadInput);
  EXPECT_THAT(empty.err, HasSubstr("holds no picture"));
}

TEST_F(CalibrateCamera, TheOnePictureThatDoesNotFitIsNamed) {
  auto request = Request();
  request.folder = OwnPictures(0, 18);
  // Half of one picture was taken after somebody had moved the board by three pixels.
  const std::string path = request.folder + "/p04.pgm";
  std::string bytes = ReadText(path);
  const std::size_t header = bytes.size() - 640u * 480u;
  for (std::size_t v = 240; v < 480; ++v) {
    const std::size_t row = header + v * 640;
    std::rotate(bytes.begin() + static_cast<std::ptrdiff_t>(row),
                bytes.begin() + static_cast<std::ptrdiff_t>(row + 3),
                bytes.begin() + static_cast<std::ptrdiff_t>(row + 640));
  }
  WriteText(path, bytes);
  // And one shows a wall.
  std::fill(bytes.begin() + static_cast<std::ptrdiff_t>(header), bytes.end(), 'x');
  WriteText(request.folder + "/p19.pgm", bytes);
  const Outcome outcome = Ran(RunCalibrateCamera, request);
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("17 pictures"));
  EXPECT_THAT(outcome.out, HasSubstr("left out: p04.pgm"));
  EXPECT_THAT(outcome.err, HasSubstr("p19.pgm: the board is not seen whole"));
  EXPECT_THAT(ReadText(request.out), HasSubstr("left_out: [\"p04.pgm\"]"));
}

TEST_F(CalibrateCamera, BadInputIsNamed) {
  auto request = Request();
  request.board = "chessboard:9x6";
  Outcome outcome = Ran(RunCalibrateCamera, request);
  EXPECT_EQ(outcome.code, ExitCode::kBadInput);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("--board"), HasSubstr("chessboard:9x6:25")));

  request = Request();
  request.folder = folder_ / "nowhere";
  outcome = Ran(RunCalibrateCamera, request);
  EXPECT_EQ(outcome.code, ExitCode::kBadInput);
  EXPECT_THAT(outcome.err, HasSubstr("nowhere"));

  request = Request();
  request.folder = OwnPictures(0, 3);
  fs::resize_file(request.folder + "/p02.pgm", 5000);
  outcome = Ran(RunCalibrateCamera, request);
  EXPECT_EQ(outcome.code, ExitCode::kBadInput);
  EXPECT_THAT(outcome.err, HasSubstr("p02.pgm"));

  WriteText(request.folder + "/p02.pgm", "P5\n64 48\n255\n" + std::string(64u * 48u, 'x'));
  outcome = Ran(RunCalibrateCamera, request);
  EXPECT_EQ(outcome.code, ExitCode::kBadInput);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("p02.pgm: is 64 x 48"), HasSubstr("640 x 480")));

  // Pictures, and of another board: no picture shows the one that was named.
  fs::remove(request.folder + "/p02.pgm");
  request.board = "circles:7x5:30";
  outcome = Ran(RunCalibrateCamera, request);
  EXPECT_EQ(outcome.code, ExitCode::kBadInput);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("p00.pgm: the board is not seen"), HasSubstr("at least five")));
}

// A rig on a tilting table over a board that lies on the floor.
class CalibrateTilt : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = new TempFolder;
    test::MakeTiltPictures(shared_->path(), {});
  }
  static void TearDownTestSuite() {
    delete shared_;
    shared_ = nullptr;
  }

  CalibrateTiltRequest Request() const {
    CalibrateTiltRequest request;
    request.folder = shared_->path();
    request.board = kBoard;
    request.camera = *shared_ / "camera.yaml";
    request.out = folder_ / "tilt.yaml";
    return request;
  }
  // The pictures with another tilt.csv.
  CalibrateTiltRequest With(const std::string& csv) const {
    auto request = Request();
    request.folder = folder_ / "own";
    fs::create_directory(request.folder);
    for (int i = 0; i < 12; ++i) {
      const std::string name = fmt::format("/t{:02}.pgm", i);
      std::error_code ignored;
      fs::create_symlink(shared_->path() + name, request.folder + name, ignored);
    }
    WriteText(request.folder + "/tilt.csv", csv);
    return request;
  }
  static std::string Csv() { return ReadText(*shared_ / "tilt.csv"); }

  inline static TempFolder* shared_ = nullptr;
  TempFolder folder_;
};

// The rig file of the small run with this as its second inclinometer.
Result<LoadedRig, RigFileFaults> RigWith(const std::string& yaml) {
  std::string rig = ReadText(TBM_SOURCE_DIR "/tests/data/run_small/rig.yaml");
  const std::size_t from = rig.find("  camera: {rotation");
  const std::size_t to = rig.find("points:");
  const std::size_t begin = yaml.find("  camera:");
  rig.replace(from, to - from, yaml.substr(begin, yaml.find("# What") - begin));
  return ParseRig(rig, "rig.yaml");
}

TEST_F(CalibrateTilt, TwelvePicturesGiveTheRotationThatTheRigFileWants) {
  const auto request = Request();
  const Outcome outcome = Ran(RunCalibrateTilt, request);
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_THAT(outcome.out, HasSubstr("12 placements"));
  const auto loaded = RigWith(ReadText(request.out));
  ASSERT_TRUE(loaded.has_value()) << loaded.error()[0].Text();
  const TiltMount& mount = loaded->rig.camera_tilt;
  const Eigen::AngleAxisd off(
      Eigen::Matrix3d(mount.tilt_from_body * test::TiltingTable::FloorCameraFromHousing()));
  EXPECT_LT(RadToDeg(std::abs(off.angle())), 0.05);
  EXPECT_LT(std::abs(off.angle()), 4.0 * mount.mounting_sigma_rad);
  EXPECT_LT(RadToDeg(mount.mounting_sigma_rad), 0.05);
  EXPECT_NEAR(RadToDeg(mount.sigma_rad), 0.005, 1e-9);
  EXPECT_TRUE(loaded->warnings.empty());
}

TEST_F(CalibrateTilt, GravityThatIsKnownMakesItBetterAndSignsAreTaken) {
  auto request = Request();
  request.up_in_board = {0.02, -0.03, -1.0};
  Outcome outcome = Ran(RunCalibrateTilt, request);
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  EXPECT_THAT(ReadText(request.out), Not(HasSubstr("up_sigma_deg")));

  std::string csv = "image,gamma_deg,beta_deg,sigma_deg\n";
  std::istringstream rows(Csv());
  std::string row;
  std::getline(rows, row);
  while (std::getline(rows, row)) {
    const std::size_t first = row.find(',');
    const std::size_t second = row.find(',', first + 1);
    const double beta_deg = std::atof(row.substr(first + 1, second - first - 1).c_str());
    csv += fmt::format("{},{},{},0.01\n", row.substr(0, first), row.substr(second + 1), -beta_deg);
  }
  auto turned = With(csv);
  turned.force = true;
  turned.sign = {-1.0, 1.0};
  outcome = Ran(RunCalibrateTilt, turned);
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  const auto loaded = RigWith(ReadText(turned.out));
  ASSERT_TRUE(loaded.has_value());
  EXPECT_EQ(loaded->rig.camera_tilt.sign[0], -1.0);
  const Eigen::AngleAxisd off(Eigen::Matrix3d(loaded->rig.camera_tilt.tilt_from_body *
                                              test::TiltingTable::FloorCameraFromHousing()));
  EXPECT_LT(RadToDeg(std::abs(off.angle())), 0.06);
}

// tilt.csv with each angle off by what `by_deg` says for its row.
std::string Retyped(const std::string& csv, const std::function<double(std::size_t)>& by_deg) {
  std::string text;
  const auto rows = test::Rows(csv);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto angle = [&](std::size_t column) {
      return i == 0 ? rows[i][column] : fmt::format("{}", std::stod(rows[i][column]) + by_deg(i));
    };
    text += fmt::format("{},{},{}\n", rows[i][0], angle(1), angle(2));
  }
  return text;
}

TEST_F(CalibrateTilt, ReadingsWorseThanDeclaredMakeTheSigmaLargerAndAreRefusedBeyondThreeTimes) {
  ASSERT_EQ(Ran(RunCalibrateTilt, Request()).code, ExitCode::kDone);
  const TiltMount honest = RigWith(ReadText(Request().out))->rig.camera_tilt;
  Random random("readings worse than declared");
  const auto noisy = [&](double sigma_deg) {
    return With(Retyped(Csv(), [&](std::size_t) { return random.Normal(sigma_deg); }));
  };
  auto request = noisy(0.03);
  request.force = true;
  const Outcome outcome = Ran(RunCalibrateTilt, request);
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("warning: "), HasSubstr("times as much as --sigma-deg")));
  const TiltMount scaled = RigWith(ReadText(request.out))->rig.camera_tilt;
  EXPECT_GT(scaled.mounting_sigma_rad, 1.5 * honest.mounting_sigma_rad);
  const Eigen::AngleAxisd off(
      Eigen::Matrix3d(scaled.tilt_from_body * test::TiltingTable::FloorCameraFromHousing()));
  // Of the turn about the housing's z, which tilts find worst, that sigma holds a sixth.
  EXPECT_LT(std::abs(off.angle()), 6.0 * scaled.mounting_sigma_rad);
  auto bad = noisy(0.3);
  bad.out = folder_ / "bad.yaml";
  const Outcome refused = Ran(RunCalibrateTilt, bad);
  EXPECT_EQ(refused.code, ExitCode::kBadInput);
  EXPECT_THAT(refused.err,
              AllOf(HasSubstr("no calibration"), HasSubstr("times as much as --sigma-deg")));
  EXPECT_FALSE(fs::exists(bad.out));
}

TEST_F(CalibrateTilt, AMistypedReadingIsNamedWithItsPictureAndSize) {
  for (const double by_deg : {0.4, 1.0}) {
    const Outcome one =
        Ran(RunCalibrateTilt,
            With(Retyped(Csv(), [&](std::size_t row) { return row == 4 ? by_deg : 0.0; })));
    EXPECT_EQ(one.code, ExitCode::kBadInput);
    EXPECT_THAT(one.err,
                AllOf(HasSubstr("/t03.pgm: the reading is "),
                      HasSubstr("from where all other pictures put it"),
                      HasSubstr("no calibration: see that each reading belongs to its picture")));
    EXPECT_THAT(one.err, Not(HasSubstr("t04.pgm")));
  }
  const Outcome two =
      Ran(RunCalibrateTilt,
          With(Retyped(Csv(), [](std::size_t row) { return row == 3 || row == 8 ? 0.7 : 0.0; })));
  EXPECT_EQ(two.code, ExitCode::kBadInput);
  EXPECT_THAT(
      two.err,
      AllOf(HasSubstr("/t02.pgm: the reading is "), HasSubstr("/t07.pgm: the reading is ")));
  // Two exchanged are tens of degrees off, and drag all others along.
  auto rows = test::Rows(Csv());
  std::swap(rows[3][0], rows[8][0]);
  std::string csv;
  for (const auto& row : rows) csv += fmt::format("{},{},{}\n", row[0], row[1], row[2]);
  const Outcome exchanged = Ran(RunCalibrateTilt, With(csv));
  EXPECT_EQ(exchanged.code, ExitCode::kBadInput);
  EXPECT_THAT(exchanged.err,
              AllOf(HasSubstr("see that each reading belongs to its picture"),
                    HasSubstr("times as much as --sigma-deg"),
                    Not(HasSubstr(".pgm"))));
  EXPECT_FALSE(fs::exists(folder_ / "tilt.yaml"));
}

TEST_F(CalibrateTilt, ItSaysWhatEachReadingIsOffAndTheRigFileHasTheTablesSigma) {
  std::string csv;
  for (const auto& row : test::Rows(Csv())) {
    const char* sigma = row[0] == "image" ? "sigma_deg" : row[0] == "t05.pgm" ? "0.012" : "0.008";
    csv += fmt::format("{},{},{},{}\n", row[0], row[1], row[2], sigma);
  }
  const auto request = With(csv);
  const Outcome outcome = Ran(RunCalibrateTilt, request);
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("of one reading 0.012"), HasSubstr("  t05.pgm\n")));
  EXPECT_NEAR(RadToDeg(RigWith(ReadText(request.out))->rig.camera_tilt.sigma_rad), 0.012, 1e-9);
  // The camera that it belongs to, to the last figure.
  const auto part = LoadTiltPart(request.out);
  ASSERT_TRUE(part.has_value()) << part.error()[0].Text();
  EXPECT_EQ(part->camera_key, "calibrated.camera");
  EXPECT_EQ(IntrinsicsOf(part->camera), IntrinsicsOf(BoardCamera()));
  EXPECT_EQ(part->camera.image_width_px, 640);
}

TEST_F(CalibrateTilt, TheMissingMotionIsNamed) {
  std::istringstream rows(Csv());
  std::string csv;
  std::string row;
  for (int i = 0; i < 4 && std::getline(rows, row); ++i) csv += row + "\n";
  const auto few = Ran(RunCalibrateTilt, With(csv));
  EXPECT_EQ(few.code, ExitCode::kBadInput);
  EXPECT_THAT(few.err, AllOf(HasSubstr("four pictures"), HasSubstr("3 placements")));

  // Readings that belong to other pictures.
  std::vector<std::string> fields;
  std::istringstream again(Csv());
  std::getline(again, row);
  while (std::getline(again, row)) fields.push_back(row.substr(row.find(',')));
  std::rotate(fields.begin(), fields.begin() + 1, fields.end());
  csv = "image,beta_deg,gamma_deg\n";
  for (std::size_t i = 0; i < fields.size(); ++i)
    csv += fmt::format("t{:02}.pgm{}\n", i, fields[i]);
  const auto exchanged = Ran(RunCalibrateTilt, With(csv));
  EXPECT_EQ(exchanged.code, ExitCode::kBadInput);
  EXPECT_THAT(exchanged.err, HasSubstr("no calibration"));

  csv = "image,beta_deg,gamma_deg\n";
  for (std::size_t i = 0; i < fields.size(); ++i) csv += fmt::format("t{:02}.pgm,1.5,-2\n", i);
  const auto still = Ran(RunCalibrateTilt, With(csv));
  EXPECT_EQ(still.code, ExitCode::kBadInput);
  EXPECT_THAT(still.err, HasSubstr("tilt the rig about both axes"));
  EXPECT_FALSE(fs::exists(folder_ / "tilt.yaml"));
}

TEST_F(CalibrateTilt, EachFaultOfItsTableIsNamedWithLineAndColumn) {
  const std::vector<std::pair<std::string, std::vector<std::string>>> cases = {
      {"image,beta_deg\nt00.pgm,1\n", {"tilt.csv:1", "gamma_deg"}},
      {"image,beta_deg,gamma_deg\n", {"tilt.csv", "no rows"}},
      {"image,beta_deg,gamma_deg\nt00.pgm,1,x\n", {"tilt.csv:2", "gamma_deg", "not a number"}},
      {"image,beta_deg,gamma_deg\nt00.pgm,1,nan\n", {"tilt.csv:2", "gamma_deg"}},
      {"image,beta_deg,gamma_deg\nt00.pgm,95,1\n", {"tilt.csv:2", "beta_deg", "-90 .. 90"}},
      {"image,beta_deg,gamma_deg\nt00.pgm,80,80\n", {"tilt.csv:2", "beta_deg"}},
      {"image,beta_deg,gamma_deg\n,1,1\n", {"tilt.csv:2", "image", "empty"}},
      {"image,beta_deg,gamma_deg\nt00.pgm,1,1\nt00.pgm,2,1\n", {"tilt.csv:3", "image", "twice"}},
      {"image,beta_deg,gamma_deg,sigma_deg\nt00.pgm,1,1,0\n", {"tilt.csv:2", "sigma_deg"}},
      {"image,beta_deg,gamma_deg,sigma_deg\nt00.pgm,1,1,x\n", {"tilt.csv:2", "sigma_deg"}},
      {"image,beta_deg,gamma_deg\nt99.pgm,1,1\n", {"t99.pgm"}}};
  for (const auto& [csv, words] : cases) {
    const Outcome outcome = Ran(RunCalibrateTilt, With(csv));
    EXPECT_EQ(outcome.code, ExitCode::kBadInput) << csv;
    for (const std::string& word : words) EXPECT_THAT(outcome.err, HasSubstr(word)) << csv;
  }
  // All faults are said at once.
  const auto faults = ParseCalibrationTilts(
      "image,beta_deg,gamma_deg\na,x,1\nb,1,y\n", "tilt.csv", kTiltOfPicture, 0.005, 1.0, 1.0);
  ASSERT_FALSE(faults);
  EXPECT_EQ(faults.error().size(), 2u);
}

TEST_F(CalibrateTilt, ACutFlippedOrGluedTableIsRefusedOrReadAsItStands) {
  const std::string whole = Csv();
  const auto read = [](const std::string& text) {
    const auto rows = ParseCalibrationTilts(text, "tilt.csv", kTiltOfPicture, 0.005, 1.0, 1.0);
    if (!rows) {
      EXPECT_FALSE(rows.error().empty());
      for (const FileFault& fault : rows.error()) EXPECT_THAT(fault.Text(), StartsWith("tilt.csv"));
      return;
    }
    for (const CalibrationTilt& row : *rows) {
      EXPECT_NEAR(row.up_in_housing.norm(), 1.0, 1e-9);
      EXPECT_GT(row.sigma_rad, 0.0);
    }
  };
  Random random("tilt bytes");
  for (std::size_t length = 0; length < whole.size(); ++length) read(whole.substr(0, length));
  for (int i = 0; i < 2000; ++i) {
    std::string text = whole;
    const auto at = static_cast<std::size_t>(random.Index(static_cast<int>(text.size())));
    text[at] = static_cast<char>(text[at] ^ (1 << random.Index(8)));
    read(text);
  }
  read(whole + whole);
}

TEST_F(CalibrateTilt, ABoardThatLooksTheSameTurnedAndAWrongCameraAreRefused) {
  auto request = Request();
  request.board = "chessboard:9x7:25";
  EXPECT_THAT(Ran(RunCalibrateTilt, request).err, HasSubstr("turned by 180 degrees"));
  request = Request();
  request.up_in_board = {0.0, 0.0, 0.0};
  EXPECT_THAT(Ran(RunCalibrateTilt, request).err, HasSubstr("--up"));
  request = Request();
  request.camera = folder_ / "camera.yaml";
  EXPECT_THAT(Ran(RunCalibrateTilt, request).err, HasSubstr("camera.yaml"));
  WriteText(request.camera, "camera: {image_width: 640, image_height: 480, camera_matrix: 7}\n");
  const Outcome outcome = Ran(RunCalibrateTilt, request);
  EXPECT_EQ(outcome.code, ExitCode::kBadInput);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("camera.yaml:1"), HasSubstr("camera_matrix")));
  std::string other = ReadText(*shared_ / "camera.yaml");
  other.replace(other.find("640"), 3, "800");
  WriteText(request.camera, other);
  EXPECT_THAT(Ran(RunCalibrateTilt, request).err, HasSubstr("the camera's file is for 800 x 480"));
}

TEST(CameraFile, IsARigFileOrACameraInfoFileAndElseNamesItsFault) {
  const std::string bare =
      "image_width: 640\nimage_height: 480\ndistortion_model: plumb_bob\n"
      "camera_matrix: {rows: 3, cols: 3, data: [612.4, 0, 323.7, 0, 611.1, 236.2, 0, 0, 1]}\n"
      "distortion_coefficients: {rows: 1, cols: 5, data: [-0.12, 0.07, 0.0006, -0.0004, 0]}\n";
  const auto camera = ParseCameraFile(bare, "info.yaml");
  ASSERT_TRUE(camera.has_value()) << camera.error()[0].Text();
  EXPECT_EQ(IntrinsicsOf(*camera), IntrinsicsOf(BoardCamera()));
  const std::string rig = TBM_SOURCE_DIR "/tests/data/run_small/rig.yaml";
  ASSERT_TRUE(LoadCameraFile(rig).has_value());
  EXPECT_EQ(LoadCameraFile(rig)->fx_px, 3018.9);
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"", "is not a map"},
      {"[1, 2]", "is not a map"},
      {"camera: 3", "camera"},
      {"{", "f.yaml:"},
      {"image_width: 640\n", "image_height"},
      {"image_width: 640.5\n", "f.yaml:1: image_width"},
      {bare + "camera: {image_width: 1}\n", "camera.image_width"}};
  for (const auto& [text, word] : cases) {
    const auto bad = ParseCameraFile(text, "f.yaml");
    ASSERT_FALSE(bad) << text;
    std::string all;
    for (const auto& fault : bad.error()) all += fault.Text() + "\n";
    EXPECT_THAT(all, HasSubstr(word)) << text;
  }
}

}  // namespace
}  // namespace tbm
