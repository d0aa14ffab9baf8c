#include "guidance/app/calibrate_report.h"

#include <array>
#include <cmath>
#include <iterator>
#include <sstream>

#include <fmt/format.h>

#include "pose/base/angle.h"
#include "pose/rig/rig_text.h"

namespace tbm {
namespace {

template <class Matrix>
std::string RowByRow(const Matrix& matrix, const char* format) {
  std::string list = "[";
  for (Eigen::Index row = 0; row < matrix.rows(); ++row) {
    for (Eigen::Index column = 0; column < matrix.cols(); ++column) {
      if (row + column > 0) list += ", ";
      fmt::format_to(std::back_inserter(list), fmt::runtime(format), matrix(row, column));
    }
  }
  return list + "]";
}

std::string LeftOut(const CameraCalibration& found, const FoundBoards& boards) {
  std::string list;
  for (std::size_t i = 0; i < found.pictures.size(); ++i) {
    if (found.pictures[i].used) continue;
    list += (list.empty() ? "" : ", ") + YamlText(boards.pictures[i].name);
  }
  return "[" + list + "]";
}

std::size_t UsedPictures(const CameraCalibration& found) {
  std::size_t used = 0;
  for (const CalibrationPicture& picture : found.pictures) used += picture.used ? 1 : 0;
  return used;
}

// The camera as a rig file has it, to stand under `calibrated`.
std::string FoundWithYaml(const CameraModel& lens) {
  std::string text = "  camera:   # that the rotation was found with, and belongs to\n";
  std::istringstream lines(LensYaml(lens));
  for (std::string line; std::getline(lines, line);) text += "  " + line + "\n";
  return text;
}

}  // namespace

std::string CameraYaml(const CameraCalibration& found,
                       const FoundBoards& boards,
                       const std::string& board) {
  const IntrinsicVector sigma = found.covariance.diagonal().cwiseSqrt();
  const bool has_k3 = sigma(8) > 0.0;
  Rig rig;
  rig.camera = found.camera;
  rig.calibration_residual_px = found.residual_px;
  rig.intrinsics_sigma_px = sigma.head<4>();
  std::string text = CameraSectionYaml(rig);
  const auto add = [&text](const auto& line) { text += line; };
  add("# What these numbers rest on. No part of a rig file.\ncalibrated:\n");
  add(fmt::format("  board: {}\n", YamlText(board)));
  add(fmt::format("  pictures: {}\n  left_out: {}\n  degrees_of_freedom: {}\n",
                  UsedPictures(found),
                  LeftOut(found, boards),
                  found.dof));
  add(
      fmt::format("  share_of_image_cells: {:.3f}\n  tilt_about_horizontal_deg: {:.2f}\n  "
                  "tilt_about_vertical_deg: {:.2f}\n",
                  found.coverage.share,
                  RadToDeg(found.coverage.tilt_about_u_rad),
                  RadToDeg(found.coverage.tilt_about_v_rad)));
  add(fmt::format("  distortion_sigma: [{:.9f}, {:.9f}, {:.9f}, {:.9f}, {}]\n",
                  sigma(4),
                  sigma(5),
                  sigma(6),
                  sigma(7),
                  has_k3 ? fmt::format("{:.9f}", sigma(8)) : "null"));
  const int parameters = has_k3 ? kIntrinsics : kIntrinsics - 1;
  add(
      fmt::format("  # row by row; in this order, px and px2 where the parameter is in px\n"
                  "  covariance_of: [fx, fy, cx, cy, k1, k2, p1, p2{}]\n  covariance: {}\n",
                  has_k3 ? ", k3" : "",
                  RowByRow(found.covariance.topLeftCorner(parameters, parameters), "{:.6e}")));
  return text;
}

std::string CameraSummary(const CameraCalibration& found, const FoundBoards& boards) {
  constexpr std::array<const char*, kIntrinsics> kNames = {
      "fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "p1", "p2", "k3"};
  const IntrinsicVector values = IntrinsicsOf(found.camera);
  std::string text = fmt::format(
      "{} pictures, residual {:.3f} px, {:.0f} % of the image's cells, tilts {:.0f} and {:.0f} "
      "degrees\n",
      UsedPictures(found),
      found.residual_px,
      100.0 * found.coverage.share,
      RadToDeg(found.coverage.tilt_about_u_rad),
      RadToDeg(found.coverage.tilt_about_v_rad));
  for (int i = 0; i < kIntrinsics; ++i) {
    const double sigma = std::sqrt(found.covariance(i, i));
    if (!(sigma > 0.0)) continue;
    const int digits = i < 4 ? 3 : 6;
    text += fmt::format("  {:6} {:14.{}f}  +- {:.{}f}\n",
                        kNames[static_cast<std::size_t>(i)],
                        values(i),
                        digits,
                        sigma,
                        digits);
  }
  for (std::size_t i = 0; i < found.pictures.size(); ++i) {
    const CalibrationPicture& picture = found.pictures[i];
    if (picture.used) continue;
    text +=
        fmt::format("  left out: {}, {}\n",
                    boards.pictures[i].name,
                    picture.is_placed ? fmt::format("its points are {:.2f} px off", picture.rms_px)
                                      : "its points fit no placement of the board");
  }
  return text;
}

std::string TiltYaml(const TiltResult& result) {
  const TiltRotation& found = result.rotation;
  const double per_rad = RadToDeg(1.0);
  TiltMount mount;
  mount.tilt_from_body = found.camera_from_housing.transpose();
  mount.sign = {result.sign[0], result.sign[1]};
  mount.sigma_rad = DegToRad(result.sigma_deg);
  mount.mounting_sigma_rad = MountingSigma_rad(found.covariance, mount.tilt_from_body);
  std::string text = "inclinometers:\n  camera:\n" + TiltMountYaml(mount);
  text += "# What these numbers rest on. No part of a rig file.\ncalibrated:\n";
  text += fmt::format(
      "  pictures: {}\n  board_residual_px: {:.4f}\n  chi2: {:.2f}\n"
      "  degrees_of_freedom: {}\n  sigma_factor: {:.4g}\n",
      result.pictures.size(),
      result.residual_px,
      found.chi2,
      found.dof,
      found.sigma_factor);
  text += "  # of the turn that is still missing, about the camera's axes\n  covariance_deg2: " +
          RowByRow(Eigen::Matrix3d(per_rad * per_rad * found.covariance), "{:.6e}") + "\n";
  text += FoundWithYaml(result.camera);
  text += "  up_in_board: " + RowByRow(found.up_in_board.transpose().eval(), "{:.9f}") + "\n";
  if (!result.up_was_given) {
    text += fmt::format("  up_sigma_deg: {:.5f}\n", RadToDeg(found.up_sigma_rad));
  }
  return text;
}

std::string TiltSummary(const TiltResult& result) {
  const Eigen::Vector3d sigma_deg =
      RadToDeg(1.0) * result.rotation.covariance.diagonal().cwiseSqrt();
  std::string text = fmt::format(
      "{} placements; sigma {:.4f} / {:.4f} / {:.4f} degrees about the camera's x / y / z; chi2 "
      "{:.1f} of {} degrees of freedom\n"
      "of one reading {:.4g} degrees: the largest that tilt.csv, or else --sigma-deg, says\n\n"
      "  reading off deg   expected   picture\n",
      result.pictures.size(),
      sigma_deg.x(),
      sigma_deg.y(),
      sigma_deg.z(),
      result.rotation.chi2,
      result.rotation.dof,
      result.sigma_deg);
  for (std::size_t i = 0; i < result.pictures.size(); ++i) {
    const TiltReading& reading = result.rotation.readings[i];
    text += fmt::format("{:>17.4f} {:>10.4f}   {}\n",
                        RadToDeg(reading.off_rad),
                        RadToDeg(reading.sigma_rad),
                        result.pictures[i]);
  }
  return text;
}

}  // namespace tbm
