#include "pose/solve/published_study.h"

#include <bit>
#include <cmath>
#include <numbers>
#include <optional>
#include <string>

#include <Eigen/LU>

#include "pose/base/angle.h"
#include "pose/solve/linearised.h"
#include "pose/solve/penalty_pose.h"
#include "pose/solve/solve_pose.h"

namespace tbm {
namespace {

// Relative poses: the target faces the camera within these.
constexpr double kLateralM = 0.2;
constexpr double kRelativeAngleDeg = 3.0;
constexpr double kCameraTiltDeg = 3.0;

// SplitMix64 (Steele, Lea and Flood 2014), counted from a hash of the case and the draw.
class Stream {
 public:
  Stream(const StudyCase& study, std::int64_t draw)
      : state_(Mixed(Mixed(study.seed) ^ std::bit_cast<std::uint64_t>(study.centre_sigma_px)) ^
               Mixed(static_cast<std::uint64_t>(draw) + 0x632BE59BD9B4E019ull)) {}

  // (0, 1)
  double Unit() { return (static_cast<double>(Next() >> 11) + 0.5) * 0x1.0p-53; }
  double Within(double limit) { return limit * (2.0 * Unit() - 1.0); }
  // Box and Muller.
  Eigen::Vector2d Normal2(double sigma) {
    const double radius = sigma * std::sqrt(-2.0 * std::log(Unit()));
    const double angle_rad = 2.0 * std::numbers::pi * Unit();
    return {radius * std::cos(angle_rad), radius * std::sin(angle_rad)};
  }

 private:
  static std::uint64_t Mixed(std::uint64_t x) {
    x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ull;
    x = (x ^ (x >> 27)) * 0x94D049BB133111EBull;
    return x ^ (x >> 31);
  }
  std::uint64_t Next() { return Mixed(state_ += 0x9E3779B97F4A7C15ull); }

  std::uint64_t state_;
};

struct Truth {
  Rigid3 camera_from_target;
  Eigen::Vector3d up_in_camera;
};

Truth DrawTruth(const StudyCase& study, Stream& random) {
  const auto turn = [&](double limit_deg, const Eigen::Vector3d& axis) {
    return Eigen::AngleAxisd(random.Within(DegToRad(limit_deg)), axis);
  };
  Truth truth;
  // Facing the camera with y up: half a turn about x.
  const Eigen::Quaterniond facing(0.0, 1.0, 0.0, 0.0);
  const auto about_z = turn(kRelativeAngleDeg, Eigen::Vector3d::UnitZ());
  const auto about_y = turn(kRelativeAngleDeg, Eigen::Vector3d::UnitY());
  const auto about_x = turn(kRelativeAngleDeg, Eigen::Vector3d::UnitX());
  truth.camera_from_target.rotation = (about_z * about_y * about_x * facing).normalized();
  truth.camera_from_target.translation.x() = random.Within(kLateralM);
  truth.camera_from_target.translation.y() = random.Within(kLateralM);
  truth.camera_from_target.translation.z() = study.distance_m;
  const auto camera_roll = turn(kCameraTiltDeg, Eigen::Vector3d::UnitZ());
  const auto camera_pitch = turn(kCameraTiltDeg, Eigen::Vector3d::UnitX());
  truth.up_in_camera = camera_roll * (camera_pitch * -Eigen::Vector3d::UnitY());
  return truth;
}

TiltObservation Measure(const TiltMount& mount,
                        const Eigen::Vector3d& up_in_body,
                        double sigma_rad,
                        Stream& random) {
  const Inclination exact = InclinationFromUp(mount.tilt_from_body * up_in_body);
  const Eigen::Vector2d noise = random.Normal2(sigma_rad);
  return {{exact.beta_rad + noise.x(), exact.gamma_rad + noise.y()}, sigma_rad};
}

std::optional<PoseProblem> DrawProblem(const Rig& rig,
                                       const StudyCase& study,
                                       const Truth& truth,
                                       Stream& random) {
  PoseProblem problem;
  problem.rig = &rig;
  for (std::size_t i = 0; i < rig.leds.size(); ++i) {
    const auto seen = Project(rig.camera, truth.camera_from_target * rig.leds[i].p_led_in_target);
    if (!seen) return std::nullopt;
    problem.leds.push_back({static_cast<int>(i),
                            seen->pixel_px + random.Normal2(study.centre_sigma_px),
                            study.centre_sigma_px});
  }
  const Eigen::Vector3d up_in_target =
      truth.camera_from_target.rotation.conjugate() * truth.up_in_camera;
  problem.target_tilt = Measure(rig.target_tilt, up_in_target, study.tilt_sigma_rad, random);
  problem.camera_tilt = Measure(rig.camera_tilt, truth.up_in_camera, study.tilt_sigma_rad, random);
  return problem;
}

// omega, phi, kappa of R = R_kappa R_phi R_omega, then the translation.
Eigen::Matrix<double, 6, 1> AsEuler(const Rigid3& pose) {
  const Eigen::Matrix3d r = pose.rotation.toRotationMatrix();
  Eigen::Matrix<double, 6, 1> euler;
  euler << std::atan2(r(2, 1), r(2, 2)), std::asin(-r(2, 0)), std::atan2(r(1, 0), r(0, 0)),
      pose.translation;
  return euler;
}

// Derivative of AsEuler by the error vector of rigid3.h: a turn about the camera's axes is
// omega' R_kappa R_phi x + phi' R_kappa y + kappa' z.
Eigen::Matrix<double, 6, 6> EulerByError(const Rigid3& pose) {
  const Eigen::Matrix<double, 6, 1> euler = AsEuler(pose);
  const Eigen::AngleAxisd about_z(euler[2], Eigen::Vector3d::UnitZ());
  const Eigen::AngleAxisd about_y(euler[1], Eigen::Vector3d::UnitY());
  Eigen::Matrix3d turn_by_euler;
  turn_by_euler.col(0) = about_z * (about_y * Eigen::Vector3d::UnitX());
  turn_by_euler.col(1) = about_z * Eigen::Vector3d::UnitY();
  turn_by_euler.col(2) = Eigen::Vector3d::UnitZ();
  Eigen::Matrix<double, 6, 6> derivative = Eigen::Matrix<double, 6, 6>::Identity();
  derivative.topLeftCorner<3, 3>() = turn_by_euler.inverse();
  return derivative;
}

double Wrapped(double angle_rad) { return std::remainder(angle_rad, 2.0 * std::numbers::pi); }

void AddEstimate(const PoseResult& result, const Rigid3& truth, StudySums::Method& sums) {
  if (!result) {
    ++sums.refused;
    return;
  }
  ++sums.solved;
  Eigen::Matrix<double, 6, 1> error = AsEuler(result->camera_from_target) - AsEuler(truth);
  for (int axis = 0; axis < 3; ++axis) error[axis] = Wrapped(error[axis]);
  for (std::size_t axis = 0; axis < kStudyAxes; ++axis) {
    const double e = error[static_cast<Eigen::Index>(axis)];
    sums.error[axis] += e;
    sums.absolute[axis] += std::abs(e);
    sums.squared[axis] += e * e;
  }
}

// At the truth; the noise of the problem moves the linearisation by less than a thousandth.
void AddBound(const PoseProblem& problem,
              const Rigid3& truth,
              bool with_tilts,
              StudySums::Method& sums) {
  const auto linear = Linearise(problem, truth, with_tilts);
  if (!linear) return;
  const Eigen::Matrix<double, 6, 6> information =
      linear->by_pose.transpose() * linear->covariance.inverse() * linear->by_pose;
  const Eigen::Matrix<double, 6, 6> by_error = EulerByError(truth);
  const Eigen::Matrix<double, 6, 6> bound = by_error * information.inverse() * by_error.transpose();
  for (std::size_t axis = 0; axis < kStudyAxes; ++axis) {
    const auto i = static_cast<Eigen::Index>(axis);
    sums.bound_variance[axis] += bound(i, i);
  }
}

StudySums::Method& Of(StudySums& sums, StudyMethod method) {
  return sums.methods[static_cast<std::size_t>(method)];
}

}  // namespace

Rig PublishedStudyRig() {
  Rig rig;
  rig.name = "pose paper, section 4.1";
  rig.camera.image_width_px = 1280;
  rig.camera.image_height_px = 1024;
  rig.camera.fx_px = rig.camera.fy_px = 16.0 / 0.0053;
  rig.camera.cx_px = 639.5;
  rig.camera.cy_px = 511.5;
  const std::array<Eigen::Vector3d, 5> p_led_in_target_mm = {Eigen::Vector3d(-250, 0, 100),
                                                             Eigen::Vector3d(250, 0, 100),
                                                             Eigen::Vector3d(0, 250, 0),
                                                             Eigen::Vector3d(0, -250, 0),
                                                             Eigen::Vector3d(80, 80, 250)};
  for (std::size_t i = 0; i < p_led_in_target_mm.size(); ++i) {
    rig.leds.push_back({"P" + std::to_string(i + 1), 1e-3 * p_led_in_target_mm[i], 0.0});
  }
  // Both plates lie level when the camera looks along the tunnel and the board stands upright.
  rig.target_tilt.tilt_from_body << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  rig.camera_tilt.tilt_from_body << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  rig.points.push_back({"shield_head", {0.0, 0.0, -1.6}, 0.0});
  return rig;
}

StudySums RunPublishedStudy(const StudyCase& study, std::int64_t first, std::int64_t last) {
  const Rig rig = PublishedStudyRig();
  StudySums sums;
  for (std::int64_t draw = first; draw < last; ++draw) {
    Stream random(study, draw);
    const Truth truth = DrawTruth(study, random);
    const auto problem = DrawProblem(rig, study, truth, random);
    if (!problem) continue;
    const Rigid3& exact = truth.camera_from_target;
    AddEstimate(SolveVision(*problem), exact, Of(sums, StudyMethod::kVision));
    AddEstimate(SolveFused(*problem), exact, Of(sums, StudyMethod::kFused));
    AddBound(*problem, exact, false, Of(sums, StudyMethod::kVision));
    AddBound(*problem, exact, true, Of(sums, StudyMethod::kFused));
    if (study.with_published) {
      AddEstimate(PenaltyPose(*problem), exact, Of(sums, StudyMethod::kPublished));
    }
  }
  return sums;
}

void Merge(const StudySums& more, StudySums& sums) {
  for (std::size_t m = 0; m < kStudyMethods; ++m) {
    const StudySums::Method& from = more.methods[m];
    StudySums::Method& to = sums.methods[m];
    to.solved += from.solved;
    to.refused += from.refused;
    for (std::size_t axis = 0; axis < kStudyAxes; ++axis) {
      to.error[axis] += from.error[axis];
      to.absolute[axis] += from.absolute[axis];
      to.squared[axis] += from.squared[axis];
      to.bound_variance[axis] += from.bound_variance[axis];
    }
  }
}

StudyRow Summarise(const StudySums& sums, StudyMethod method) {
  const StudySums::Method& of = sums.methods[static_cast<std::size_t>(method)];
  const bool is_vision = method == StudyMethod::kVision;
  const StudySums::Method& bound = sums.methods[static_cast<std::size_t>(
      is_vision ? StudyMethod::kVision : StudyMethod::kFused)];
  StudyRow row;
  row.solved = of.solved;
  row.refused = of.refused;
  const double solved = static_cast<double>(of.solved);
  const double drawn = static_cast<double>(bound.solved + bound.refused);
  for (std::size_t axis = 0; axis < kStudyAxes; ++axis) {
    row.rmse[axis] = std::sqrt(of.squared[axis] / solved);
    row.mean[axis] = of.error[axis] / solved;
    row.mean_absolute[axis] = of.absolute[axis] / solved;
    row.bound[axis] = std::sqrt(bound.bound_variance[axis] / drawn);
  }
  return row;
}

}  // namespace tbm
