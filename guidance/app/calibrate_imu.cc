#include <cmath>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "guidance/app/calibrate_command.h"
#include "guidance/app/rail_run_for.h"
#include "guidance/app/rail_start_words.h"
#include "guidance/config/rail_file.h"
#include "guidance/config/rail_file_text.h"
#include "guidance/rail/mounting_calibration.h"
#include "pose/base/angle.h"
#include "pose/base/length.h"

namespace tbm {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kMsPerSecond = 1e3;

struct MountingSigma {
  Eigen::Vector3d rotation_deg;  // about the camera's axes
  Eigen::Vector3d position_mm;   // along the unit's axes
  double time_offset_ms = 0.0;
};

MountingSigma SigmaOf(const MountingCalibration& found) {
  const auto sigma = found.covariance.diagonal().cwiseSqrt();
  return {RadToDeg(1.0) * sigma.segment<3>(MountingCalibration::kRotation),
          kMmPerMetre * sigma.segment<3>(MountingCalibration::kPosition),
          kMsPerSecond * sigma[MountingCalibration::kTimeOffset]};
}

MountingLimits LimitsOf(const CalibrateImuRequest& request) {
  MountingLimits limits;
  limits.first_rotation_rad = DegToRad(request.first_rotation_deg);
  limits.first_position_m = request.first_position_mm / kMmPerMetre;
  limits.first_time_offset_s = request.first_time_offset_ms / kMsPerSecond;
  return limits;
}

std::string Three(const Eigen::Vector3d& v, int digits) {
  return fmt::format("{:.{}f} / {:.{}f} / {:.{}f}", v.x(), digits, v.y(), digits, v.z(), digits);
}

const char* Name(MountingWeakness weakness) {
  switch (weakness) {
    case MountingWeakness::kTimeOffset:
      return "the offset of the clocks";
    case MountingWeakness::kRotation:
      return "the rotation";
    case MountingWeakness::kPosition:
      return "the lever arm";
  }
  return "";
}

std::string Explain(const MountingFailure& failure,
                    const std::string& folder,
                    const RailSetup& setup) {
  switch (failure.fault) {
    case MountingFault::kNoCamera:
      return folder +
             "/rail.yaml: has no section camera: its lens, and about how it is built in, must "
             "stand "
             "there";
    case MountingFault::kTooFewImages:
      return folder +
             "/centres.csv: fewer than ten images show four targets or more, or none does while "
             "the "
             "trolley rests at first";
    case MountingFault::kStart:
      return folder + "/" + Explain(failure.start, setup);
    case MountingFault::kDegenerate: {
      std::string text = folder + ": no calibration";
      const char* joint = ": ";
      for (const MountingWeakness weak : failure.weak) {
        text += fmt::format("{}the run does not tell {}: {}",
                            std::exchange(joint, "; "),
                            Name(weak),
                            MissingMotion(weak));
      }
      return text;
    }
    case MountingFault::kDoesNotFit:
      return fmt::format(
          "{}: no calibration: the points lie {:.1f} times as far off as residual_px and the "
          "survey "
          "allow, or more than a tenth of them fit nothing: another lens, targets moved or names "
          "exchanged",
          folder,
          std::sqrt(failure.chi2_per_dof));
    case MountingFault::kDoesNotSettle:
      return folder +
             "/rail.yaml: camera: no calibration: rotation, position_m or time_offset_s "
             "are too far off as a first guess";
  }
  return "";
}

RailCamera CameraOf(const RailCamera& lens, const MountingCalibration& found) {
  const MountingSigma sigma = SigmaOf(found);
  RailCamera camera = lens;
  camera.camera_from_imu = found.camera_from_imu;
  camera.in_imu_m = found.camera_in_imu_m;
  camera.time_offset_s = found.time_offset_s;
  // The file has one number for three axes: the largest.
  camera.sigma_rotation_rad = DegToRad(sigma.rotation_deg.maxCoeff());
  camera.sigma_position_m = sigma.position_mm.maxCoeff() / kMmPerMetre;
  camera.sigma_time_offset_s = sigma.time_offset_ms / kMsPerSecond;
  return camera;
}

std::vector<std::string> Remarks(const std::string& run, const MountingCalibration& found) {
  const MountingSigma sigma = SigmaOf(found);
  return {
      fmt::format("By tbm calibrate imu from {}: {} images, {} of {} points, chi2 / dof {:.3f}.",
                  Quoted(run),
                  found.images,
                  found.points - found.points_left_out,
                  found.points,
                  found.chi2 / found.dof),
      fmt::format("Sigma about x / y / z of the camera: {} deg; along those of the unit: {} mm.",
                  Three(sigma.rotation_deg, 4),
                  Three(sigma.position_mm, 2)),
      "Not for the line of that run itself: its points would count twice."};
}

// rail.yaml as it was, with another camera. Fails where the section does not stand for itself.
std::optional<std::string> NewRailYaml(const std::string& file,
                                       const std::string& section,
                                       const Console& console) {
  const auto old = ReadTextFile(file, 1 << 20);
  if (!old) {
    Complain(console, old.error().Text());
    return std::nullopt;
  }
  auto text = WithSection(*old, "camera", section);
  if (text && ParseRailSetup(*text, file)) return text;
  Complain(
      console,
      file + ": camera: must begin a line, with its keys indented in lines of their own below");
  return std::nullopt;
}

std::string Report(const std::string& run, const MountingCalibration& found) {
  const MountingSigma sigma = SigmaOf(found);
  const auto three = [](const Eigen::Vector3d& v) { return Json{v.x(), v.y(), v.z()}; };
  Json report;
  report["run"] = run;
  report["images"] = found.images;
  report["points"] = found.points;
  report["points_left_out"] = found.points_left_out;
  report["rounds"] = found.rounds;
  report["chi2"] = found.chi2;
  report["dof"] = found.dof;
  report["sigma_rotation_deg"] = three(sigma.rotation_deg);
  report["sigma_position_mm"] = three(sigma.position_mm);
  report["sigma_time_offset_ms"] = sigma.time_offset_ms;
  report["gyro_bias_rad_s"] = three(found.gyro_bias_rad_s);
  report["accel_bias_m_s2"] = three(found.accel_bias_m_s2);
  report["covariance_of"] = {
      "gyro_bias_rad_s 3", "accel_bias_m_s2 3", "time_offset_s", "rotation_rad 3", "position_m 3"};
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < found.covariance.rows(); ++i) {
    Json row = Json::array();
    for (Eigen::Index k = 0; k < found.covariance.cols(); ++k)
      row.push_back(found.covariance(i, k));
    rows.push_back(std::move(row));
  }
  report["covariance"] = std::move(rows);
  return report.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

std::string Summary(const RailCamera& first, const MountingCalibration& found) {
  const MountingSigma sigma = SigmaOf(found);
  const Eigen::AngleAxisd turned(found.camera_from_imu * first.camera_from_imu.conjugate());
  return fmt::format(
      "{} images, {} points, {} left out; chi2 / dof {:.3f}\n"
      "  rotation    +- {} deg about the camera's x / y / z; {:.3f} deg from what rail.yaml said\n"
      "  position    {} mm in the unit's frame, +- {}; {:.1f} mm from what rail.yaml said\n"
      "  time offset {:.3f} ms, +- {:.3f}\n",
      found.images,
      found.points,
      found.points_left_out,
      found.chi2 / found.dof,
      Three(sigma.rotation_deg, 4),
      RadToDeg(turned.angle()),
      Three(kMmPerMetre * found.camera_in_imu_m, 2),
      Three(sigma.position_mm, 2),
      kMmPerMetre * (found.camera_in_imu_m - first.in_imu_m).norm(),
      kMsPerSecond * found.time_offset_s,
      sigma.time_offset_ms);
}

}  // namespace

ExitCode RunCalibrateImu(const CalibrateImuRequest& request, const Console& console) {
  const TableAndReport files(request.out, request.force);
  const auto run = RailRunFor(request.run, files, console);
  if (!run) return ExitCode::kBadInput;
  for (const std::string& advice : run->advice) Complain(console, "warning: " + advice);
  const auto found = CalibrateMounting(run->setup, run->recording, LimitsOf(request));
  if (!found) {
    Complain(console, Explain(found.error(), request.run, run->setup));
    return ExitCode::kBadInput;
  }
  const RailCamera& first = *run->setup.camera;
  const auto yaml =
      NewRailYaml(request.run + "/rail.yaml",
                  RailCameraYaml(CameraOf(first, *found), Remarks(request.run, *found)),
                  console);
  if (!yaml) return ExitCode::kBadInput;
  if (const auto fault = files.Write(*yaml, Report(request.run, *found))) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  if (files.has_report()) console.out << Summary(first, *found);
  return ExitCode::kDone;
}

}  // namespace tbm
