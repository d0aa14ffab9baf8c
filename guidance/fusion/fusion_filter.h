#pragma once

#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "guidance/fusion/fusion_state.h"
#include "guidance/fusion/strapdown.h"

namespace tbm {

// Spectral densities of what the unit's errors are driven by, per root second.
struct ImuNoise {
  double angle_random_walk_rad = 0.0;     // [rad / sqrt(s)]
  double velocity_random_walk_m_s = 0.0;  // [m/s / sqrt(s)]
  double gyro_bias_walk_rad_s = 0.0;      // [rad/s / sqrt(s)]
  double accel_bias_walk_m_s2 = 0.0;      // [m/s2 / sqrt(s)]
};

enum class FusionUpdate { kTargets, kTilt, kRest, kOdometer, kImageDisplacement };
inline constexpr int kFusionUpdates = 5;
std::string_view Word(FusionUpdate update);  // "targets", "tilt", ..

// What became of one measurement.
struct FusionVerdict {
  FusionUpdate update = FusionUpdate::kTargets;
  Timestamp sensed_at;
  int dof = 0;       // of `nis`; 0: there was nothing to take
  double nis = 0.0;  // innovation squared over its covariance: chi-squared when all is as declared
  bool accepted = false;
  std::string_view why_not;  // empty when accepted; a code: "innovation_too_large"
};

// A measurement, linear about the present state: residual = h e + noise, e the error state,
// `noise` its covariance. Rows: at most FusionLayout::kMost.
struct FusionMeasurement {
  FusionMatrix h;
  FusionVector residual;
  FusionMatrix noise;
};

// Error of the state one epoch later by its error at the epoch: what is not the identity of it.
// Blocks of 3 by 3, named by row and column (docs/filter.md, "Step").
struct FusionStep {
  double span_s = 0.0;
  Eigen::Matrix3d attitude_by_attitude = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d attitude_by_gyro = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d velocity_by_attitude = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d velocity_by_gyro = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d velocity_by_accel = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d position_by_attitude = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d position_by_gyro = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d position_by_accel = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 2> gravity_by_turn = Eigen::Matrix<double, 3, 2>::Zero();
  int gravity_at = -1;  // row of FusionOption::kGravity

  // Rows of `m` (errors, one in each column) taken through the step.
  void Take(FusionMatrix& m) const;
};

// Error-state filter: strapdown integration of the unit, corrected by measurements. The covariance
// is brought forward where it is asked for, not with each sample. One caller; no clock, no heap.
class FusionFilter {
 public:
  // `covariance` of the error of `state`, symmetric and positive definite, of the layout's size.
  FusionFilter(const FusionLayout& layout,
               const FusionState& state,
               const FusionMatrix& covariance,
               const ImuNoise& noise,
               double gravity_m_s2,
               Timestamp now);

  // Integrates a sample whose interval begins where the last one ended. `noise`: where it stands
  // for samples that are missing, what may have happened meanwhile.
  void Feed(const ImuSample& sample) { Feed(sample, noise_); }
  void Feed(const ImuSample& sample, const ImuNoise& noise);

  // The same for a sample during which the unit is known to rest: nothing moves, and what gyros and
  // accelerometers show is their biases, gravity and noise. UpdateByRest takes it from there.
  void Hold(const ImuSample& sample);

  // Brings the covariance to the present. Measurements of now may follow.
  void BringForward();

  // Takes a measurement of now, unless it is less likely than `least_likely` (0: take it whatever
  // it is). `verdict` has its update and time filled in by the caller.
  FusionVerdict Take(const FusionMeasurement& measurement,
                     FusionVerdict verdict,
                     double least_likely);

  const FusionLayout& layout() const { return layout_; }
  const FusionState& state() const { return state_; }
  const FusionMatrix& covariance() const { return covariance_; }  // of the last BringForward
  Timestamp now() const { return now_; }
  double gravity_m_s2() const { return gravity_m_s2_; }
  const ImuNoise& noise() const { return noise_; }

  // The last sample with the biases taken off: rate and specific force of now.
  Eigen::Vector3d rate_rad_s() const { return last_.gyro_rad_s - state_.gyro_bias_rad_s; }
  Eigen::Vector3d force_m_s2() const { return last_.accel_m_s2 - state_.accel_bias_m_s2; }
  double last_interval_s() const { return last_.interval_s; }
  // What was held since the BringForward before the last: how long, and the means as they came.
  struct Held {
    double span_s = 0.0;
    Eigen::Vector3d gyro_rad_s = Eigen::Vector3d::Zero();
    Eigen::Vector3d accel_m_s2 = Eigen::Vector3d::Zero();
  };
  const Held& last_held() const { return last_held_; }

  // Of the way from the BringForward before the last to the last: for the smoother.
  const FusionStep& last_step() const { return last_step_; }

 private:
  void AddNoise(double interval_s, const ImuNoise& noise);

  const FusionLayout layout_;
  const ImuNoise noise_;
  const double gravity_m_s2_;
  FusionState state_;
  FusionMatrix covariance_;
  Timestamp now_;
  Strapdown strapdown_;
  ImuSample last_;
  FusionStep step_;  // since the last BringForward
  FusionStep last_step_;
  Held held_;  // sums instead of means
  Held last_held_;
  Eigen::Matrix<double, 9, 9> step_noise_ = Eigen::Matrix<double, 9, 9>::Zero();
};

}  // namespace tbm
