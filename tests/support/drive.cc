#include "tests/support/drive.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "pose/solve/solve_pose.h"
#include "tests/support/scene.h"

namespace tbm::test {
namespace {

// The drawing of guidance/app/example/axis.xml, once more by hand.
constexpr double kStart_m = 2000.0;
constexpr Real kCurve_per_m = -1.0L / 400.0L;  // to the right
constexpr Real kStartHeading = (90.0L - 40.0L) * kPiL / 180.0L;

Real CurvatureAt(Real s) {
  if (s < 150) return 0;
  if (s < 210) return kCurve_per_m * (s - 150) / 60;
  if (s < 360) return kCurve_per_m;
  if (s < 420) return kCurve_per_m * (420 - s) / 60;
  return 0;
}

// Down by 1.5 per cent, a parabola of 150 m about 240 m, up by 2 per cent.
double HeightAt(double s) {
  if (s < 165.0) return 100.0 - 0.015 * s;
  if (s < 315.0) {
    const double u = s - 165.0;
    return 100.0 - 0.015 * 165.0 - 0.015 * u + 0.035 / (2.0 * 150.0) * u * u;
  }
  return 103.6 - 0.02 * (600.0 - s);
}
double GradientAt(double s) {
  if (s < 165.0) return -0.015;
  if (s < 315.0) return -0.015 + 0.035 * (s - 165.0) / 150.0;
  return 0.02;
}

Timestamp After(Timestamp start, double s) {
  return {start.ns + static_cast<std::int64_t>(s * 1e9)};
}

}  // namespace

std::string_view WordsOf(ErrorSource source) {
  switch (source) {
    case ErrorSource::kStationReading:
      return "total station, reading";
    case ErrorSource::kStationSetUp:
      return "total station, set-up";
    case ErrorSource::kPrisms:
      return "prisms in the rear shield";
    case ErrorSource::kCameraPlace:
      return "camera in the rear shield";
    case ErrorSource::kBoardPlace:
      return "board and cutter in the front shield";
    case ErrorSource::kLedCentres:
      return "LED centres in the image";
    case ErrorSource::kCameraModel:
      return "camera calibration";
    case ErrorSource::kLedPlaces:
      return "LEDs on the board";
    case ErrorSource::kTiltReading:
      return "inclinometers, reading";
    case ErrorSource::kTiltMounting:
      return "inclinometers, mounting";
  }
  return "";
}

GuidedMachine ExampleMachine() {
  MachineFaults warnings;
  const std::string example = TBM_SOURCE_DIR "/guidance/app/example/";
  const auto read = [](const std::string& path) {
    ReadFile file{path, {}};
    std::FILE* stream = std::fopen(path.c_str(), "rb");
    TBM_CHECK(stream != nullptr);
    for (int c = std::fgetc(stream); c != EOF; c = std::fgetc(stream)) {
      file.content.push_back(static_cast<char>(c));
    }
    std::fclose(stream);
    return file;
  };
  auto machine = ParseGuidedMachine(read(example + "machine.yaml"),
                                    read(TBM_SOURCE_DIR "/pose/app/example/rig.yaml"),
                                    read(example + "axis.xml"),
                                    &warnings);
  if (!machine) {
    for (const std::string& fault : machine.error()) std::fprintf(stderr, "%s\n", fault.c_str());
  }
  TBM_CHECK(machine.has_value());
  return std::move(machine).value();
}

Drive::Drive(const GuidedMachine& machine, const DriveNoise& noise, std::string_view stream)
    : machine_(machine),
      noise_(noise),
      random_(stream),
      core_(machine_.machine, machine_.rig, machine_.axis),
      front_{0.0, {1000.0L, 5000.0L, kStartHeading}},
      rear_(front_) {}

Drive::Foot Drive::FootAt(Walker& walker, double chainage_m) const {
  const double to = chainage_m - kStart_m;
  for (const double joint : {150.0, 210.0, 360.0, 420.0, to}) {
    const double next = std::min(joint, to);
    if (next <= walker.at_m) continue;
    walker.state = Integrate(CurvatureAt, walker.state, walker.at_m, next);
    walker.at_m = next;
  }
  return {{static_cast<double>(walker.state.x), static_cast<double>(walker.state.y), HeightAt(to)},
          static_cast<double>(walker.state.heading),
          GradientAt(to)};
}

// A shield whose point `datum_in_shield` stands beside a foot of the axis, and which points about
// along it.
Rigid3 Drive::Beside(const Foot& foot,
                     double right_m,
                     double up_m,
                     const Eigen::Vector3d& datum_in_shield) {
  const double heading = foot.heading_rad + random_.Uniform(-4e-3, 4e-3);
  const double pitch = std::atan(foot.gradient) + random_.Uniform(-4e-3, 4e-3);
  const double roll = random_.Uniform(-8e-3, 8e-3);
  const Eigen::Quaterniond turned = Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitZ()) *
                                    Eigen::AngleAxisd(-pitch, Eigen::Vector3d::UnitY()) *
                                    Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX());
  const Eigen::Vector3d to_right(std::sin(foot.heading_rad), -std::cos(foot.heading_rad), 0.0);
  const Eigen::Vector3d p = foot.p_in_site + right_m * to_right + up_m * Eigen::Vector3d::UnitZ();
  return {turned, p - turned * datum_in_shield};
}

Eigen::Vector3d Drive::Drawn3(ErrorSource source, double sigma) {
  const Eigen::Vector3d drawn = random_.Normal3(sigma);
  return Has(source) ? drawn : Eigen::Vector3d::Zero();
}
double Drive::Drawn(ErrorSource source, double sigma) {
  const double drawn = random_.Normal(sigma);
  return Has(source) ? drawn : 0.0;
}

Rigid3 Drive::Built(ErrorSource source, const UncertainRigid3& drawing) {
  PoseError e;
  for (int i = 0; i < 6; ++i) e[i] = Drawn(source, std::sqrt(drawing.covariance(i, i)));
  const Eigen::Vector3d turn = e.head<3>();
  const double angle = turn.norm();
  const Eigen::Quaterniond turned = angle > 0.0
                                        ? Eigen::Quaterniond(Eigen::AngleAxisd(angle, turn / angle))
                                        : Eigen::Quaterniond::Identity();
  return {turned * drawing.b_from_a.rotation, drawing.b_from_a.translation + e.tail<3>()};
}

Rig Drive::BuiltRig() {
  Rig built = machine_.rig;
  for (Led& led : built.leds) led.p_led_in_target += Drawn3(ErrorSource::kLedPlaces, led.sigma_m);
  double* const intrinsics[] = {
      &built.camera.fx_px, &built.camera.fy_px, &built.camera.cx_px, &built.camera.cy_px};
  for (int i = 0; i < 4; ++i) {
    *intrinsics[i] += Drawn(ErrorSource::kCameraModel, machine_.rig.intrinsics_sigma_px[i]);
  }
  for (TiltMount* mount : {&built.target_tilt, &built.camera_tilt}) {
    const Eigen::Vector3d turn = Drawn3(ErrorSource::kTiltMounting, mount->mounting_sigma_rad);
    const double angle = turn.norm();
    if (angle > 0.0) {
      mount->tilt_from_body =
          mount->tilt_from_body * Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
    }
  }
  return built;
}

void Drive::SeeTilts(const Rig& built,
                     const Eigen::Vector3d& up_in_camera,
                     std::optional<Eigen::Vector3d> up_in_target,
                     Timestamp around) {
  const auto see = [&](TiltPlace place, const TiltMount& mount, const Eigen::Vector3d& up) {
    for (int i = -5; i < 5; ++i) {
      Inclination reading = ExactInclination(mount, up);
      reading.beta_rad += Drawn(ErrorSource::kTiltReading, mount.sigma_rad);
      reading.gamma_rad += Drawn(ErrorSource::kTiltReading, mount.sigma_rad);
      inputs_.push_back(TiltSeen{place, After(around, 0.1 * i), reading});
    }
  };
  see(TiltPlace::kCamera, built.camera_tilt, up_in_camera);
  if (up_in_target) see(TiltPlace::kTarget, built.target_tilt, *up_in_target);
}

void Drive::SeePrisms(const Rigid3& site_from_rear,
                      const Rig& built,
                      const Rigid3& rear_from_camera,
                      RelativeSeen board) {
  // Behind the machine, on the wall.
  const Eigen::Vector3d back = site_from_rear.rotation * Eigen::Vector3d(-1.0, 0.02, 0.005);
  Station believed;
  believed.p_axes_in_site = site_from_rear.translation + noise_.station_distance_m * back;
  believed.circle_zero_bearing_rad = 0.7;
  Station station = believed;
  station.p_axes_in_site += Drawn3(ErrorSource::kStationSetUp, noise_.station_m);
  station.circle_zero_bearing_rad += Drawn(ErrorSource::kStationSetUp, noise_.station_zero_rad);
  SetUpKnown set_up;
  set_up.number = ++set_up_number_;
  set_up.covariance.diagonal() << Eigen::Vector3d::Constant(noise_.station_m * noise_.station_m),
      noise_.station_zero_rad * noise_.station_zero_rad;
  inputs_.push_back(set_up);

  const Eigen::Vector3d up_in_camera =
      rear_from_camera.rotation.conjugate() *
      (site_from_rear.rotation.conjugate() * Eigen::Vector3d::UnitZ());
  const SightModel sight;
  for (std::size_t i = 0; i < machine_.machine.prisms.size(); ++i) {
    const ShieldPrism& prism = machine_.machine.prisms[i].prism;
    const Eigen::Vector3d p_in_rear =
        prism.p_in_rear_shield + Drawn3(ErrorSource::kPrisms, prism.sigma_m);
    auto reading = Sight(station, site_from_rear * p_in_rear, sight);
    TBM_CHECK(reading.has_value());
    const double slope_sigma_m = noise_.slope_m + 1e-6 * noise_.slope_ppm * *reading->slope_m;
    PolarReading seen = *reading;
    seen.circle_rad +=
        Drawn(ErrorSource::kStationReading, noise_.angle_rad) / std::sin(seen.zenith_rad);
    seen.zenith_rad += Drawn(ErrorSource::kStationReading, noise_.angle_rad);
    *seen.slope_m += Drawn(ErrorSource::kStationReading, slope_sigma_m);
    const auto p = PointSighted(believed, seen, sight);
    TBM_CHECK(p.has_value());
    const SightedCovariance covariance =
        CovarianceSighted(believed, *p, sight, {noise_.angle_rad, noise_.angle_rad, slope_sigma_m});
    SeeTilts(built, up_in_camera, {}, now_);
    board.sensed_at = now_;  // the camera goes on while the station measures
    inputs_.push_back(board);
    inputs_.push_back(
        PrismSeen{set_up.number, i, now_, *p, covariance.of_reading, covariance.by_station});
    now_ = After(now_, 4.0);
  }
}

RelativeSeen Drive::SeeBoard(const Rig& built,
                             const Rigid3& camera_from_target,
                             const Eigen::Vector3d& up_in_camera) {
  PoseProblem problem = ExactProblem(built, {camera_from_target, up_in_camera});
  for (LedObservation& led : problem.leds) {
    for (int axis = 0; axis < 2; ++axis) {
      led.pixel_px[axis] += Drawn(ErrorSource::kLedCentres, noise_.centre_px) +
                            Drawn(ErrorSource::kCameraModel, machine_.rig.calibration_residual_px);
    }
    led.sigma_px = noise_.centre_px;
  }
  for (auto* tilt : {&problem.target_tilt, &problem.camera_tilt}) {
    (*tilt)->sigma_rad = machine_.rig.camera_tilt.sigma_rad;
    (*tilt)->inclination.beta_rad += Drawn(ErrorSource::kTiltReading, (*tilt)->sigma_rad);
    (*tilt)->inclination.gamma_rad += Drawn(ErrorSource::kTiltReading, (*tilt)->sigma_rad);
  }
  problem.rig = &machine_.rig;
  RelativeSeen seen;
  const auto pose = SolveFused(problem);
  if (pose) {
    seen.status = PoseStatus::kOk;
    seen.camera_from_target = {pose->camera_from_target, pose->covariance};
    seen.tilts_used = true;
  }
  return seen;
}

Drive::Epoch Drive::Measure(double chainage_m) {
  Epoch epoch;
  inputs_.clear();
  now_ = After(now_, 300.0);
  const Machine& machine = machine_.machine;
  const MachinePoint& cutter = machine.points[machine.steer_by];
  // The drawing says where the cutter's centre is; this machine's is a little elsewhere.
  const Eigen::Vector3d cutter_in_front =
      cutter.p_in_shield + Drawn3(ErrorSource::kBoardPlace, cutter.sigma_m);
  epoch.chainage_m = chainage_m;
  epoch.right_m = random_.Uniform(-0.03, 0.03);
  epoch.up_m = random_.Uniform(-0.03, 0.03);
  const Rigid3 site_from_front =
      Beside(FootAt(front_, chainage_m), epoch.right_m, epoch.up_m, cutter_in_front);
  const double joint_m = machine.closed_joint_m.value_or(0.0) + random_.Uniform(0.0, 1.2);
  const Rigid3 site_from_rear = Beside(FootAt(rear_, chainage_m - joint_m - cutter.p_in_shield.x()),
                                       random_.Uniform(-0.03, 0.03),
                                       random_.Uniform(-0.03, 0.03),
                                       Eigen::Vector3d::Zero());
  const Rig built = BuiltRig();
  const Rigid3 rear_from_camera =
      Built(ErrorSource::kCameraPlace, machine.geometry.rear_shield_from_camera);
  const Rigid3 front_from_target =
      Built(ErrorSource::kBoardPlace, machine.geometry.front_shield_from_target);
  const Rigid3 camera_from_target =
      Inverse(site_from_rear * rear_from_camera) * site_from_front * front_from_target;
  const Eigen::Vector3d up_in_camera =
      (site_from_rear * rear_from_camera).rotation.conjugate() * Eigen::Vector3d::UnitZ();

  RelativeSeen board = SeeBoard(built, camera_from_target, up_in_camera);
  SeePrisms(site_from_rear, built, rear_from_camera, board);
  now_ = After(now_, random_.Uniform(0.0, 10.0));
  SeeTilts(built, up_in_camera, camera_from_target.rotation.conjugate() * up_in_camera, now_);
  board.sensed_at = now_;
  inputs_.push_back(board);
  now_ = After(now_, 0.1);
  epoch.snapshot = core_.Advance(inputs_, now_);
  return epoch;
}

}  // namespace tbm::test
