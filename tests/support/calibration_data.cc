#include "tests/support/calibration_data.h"

#include <cmath>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "pose/base/angle.h"
#include "pose/calibrate/board.h"
#include "pose/geometry/tilt.h"
#include "tests/support/board_picture.h"
#include "tests/support/random.h"
#include "tests/support/temp_folder.h"

namespace tbm::test {
namespace {

Eigen::Matrix3d About(const Eigen::Vector3d& axis, double angle_deg) {
  return Eigen::AngleAxisd(DegToRad(angle_deg), axis).toRotationMatrix();
}

Rigid3 TiltPlacement(const Board& board, double roll_deg, Random& random) {
  BoardPlace place;
  place.share = 0.4;
  place.tilt_u_deg = random.Uniform(-15.0, 15.0);
  place.tilt_v_deg = random.Uniform(-15.0, 15.0);
  place.roll_deg = random.Uniform(-roll_deg, roll_deg);
  return Placed(board, BoardCamera(), place);
}

std::string GsiWord(int index, double value_mm) {
  return fmt::format("{}..46{}{:016} ",
                     index,
                     value_mm < 0.0 ? '-' : '+',
                     static_cast<long>(std::lround(10.0 * std::abs(value_mm))));
}

std::string TiltRow(const std::string& name,
                    const Eigen::Vector3d& up_in_housing,
                    double sigma_deg,
                    Random& random) {
  const Inclination tilt = InclinationFromUp(up_in_housing);
  const double beta_deg = RadToDeg(tilt.beta_rad) + random.Normal(sigma_deg);
  const double gamma_deg = RadToDeg(tilt.gamma_rad) + random.Normal(sigma_deg);
  return fmt::format("{},{:.4f},{:.4f}\n", name, beta_deg, gamma_deg);
}

}  // namespace

void MakeCameraPictures(const std::string& folder) {
  const Board board = *ParseBoard(kWorkshopBoard);
  const BoardPainter painter(BoardCamera());
  Random random("calibrate camera");
  int number = 0;
  for (const Rigid3& placement : GoodPlacements(board, BoardCamera(), 18, random)) {
    const auto pixels = painter.Paint(board, placement, 2.0, random);
    WritePicture(fmt::format("{}/p{:02}.pgm", folder, number++), painter.View(pixels));
  }
}

Eigen::Matrix3d TiltingTable::FloorCameraFromHousing() {
  return About(Eigen::Vector3d::UnitX(), 176.0) * About(Eigen::Vector3d::UnitZ(), 31.0) *
         About(Eigen::Vector3d::UnitY(), -3.0);
}

TiltingTable LevelTable(const Eigen::Matrix3d& housing_from_camera) {
  TiltingTable table;
  table.camera_from_housing = housing_from_camera.transpose();
  table.up_in_board = -Eigen::Vector3d::UnitY();
  table.roll_deg = 15.0;
  return table;
}

void MakeTiltPictures(const std::string& folder, const TiltingTable& table) {
  const Board board = *ParseBoard(kWorkshopBoard);
  const BoardPainter painter(BoardCamera());
  Random random("calibrate tilt");
  std::string csv = "image,beta_deg,gamma_deg\n";
  for (int i = 0; i < 12; ++i) {
    const Rigid3 placement = TiltPlacement(board, table.roll_deg, random);
    const auto pixels = painter.Paint(board, placement, 2.0, random);
    const std::string name = fmt::format("t{:02}.pgm", i);
    WritePicture(folder + "/" + name, painter.View(pixels));
    const Eigen::Vector3d up =
        table.camera_from_housing.transpose() * (placement.rotation * table.up_in_board);
    csv += TiltRow(name, up, 0.005, random);
  }
  WriteText(folder + "/tilt.csv", csv);
  WriteText(folder + "/camera.yaml",
            "camera:\n  image_width: 640\n  image_height: 480\n"
            "  camera_matrix: {data: [612.4, 0, 323.7, 0, 611.1, 236.2, 0, 0, 1]}\n"
            "  distortion_coefficients: {data: [-0.12, 0.07, 0.0006, -0.0004, 0]}\n");
}

void MakeBoardSurvey(const std::string& folder, const BoardSurvey& survey) {
  Random random("board survey");
  const Eigen::Matrix3d upright = About(Eigen::Vector3d::UnitX(), 90.0);
  std::string tilts = "placement,beta_deg,gamma_deg\n";
  for (int i = 0; i < survey.placements; ++i) {
    const double lean_deg = i == 0 ? 0.0 : survey.lean_deg;
    // One after the other: compilers differ in which argument they look at first.
    const double turn_deg = random.Uniform(-60.0, 60.0);
    const double forwards_deg = random.Uniform(-lean_deg, lean_deg);
    const double sideways_deg = random.Uniform(-lean_deg, lean_deg);
    const Eigen::Matrix3d site_from_target =
        About(Eigen::Vector3d::UnitZ(), turn_deg) * About(Eigen::Vector3d::UnitX(), forwards_deg) *
        About(Eigen::Vector3d::UnitY(), sideways_deg) * upright;
    const Eigen::Vector3d origin_mm =
        Eigen::Vector3d(4512300, 12080100, 412000) + random.Normal3(2000.0);
    std::string csv = "stamp_ns,point,x_mm,y_mm,z_mm\n";
    std::string gsi;
    int number = 1;
    for (const Led& led : survey.rig.leds) {
      const Eigen::Vector3d p = site_from_target * (1000.0 * led.p_led_in_target) + origin_mm +
                                random.Normal3(survey.sigma_mm);
      csv += fmt::format(",{},{:.2f},{:.2f},{:.2f}\n", led.id, p.x(), p.y(), p.z());
      gsi += fmt::format("*11{:04}+{:0>16} {}{}{}\r\n",
                         number++,
                         led.id,
                         GsiWord(81, p.x()),
                         GsiWord(82, p.y()),
                         GsiWord(83, p.z()));
    }
    const std::string name = fmt::format("s{}.{}", i + 1, i % 2 == 0 ? "csv" : "gsi");
    WriteText(folder + "/" + name, i % 2 == 0 ? csv : gsi);
    const Eigen::Vector3d up = survey.rig.target_tilt.tilt_from_body *
                               (site_from_target.transpose() * Eigen::Vector3d::UnitZ());
    tilts += TiltRow(name, up, survey.tilt_sigma_deg, random);
  }
  WriteText(folder + "/tilt.csv", tilts);
}

}  // namespace tbm::test
