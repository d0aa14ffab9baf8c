#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "guidance/app/calibrate_command.h"
#include "guidance/app/output_file.h"
#include "guidance/app/rig_report.h"
#include "guidance/config/calibration_parts.h"

namespace tbm {
namespace {

struct Parts {
  CameraPart camera;
  TiltPart tilt;
  TargetPart target;
  PointsPart points;
};

template <class Part>
bool Take(Result<Part, RigFileFaults> loaded, Part* part, const Console& console) {
  if (!loaded) {
    for (const RigFileFault& fault : loaded.error()) Complain(console, fault.Text());
    return false;
  }
  *part = std::move(loaded).value();
  return true;
}

// All four are read before anything is said to be good, so that one run finds all faults.
std::optional<Parts> ReadParts(const CalibrateRigRequest& request, const Console& console) {
  Parts parts;
  bool is_good = Take(LoadCameraPart(request.camera), &parts.camera, console);
  is_good = Take(LoadTiltPart(request.tilt), &parts.tilt, console) && is_good;
  is_good = Take(LoadTargetPart(request.target), &parts.target, console) && is_good;
  is_good = Take(LoadPointsPart(request.points), &parts.points, console) && is_good;
  if (!is_good) return std::nullopt;
  return parts;
}

// Two cameras' numbers for one parameter, and how far they may be apart: a thousandth of a pixel in
// the corner of an image.
struct LensNumber {
  const char* name;
  double own;
  double other;
  double most_apart;
};

// The first number that is not the same.
std::optional<LensNumber> Difference(const CameraModel& own, const CameraModel& other) {
  constexpr double kPixel = 1e-3;
  constexpr double kCoefficient = 1e-6;
  const std::array<LensNumber, 11> numbers = {
      {{"image_width", 1.0 * own.image_width_px, 1.0 * other.image_width_px, 0.5},
       {"image_height", 1.0 * own.image_height_px, 1.0 * other.image_height_px, 0.5},
       {"fx", own.fx_px, other.fx_px, kPixel},
       {"fy", own.fy_px, other.fy_px, kPixel},
       {"cx", own.cx_px, other.cx_px, kPixel},
       {"cy", own.cy_px, other.cy_px, kPixel},
       {"k1", own.k1, other.k1, kCoefficient},
       {"k2", own.k2, other.k2, kCoefficient},
       {"p1", own.p1, other.p1, kCoefficient},
       {"p2", own.p2, other.p2, kCoefficient},
       {"k3", own.k3, other.k3, kCoefficient}}};
  for (const LensNumber& number : numbers) {
    if (!(std::abs(number.own - number.other) < number.most_apart)) return number;
  }
  return std::nullopt;
}

// A rotation found with one camera file takes up what that file has wrong: with another it is
// wrong.
std::optional<RigFileFault> OtherCamera(const Parts& parts, const CalibrateRigRequest& request) {
  const auto difference = Difference(parts.camera.rig.camera, parts.tilt.camera);
  if (!difference) return std::nullopt;
  return RigFileFault{
      request.tilt,
      parts.tilt.camera_line,
      parts.tilt.camera_key,
      fmt::format("the rotation was found with another camera: {} is {} here and {} in {}; "
                  "run tbm calibrate tilt with --camera {}",
                  difference->name,
                  difference->other,
                  difference->own,
                  request.camera,
                  request.camera)};
}

std::optional<Rig> RigOf(Parts parts, const CalibrateRigRequest& request, const Console& console) {
  if (const auto fault = OtherCamera(parts, request)) {
    Complain(console, fault->Text());
    return std::nullopt;
  }
  Rig rig = std::move(parts.camera.rig);
  rig.name = request.name.empty() ? parts.points.rig_name : request.name;
  if (rig.name.empty()) {
    Complain(console,
             request.points + ": rig_name: missing; a name for this rig belongs there, or --name");
    return std::nullopt;
  }
  rig.camera_tilt = parts.tilt.mount;
  rig.leds = std::move(parts.target.leds);
  rig.target_tilt = parts.target.mount;
  rig.points = std::move(parts.points.points);
  return rig;
}

std::string Explain(const BudgetFailure& failure,
                    const CalibrateRigRequest& request,
                    const Rig& rig) {
  switch (failure.fault) {
    case BudgetFault::kNoFacing:
      return "which side of the LED board looks at the camera cannot be told from LEDs and points; "
             "--facing X Y Z says it, a direction in the target frame, more level than steep";
    case BudgetFault::kLooksUp:
      return fmt::format(
          "{}: inclinometers.camera.rotation: by it the camera looks steeply up or down when its "
          "inclinometer is level; its third row must be up in the camera's frame (x right, y down, "
          "z ahead), near [0, -1, 0]",
          request.tilt);
    case BudgetFault::kLedUnseen:
      return fmt::format(
          "--distance-m {}: LED {} lies outside the image from there; give the distance from "
          "camera "
          "to LEDs on the machine, or see that {} belongs to {}",
          request.distance_m,
          rig.leds[failure.led].id,
          request.target,
          request.camera);
    case BudgetFault::kNoPose:
      return fmt::format(
          "--distance-m {}: no pose can be had from there ({}); give the distance from camera to "
          "LEDs on the machine",
          request.distance_m,
          failure.pose_failure == PoseFailure::kNotObservable
              ? "its sigma would be beyond 1 degree or 100 mm"
              : "the solver finds none");
  }
  return "";
}

std::optional<BudgetPlacement> PlacementOf(const CalibrateRigRequest& request,
                                           const Rig& rig,
                                           const Console& console) {
  std::optional<Eigen::Vector3d> facing;
  if (request.facing.size() == 3) {
    facing = Eigen::Vector3d(request.facing[0], request.facing[1], request.facing[2]);
    if (!facing->allFinite() || !(facing->norm() > 1e-6) || !(facing->norm() < 1e6)) {
      Complain(console, "--facing must be three numbers, not all 0: x y z in the target frame");
      return std::nullopt;
    }
  }
  const auto placement = StraightAhead(rig, request.distance_m, facing);
  if (placement) return *placement;
  Complain(console, Explain(placement.error(), request, rig));
  return std::nullopt;
}

ExitCode WriteAll(const RigResult& result, const ReportFolder& report, const Console& console) {
  const CalibrateRigRequest& request = result.request;
  const std::string text = RigFileText(result);
  // Nobody is to find out on the machine.
  if (const auto again = ParseRig(text, request.out); !again) {
    for (const RigFileFault& fault : again.error()) Complain(console, fault.Text());
    return ExitCode::kInternal;
  }
  std::optional<std::string> fault;
  if (report.is_wanted()) fault = report.File("csv").Write(RigCsv(result));
  if (report.is_wanted() && !fault) fault = report.File("json").Write(RigJson(result));
  if (!fault) fault = OutputFile(request.out, request.force).Write(text);
  if (fault) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  if (request.out != "-") console.out << RigSummary(result);
  return ExitCode::kDone;
}

}  // namespace

ExitCode RunCalibrateRig(const CalibrateRigRequest& request, const Console& console) {
  const ReportFolder report(request.report, "rig", request.force);
  auto obstacle = OutputFile(request.out, request.force).Obstacle();
  if (!obstacle) obstacle = report.Obstacle({"csv", "json"});
  if (obstacle) {
    Complain(console, *obstacle);
    return ExitCode::kBadInput;
  }
  auto parts = ReadParts(request, console);
  if (!parts) return ExitCode::kBadInput;
  BudgetOptions options;
  options.centre_sigma_px = request.centre_sigma_px;
  options.intrinsics = parts->camera.intrinsics;
  const auto rig = RigOf(std::move(*parts), request, console);
  if (!rig) return ExitCode::kBadInput;
  const auto placement = PlacementOf(request, *rig, console);
  if (!placement) return ExitCode::kBadInput;
  auto budgets = BudgetOf(*rig, *placement, options);
  if (!budgets) {
    Complain(console, Explain(budgets.error(), request, *rig));
    return ExitCode::kBadInput;
  }
  if (!options.intrinsics) {
    Complain(
        console,
        fmt::format("warning: {}: calibrated.covariance: missing; what the distortion is worth "
                    "is not known (tbm calibrate camera writes it)",
                    request.camera));
  }
  return WriteAll({request, *rig, *placement, options.intrinsics.has_value(), std::move(*budgets)},
                  report,
                  console);
}

}  // namespace tbm
