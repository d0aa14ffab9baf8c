#include "pose/solve/penalty_pose.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include <Eigen/LU>
#include <Eigen/SVD>
#include <ceres/autodiff_cost_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "pose/solve/linearised.h"
#include "pose/solve/observable.h"
#include "pose/solve/rows.h"
#include "pose/solve/start_pose.h"

namespace tbm {
namespace {

// Side of a pixel of the paper's camera. It turns pixels into the millimetres in which M = 1e6 is
// meant; with M that hard, another camera's pixel size makes no difference that could be seen.
constexpr double kPixelMm = 0.0053;
constexpr int kMaxIterations = 200;

using Twelve = std::array<double, 12>;  // r1 .. r9 row by row, t1 t2 t3 [mm]

// R^b = R_phi R_omega of the paper: levels a body whose up vector is known, yaw left out. Its third
// row is that up vector (Eq. 13). atan2 where Eq. 12 prints arctan, which flips for a forward
// camera.
Eigen::Matrix3d LevelFromBody(const Eigen::Vector3d& up) {
  const double phi = std::asin(std::clamp(-up.x(), -1.0, 1.0));
  const double omega = std::atan2(up.y(), up.z());
  return (Eigen::AngleAxisd(phi, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(omega, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

// f_i1 and f_i2 of Eq. 15, [mm] on the sensor.
struct ImageResidual {
  Eigen::Vector2d seen_mm;
  Eigen::Vector2d focal_mm;
  Eigen::Vector3d p_led_in_target_mm;

  template <class T>
  bool operator()(const T* x, T* residual) const {
    const Eigen::Vector3d& p = p_led_in_target_mm;
    const T depth = x[6] * p.x() + x[7] * p.y() + x[8] * p.z() + x[11];
    for (int i = 0; i < 2; ++i) {
      const T* row = x + 3 * i;
      const T side = row[0] * p.x() + row[1] * p.y() + row[2] * p.z() + x[9 + i];
      residual[i] = seen_mm[i] - focal_mm[i] * side / depth;
    }
    return true;
  }
};

// j1 .. j6 of Eq. 16 and k1 .. k8 of Eq. 17, times the square root of M.
struct ConstraintResidual {
  Eigen::Matrix3d level_from_camera;  // R_CW^b
  Eigen::Matrix3d target_from_level;  // (R_TW^b)^-1
  double root_of_penalty = 0.0;
  bool k8_as_printed = false;

  template <class T>
  bool operator()(const T* x, T* residual) const {
    using Matrix = Eigen::Matrix<T, 3, 3>;
    const Eigen::Map<const Eigen::Matrix<T, 3, 3, Eigen::RowMajor>> r(x);
    const Matrix gram = r * r.transpose();
    const Matrix rc = level_from_camera.cast<T>() * r * target_from_level.cast<T>();
    residual[0] = gram(0, 0) - T(1.0);
    residual[1] = gram(1, 1) - T(1.0);
    residual[2] = gram(2, 2) - T(1.0);
    residual[3] = gram(0, 1);
    residual[4] = gram(0, 2);
    residual[5] = gram(1, 2);
    residual[6] = rc(0, 2);
    residual[7] = rc(1, 2);
    residual[8] = rc(2, 0);
    residual[9] = rc(2, 1);
    residual[10] = rc(2, 2) - T(1.0);
    residual[11] = rc(0, 1) + rc(1, 0);
    residual[12] = rc(0, 0) - rc(1, 1);
    // Eq. 5 makes both diagonal elements alpha: alpha^2 + beta^2 = 1 needs the (1, 2) element.
    const T& second = k8_as_printed ? rc(1, 1) : rc(0, 1);
    residual[13] = rc(0, 0) * rc(0, 0) + second * second - T(1.0);
    for (int i = 0; i < 14; ++i) residual[i] *= T(root_of_penalty);
    return true;
  }
};

Twelve UnknownsOf(const Rigid3& pose) {
  Twelve x{};
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(x.data()) =
      pose.rotation.toRotationMatrix();
  for (int i = 0; i < 3; ++i) x[static_cast<std::size_t>(9 + i)] = 1e3 * pose.translation[i];
  return x;
}

// The twelve numbers are a rotation only up to the penalty's give (1e-9 in mm): the nearest one.
Rigid3 PoseOf(const Twelve& x) {
  const Eigen::Matrix3d raw =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(x.data());
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(raw, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d rotation = svd.matrixU() * svd.matrixV().transpose();
  return {Eigen::Quaterniond(rotation).normalized(), 1e-3 * Eigen::Vector3d(x[9], x[10], x[11])};
}

bool AddSightings(const PoseProblem& problem, Twelve& x, ceres::Problem& objective) {
  const CameraModel& camera = problem.rig->camera;
  const Eigen::Vector2d focal_mm = kPixelMm * Eigen::Vector2d(camera.fx_px, camera.fy_px);
  for (const LedObservation& led : problem.leds) {
    const auto seen = NormalisedFromPixel(camera, led.pixel_px);
    if (!seen) return false;
    const Eigen::Vector3d p_led_in_target_mm =
        1e3 * problem.rig->leds[static_cast<std::size_t>(led.led_index)].p_led_in_target;
    objective.AddResidualBlock(
        new ceres::AutoDiffCostFunction<ImageResidual, 2, 12>(
            new ImageResidual{seen->cwiseProduct(focal_mm), focal_mm, p_led_in_target_mm}),
        nullptr,
        x.data());
  }
  return true;
}

// The estimator minimises unweighted pixels under R u_T = u_C. Its error is linear in the image
// noise and in the tilt noise; both enter with the sigmas that the problem declares, although the
// estimator itself ignores them.
std::optional<PoseCovariance> ConstrainedCovariance(const LinearisedProblem& linear) {
  const auto images = linear.by_pose.topRows(linear.led_rows);
  Eigen::Matrix<double, 8, 8> system = Eigen::Matrix<double, 8, 8>::Zero();
  system.topLeftCorner<6, 6>() = images.transpose() * images;
  system.bottomLeftCorner<2, 6>() = linear.by_pose.bottomRows<2>();
  system.topRightCorner<6, 2>() = linear.by_pose.bottomRows<2>().transpose();
  const Eigen::FullPivLU<Eigen::Matrix<double, 8, 8>> lu(system);
  if (!lu.isInvertible()) return std::nullopt;
  const Eigen::Matrix<double, 8, 8> inverse = lu.inverse();
  const Eigen::Matrix<double, 6, Eigen::Dynamic> by_image =
      inverse.topLeftCorner<6, 6>() * images.transpose();
  const Eigen::Matrix<double, 6, 2> by_tilt = inverse.topRightCorner<6, 2>();
  const auto image_covariance = linear.covariance.topLeftCorner(linear.led_rows, linear.led_rows);
  const Eigen::Matrix2d tilt_covariance = linear.covariance.bottomRightCorner<2, 2>();
  PoseCovariance covariance = by_image * image_covariance * by_image.transpose();
  covariance += by_tilt * tilt_covariance * by_tilt.transpose();
  return covariance;
}

PoseResult Judge(const PoseProblem& problem,
                 const Rigid3& pose,
                 int iterations,
                 const SolveOptions& options) {
  const auto linear = Linearise(problem, pose);
  if (!linear) return Failure{PoseFailure::kBehindCamera};
  const auto covariance = ConstrainedCovariance(*linear);
  if (!covariance || !IsObservable(*covariance, options)) {
    return Failure{PoseFailure::kNotObservable};
  }
  PoseEstimate estimate;
  estimate.camera_from_target = pose;
  estimate.covariance = *covariance;
  estimate.chi2 = std::numeric_limits<double>::quiet_NaN();
  estimate.dof = linear->led_rows + 2 - 6;
  estimate.rms_px =
      std::sqrt(linear->residual.head(linear->led_rows).squaredNorm() / linear->led_rows);
  estimate.iterations = iterations;
  return estimate;
}

}  // namespace

PoseResult PenaltyPose(const PoseProblem& problem,
                       const std::optional<Rigid3>& start,
                       const SolveOptions& options,
                       const PenaltyOptions& penalty) {
  TBM_CHECK(problem.rig != nullptr);
  if (problem.leds.size() < 3) return Failure{PoseFailure::kTooFewLeds};
  const auto tilts = TiltConstraint::From(problem);
  if (!tilts) return Failure{PoseFailure::kNotObservable};
  const auto starts = StartPose(problem);
  if (!start && !starts) return Failure{starts.error()};

  Twelve x = UnknownsOf(start ? *start : starts->camera_from_target[0]);
  ceres::Problem objective;
  if (!AddSightings(problem, x, objective)) return Failure{PoseFailure::kNotConverged};
  const Eigen::Matrix3d level_from_target = LevelFromBody(tilts->up_in_target);
  objective.AddResidualBlock(new ceres::AutoDiffCostFunction<ConstraintResidual, 14, 12>(
                                 new ConstraintResidual{LevelFromBody(tilts->up_in_camera),
                                                        level_from_target.transpose(),
                                                        std::sqrt(penalty.penalty),
                                                        penalty.k8_as_printed}),
                             nullptr,
                             x.data());
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::DENSE_QR;
  solver.logging_type = ceres::SILENT;
  solver.max_num_iterations = kMaxIterations;
  solver.function_tolerance = 1e-16;
  solver.gradient_tolerance = 1e-16;
  solver.parameter_tolerance = 1e-14;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &objective, &summary);
  if (!summary.IsSolutionUsable()) return Failure{PoseFailure::kNotConverged};
  return Judge(problem, PoseOf(x), static_cast<int>(summary.iterations.size()), options);
}

}  // namespace tbm
