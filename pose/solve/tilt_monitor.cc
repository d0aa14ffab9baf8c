#include "pose/solve/tilt_monitor.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "pose/solve/linearised.h"
#include "pose/solve/rows.h"
#include "pose/solve/tails.h"

namespace tbm {
namespace {

constexpr int kFewestLeds = 3;
constexpr double kMaxVisionSigmaRad = 0.0175;

Rig WithoutDeclaredSigmas(Rig rig) {
  rig.calibration_residual_px = 0.0;
  rig.intrinsics_sigma_px.setZero();
  for (Led& led : rig.leds) led.sigma_m = 0.0;
  rig.target_tilt.mounting_sigma_rad = 0.0;
  rig.camera_tilt.mounting_sigma_rad = 0.0;
  return rig;
}

// Turns about the camera's horizontal right and forward axes, from the components of a small shift
// of the up vector along the tangent basis at it.
Eigen::Matrix2d PitchRollByTangent(const TiltConstraint& tilts) {
  const Eigen::Vector3d& up = tilts.up_in_camera;
  const Eigen::Vector3d forward = (Eigen::Vector3d::UnitZ() - up.z() * up).normalized();
  const Eigen::Vector3d right = forward.cross(up);
  Eigen::Matrix2d by_tangent;
  for (int i = 0; i < 2; ++i) {
    const Eigen::Vector3d turn = up.cross(tilts.basis.col(i));
    by_tangent(0, i) = right.dot(turn);
    by_tangent(1, i) = forward.dot(turn);
  }
  return by_tangent;
}

// The used LEDs of `problem`, with what differs from frame to frame as its only noise.
PoseProblem NoiseOnly(const PoseProblem& problem, std::uint32_t leds_used, const Rig& rig) {
  PoseProblem used = problem;
  used.rig = &rig;
  used.leds.clear();
  for (const LedObservation& led : problem.leds) {
    if ((leds_used >> led.led_index & 1u) != 0) used.leds.push_back(led);
  }
  return used;
}

// Covariance of the errors that stay: all LEDs' centres, then the tilts along their tangent basis.
std::optional<LinearisedProblem> WhatStays(const PoseProblem& problem, const Rigid3& pose) {
  PoseProblem all = problem;
  all.leds.clear();
  for (std::size_t i = 0; i < problem.rig->leds.size(); ++i) {
    all.leds.push_back({static_cast<int>(i), Eigen::Vector2d::Zero(), 0.0});
  }
  all.target_tilt->sigma_rad = 0.0;
  all.camera_tilt->sigma_rad = 0.0;
  return Linearise(all, pose);
}

}  // namespace

TiltMonitor::TiltMonitor(const Rig& rig, const TiltMonitorOptions& options)
    : options_(options), noise_only_rig_(WithoutDeclaredSigmas(rig)) {
  TBM_CHECK(options.window_frames >= 2 && options.baseline_windows >= 1);
  window_.resize(static_cast<std::size_t>(options.window_frames));
  scratch_.resize(window_.size());
}

void TiltMonitor::Restart() {
  seen_ = 0;
  baseline_ = TiltBaseline{};
  baseline_windows_ = 0;
  baseline_complete_at_ = 0;
  report_ = TiltMonitorReport{};
}

std::optional<TiltBaseline> TiltMonitor::baseline() const {
  if (baseline_windows_ < options_.baseline_windows) return std::nullopt;
  return baseline_;
}

void TiltMonitor::Restart(const std::optional<TiltBaseline>& baseline) {
  Restart();
  if (!baseline) return;
  baseline_ = *baseline;
  baseline_windows_ = options_.baseline_windows;
}

// The tilt rows' residual less what the LEDs alone make of it: to first order the tilt residual at
// the vision-only pose, wherever the pose at hand comes from.
std::optional<TiltMonitor::Sighting> TiltMonitor::See(const PoseProblem& problem,
                                                      const CheckedPose& checked) const {
  const PoseProblem used = NoiseOnly(problem, checked.leds_used, noise_only_rig_);
  const auto tilts = TiltConstraint::From(used);
  if (!tilts || used.leds.size() < kFewestLeds) return std::nullopt;
  const auto linear = Linearise(used, checked.pose.camera_from_target);
  if (!linear) return std::nullopt;

  const int led_rows = linear->led_rows;
  const LinearisedProblem::RowsByPose by_pose = linear->by_pose.topRows(led_rows);
  // Without declared sigmas nothing ties the LEDs together, and each row has its own noise.
  const LinearisedProblem::Rows weight =
      linear->covariance.diagonal().head(led_rows).cwiseInverse();
  const PoseCovariance information = by_pose.transpose() * weight.asDiagonal() * by_pose;
  const Eigen::LLT<PoseCovariance> root(information);
  if (root.info() != Eigen::Success) return std::nullopt;
  const PoseCovariance vision = root.solve(PoseCovariance::Identity());
  if (vision.topLeftCorner<3, 3>().trace() > kMaxVisionSigmaRad * kMaxVisionSigmaRad) {
    return std::nullopt;
  }

  const Eigen::Matrix2d by_tangent = PitchRollByTangent(*tilts);
  const Eigen::Matrix<double, 2, 6> tilts_by_pose = by_tangent * linear->by_pose.bottomRows<2>();
  const Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, kCentreRows> by_used_centres =
      -tilts_by_pose * vision * by_pose.transpose() * weight.asDiagonal();
  Sighting sighting;
  sighting.offset_rad =
      by_tangent * linear->residual.tail<2>() + by_used_centres * linear->residual.head(led_rows);
  const Eigen::Matrix2d noise =
      by_tangent * linear->covariance.bottomRightCorner<2, 2>() * by_tangent.transpose() +
      tilts_by_pose * vision * tilts_by_pose.transpose();
  sighting.information = noise.inverse();
  for (int i = 0; i < led_rows / 2; ++i) {
    const int led_index = used.leds[static_cast<std::size_t>(i)].led_index;
    sighting.by_centres.middleCols<2>(2 * led_index) = by_used_centres.middleCols<2>(2 * i);
  }
  return sighting;
}

Eigen::Vector2d TiltMonitor::MedianOfWindow() {
  Eigen::Vector2d median;
  for (int axis = 0; axis < 2; ++axis) {
    std::transform(window_.begin(), window_.end(), scratch_.begin(), [axis](const Sighting& s) {
      return s.offset_rad[axis];
    });
    const auto middle = scratch_.begin() + static_cast<std::ptrdiff_t>(scratch_.size() / 2);
    std::nth_element(scratch_.begin(), middle, scratch_.end());
    median[axis] = *middle;
  }
  return median;
}

// Mean of the frames near the median: half of the window may be wrong in any way.
std::optional<TiltMonitor::Mean> TiltMonitor::MeanOfWindow() {
  const Eigen::Vector2d median = MedianOfWindow();
  const auto counts = [&](const Sighting& sighting) {
    const Eigen::Vector2d off = sighting.offset_rad - median;
    return off.dot(sighting.information * off) <= options_.outlier_chi2;
  };
  Mean mean;
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
  for (const Sighting& sighting : window_) {
    if (!counts(sighting)) continue;
    ++mean.frames;
    information += sighting.information;
    mean.offset_rad += sighting.information * sighting.offset_rad;
    mean.by_centres += sighting.information * sighting.by_centres;
  }
  if (2 * mean.frames < options_.window_frames) return std::nullopt;
  mean.covariance = information.inverse();
  mean.offset_rad = (mean.covariance * mean.offset_rad).eval();
  mean.by_centres = (mean.covariance * mean.by_centres).eval();

  // Frames that scatter more than their sigmas say (vibration, a lamp that flickers) count for
  // less.
  double scatter = 0.0;
  for (const Sighting& sighting : window_) {
    if (!counts(sighting)) continue;
    const Eigen::Vector2d off = sighting.offset_rad - mean.offset_rad;
    scatter += off.dot(sighting.information * off);
  }
  mean.covariance *= std::max(1.0, scatter / (2.0 * (mean.frames - 1)));
  return mean;
}

void TiltMonitor::Learn(const Mean& mean) {
  const double share = 1.0 / (baseline_windows_ + 1);
  baseline_.offset_rad += share * (mean.offset_rad - baseline_.offset_rad);
  baseline_.by_centres += share * (mean.by_centres - baseline_.by_centres);
  baseline_.covariance =
      (1.0 - share) * (1.0 - share) * baseline_.covariance + share * share * mean.covariance;
  ++baseline_windows_;
  baseline_complete_at_ = seen_;
}

MountingOffset TiltMonitor::Judge(const Eigen::Vector2d& offset_rad,
                                  const Eigen::Matrix2d& covariance) const {
  MountingOffset offset;
  offset.pitch_rad = offset_rad[0];
  offset.roll_rad = offset_rad[1];
  offset.pitch_sigma_rad = std::sqrt(covariance(0, 0));
  offset.roll_sigma_rad = std::sqrt(covariance(1, 1));
  offset.tail = ChiSquaredTail(offset_rad.dot(covariance.inverse() * offset_rad), 2);
  offset.moved = offset.tail < options_.false_alarm;
  return offset;
}

const TiltMonitorReport& TiltMonitor::Add(const PoseProblem& problem, const CheckedPose& checked) {
  const auto sighting = See(problem, checked);
  if (!sighting) return report_;
  window_[static_cast<std::size_t>(seen_ % options_.window_frames)] = *sighting;
  ++seen_;
  if (seen_ < options_.window_frames) {
    report_.frames = seen_;
    return report_;
  }
  const auto mean = MeanOfWindow();
  const auto stays = WhatStays(problem, checked.pose.camera_from_target);
  if (!mean || !stays) return report_;
  report_.frames = mean->frames;

  // What stays reaches the offset through the centres; in a change only as far as LEDs or view
  // differ.
  const auto staying = [&](const ByCentres& by_centres) -> Eigen::Matrix2d {
    const int rows = stays->led_rows;
    const auto by_rows = by_centres.leftCols(rows);
    return by_rows * stays->covariance.topLeftCorner(rows, rows) * by_rows.transpose();
  };
  // The mountings' own part is the same along every tangent.
  const Eigen::Matrix2d mountings = stays->covariance.bottomRightCorner<2, 2>();
  report_.absolute =
      Judge(mean->offset_rad, mean->covariance + staying(mean->by_centres) + mountings);

  const bool learning = baseline_windows_ < options_.baseline_windows;
  if (learning && seen_ % options_.window_frames == 0) {
    Learn(*mean);
  } else if (!learning && seen_ - baseline_complete_at_ >= options_.window_frames) {
    report_.change = Judge(
        mean->offset_rad - baseline_.offset_rad,
        mean->covariance + baseline_.covariance + staying(mean->by_centres - baseline_.by_centres));
  }
  return report_;
}

}  // namespace tbm
