#include "guidance/fusion/fusion_filter.h"

#include <cmath>

#include <Eigen/Cholesky>

#include "pose/base/check.h"
#include "pose/geometry/rigid3.h"
#include "pose/solve/tails.h"

namespace tbm {
namespace {

constexpr int kP = FusionLayout::kPosition;
constexpr int kV = FusionLayout::kVelocity;
constexpr int kA = FusionLayout::kAttitude;
constexpr int kG = FusionLayout::kGyroBias;
constexpr int kF = FusionLayout::kAccelBias;

using Matrix9 = Eigen::Matrix<double, 9, 9>;

}  // namespace

std::string_view Word(FusionUpdate update) {
  switch (update) {
    case FusionUpdate::kTargets:
      return "targets";
    case FusionUpdate::kTilt:
      return "tilt";
    case FusionUpdate::kRest:
      return "rest";
    case FusionUpdate::kOdometer:
      return "odometer";
    case FusionUpdate::kImageDisplacement:
      return "image_displacement";
  }
  return "";
}

void FusionStep::Take(FusionMatrix& m) const {
  using Rows3 = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, FusionLayout::kMost>;
  const Rows3 attitude = m.middleRows<3>(kA);
  const Rows3 gyro = m.middleRows<3>(kG);
  const Rows3 accel = m.middleRows<3>(kF);
  m.middleRows<3>(kP) += span_s * m.middleRows<3>(kV) + position_by_attitude * attitude +
                         position_by_gyro * gyro + position_by_accel * accel;
  m.middleRows<3>(kV) +=
      velocity_by_attitude * attitude + velocity_by_gyro * gyro + velocity_by_accel * accel;
  m.middleRows<3>(kA) = attitude_by_attitude * attitude + attitude_by_gyro * gyro;
  if (gravity_at >= 0) {
    const Rows3 gravity = gravity_by_turn * m.middleRows<2>(gravity_at);
    m.middleRows<3>(kP) += 0.5 * span_s * span_s * gravity;
    m.middleRows<3>(kV) += span_s * gravity;
  }
}

FusionFilter::FusionFilter(const FusionLayout& layout,
                           const FusionState& state,
                           const FusionMatrix& covariance,
                           const ImuNoise& noise,
                           double gravity_m_s2,
                           Timestamp now)
    : layout_(layout),
      noise_(noise),
      gravity_m_s2_(gravity_m_s2),
      state_(state),
      covariance_(covariance),
      now_(now) {
  TBM_CHECK(covariance.rows() == layout.size() && covariance.cols() == layout.size());
}

void FusionFilter::Feed(const ImuSample& sample, const ImuNoise& noise) {
  const double dt = sample.interval_s;
  const Increments increments = strapdown_.Next(
      sample.gyro_rad_s - state_.gyro_bias_rad_s, sample.accel_m_s2 - state_.accel_bias_m_s2, dt);
  const Eigen::Matrix3d world_from_imu = state_.motion.world_from_imu.toRotationMatrix();
  const Eigen::Matrix3d lever = -world_from_imu * Skew(increments.velocity_m_s);
  const Eigen::Matrix3d back = ExpRotation(-increments.turn_rad).toRotationMatrix();

  step_.position_by_attitude +=
      dt * step_.velocity_by_attitude + 0.5 * dt * (lever * step_.attitude_by_attitude);
  step_.position_by_gyro +=
      dt * step_.velocity_by_gyro + 0.5 * dt * (lever * step_.attitude_by_gyro);
  step_.position_by_accel += dt * step_.velocity_by_accel - 0.5 * dt * dt * world_from_imu;
  step_.velocity_by_attitude += lever * step_.attitude_by_attitude;
  // What the bias does to the attitude counts with its mean over the interval.
  step_.velocity_by_gyro +=
      lever * (step_.attitude_by_gyro - 0.5 * dt * Eigen::Matrix3d::Identity());
  step_.velocity_by_accel -= dt * world_from_imu;
  step_.attitude_by_attitude = back * step_.attitude_by_attitude;
  step_.attitude_by_gyro = back * step_.attitude_by_gyro - dt * Eigen::Matrix3d::Identity();
  step_.span_s += dt;

  Matrix9& q = step_noise_;
  q.middleRows<3>(kP) += dt * q.middleRows<3>(kV) + 0.5 * dt * (lever * q.middleRows<3>(kA));
  q.middleRows<3>(kV) += lever * q.middleRows<3>(kA);
  q.middleRows<3>(kA) = (back * q.middleRows<3>(kA)).eval();
  q.middleCols<3>(kP) +=
      dt * q.middleCols<3>(kV) + 0.5 * dt * (q.middleCols<3>(kA) * lever.transpose());
  q.middleCols<3>(kV) += q.middleCols<3>(kA) * lever.transpose();
  q.middleCols<3>(kA) = (q.middleCols<3>(kA) * back.transpose()).eval();
  AddNoise(dt, noise);

  state_.motion = Advanced(state_.motion, increments, dt, GravityInWorld(state_, gravity_m_s2_));
  last_ = sample;
  now_ = sample.ends_at;
}

void FusionFilter::Hold(const ImuSample& sample) {
  held_.span_s += sample.interval_s;
  held_.gyro_rad_s += sample.interval_s * sample.gyro_rad_s;
  held_.accel_m_s2 += sample.interval_s * sample.accel_m_s2;
  strapdown_ = Strapdown{};
  last_ = sample;
  now_ = sample.ends_at;
}

void FusionFilter::AddNoise(double interval_s, const ImuNoise& noise) {
  const double angle = noise.angle_random_walk_rad;
  const double velocity = noise.velocity_random_walk_m_s;
  const double velocity_variance = velocity * velocity * interval_s;
  for (int i = 0; i < 3; ++i) {
    step_noise_(kA + i, kA + i) += angle * angle * interval_s;
    step_noise_(kV + i, kV + i) += velocity_variance;
    step_noise_(kP + i, kP + i) += velocity_variance * interval_s * interval_s / 3.0;
    step_noise_(kP + i, kV + i) += velocity_variance * interval_s / 2.0;
    step_noise_(kV + i, kP + i) += velocity_variance * interval_s / 2.0;
  }
}

void FusionFilter::BringForward() {
  if (layout_.Has(FusionOption::kGravity)) {
    step_.gravity_at = layout_.At(FusionOption::kGravity);
    const Eigen::Vector3d gravity = GravityInWorld(state_, gravity_m_s2_);
    step_.gravity_by_turn = -Skew(gravity).leftCols<2>();
  }
  step_.Take(covariance_);
  covariance_.transposeInPlace();
  step_.Take(covariance_);
  covariance_.topLeftCorner<9, 9>() += step_noise_;
  const double gyro_walk = noise_.gyro_bias_walk_rad_s;
  const double accel_walk = noise_.accel_bias_walk_m_s2;
  const double whole_s = step_.span_s + held_.span_s;
  for (int i = 0; i < 3; ++i) {
    covariance_(kG + i, kG + i) += gyro_walk * gyro_walk * whole_s;
    covariance_(kF + i, kF + i) += accel_walk * accel_walk * whole_s;
  }
  covariance_ = (0.5 * (covariance_ + covariance_.transpose())).eval();
  last_held_ = held_;
  if (held_.span_s > 0.0) {
    last_held_.gyro_rad_s /= held_.span_s;
    last_held_.accel_m_s2 /= held_.span_s;
  }
  held_ = Held{};
  last_step_ = step_;
  step_ = FusionStep{};
  step_noise_.setZero();
}

FusionVerdict FusionFilter::Take(const FusionMeasurement& measurement,
                                 FusionVerdict verdict,
                                 double least_likely) {
  const FusionMatrix& h = measurement.h;
  const FusionMatrix cross = covariance_ * h.transpose();
  const FusionMatrix spread = h * cross + measurement.noise;
  const Eigen::LLT<FusionMatrix> solver(spread);
  verdict.accepted = false;
  if (solver.info() != Eigen::Success || !measurement.residual.allFinite()) {
    verdict.why_not = "not_a_number";
    return verdict;
  }
  const FusionVector weighted = solver.solve(measurement.residual);
  verdict.dof += static_cast<int>(h.rows());
  verdict.nis += measurement.residual.dot(weighted);
  if (least_likely > 0.0 && ChiSquaredTail(verdict.nis, verdict.dof) < least_likely) {
    verdict.why_not = "innovation_too_large";
    return verdict;
  }
  const FusionVector e = cross * weighted;
  state_ = MovedBy(state_, layout_, e);
  const FusionMatrix gain = solver.solve(cross.transpose()).transpose();
  // Joseph's form: what is left stays positive whatever the rounding.
  FusionMatrix left = FusionMatrix::Identity(layout_.size(), layout_.size()) - gain * h;
  covariance_ = (left * covariance_ * left.transpose()).eval();
  covariance_ += gain * measurement.noise * gain.transpose();
  covariance_ = (0.5 * (covariance_ + covariance_.transpose())).eval();
  verdict.accepted = true;
  return verdict;
}

}  // namespace tbm
