#include "guidance/fusion/target_pixels.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/QR>

#include "pose/geometry/rigid3.h"
#include "pose/solve/tails.h"

namespace tbm {
namespace {

using Row = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, FusionLayout::kMost>;

// Of a point by itself, before the others have spoken: one of a million good ones is lost.
constexpr double kLeastLikelyPoint = 1e-6;
// Of a point against what all of its image say.
constexpr double kLeastLikelyRest = 1e-5;
constexpr int kRounds = 12;
constexpr int kMostSteps = 8;
// Of a point's sigma: what an image point is off the straight line along which the state is moved.
constexpr double kStraight = 0.1;

struct Candidate {
  int target = 0;
  Eigen::Vector2d pixel_px;
  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, FusionLayout::kMost> by_error;
  // From where the state puts it; by the derivative where that is taken elsewhere.
  Eigen::Vector2d off_px;
  double sigma_px = 0.0;
};

// Rows of all candidates divided by their sigma: many rows, of which the QR leaves as many as there
// are columns.
struct Stacked {
  Eigen::MatrixXd h;
  Eigen::VectorXd residual;
};

Stacked Stack(const std::vector<Candidate>& candidates, int size) {
  const auto rows = static_cast<Eigen::Index>(2 * candidates.size());
  Stacked stacked{Eigen::MatrixXd(rows, size), Eigen::VectorXd(rows)};
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const Candidate& one = candidates[i];
    const auto row = static_cast<Eigen::Index>(2 * i);
    stacked.h.middleRows<2>(row) = one.by_error / one.sigma_px;
    stacked.residual.segment<2>(row) = one.off_px / one.sigma_px;
  }
  return stacked;
}

// The same information in few rows of unit noise, and the sum of squares that no state explains.
struct Compressed {
  FusionMeasurement measurement;
  double rest = 0.0;
  int rest_dof = 0;
};

Compressed Compress(const Stacked& stacked) {
  const Eigen::Index rows = stacked.h.rows();
  const Eigen::Index kept = std::min(rows, stacked.h.cols());
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(stacked.h);
  const Eigen::VectorXd turned = qr.householderQ().transpose() * stacked.residual;
  Compressed compressed;
  compressed.measurement.h =
      qr.matrixQR().topRows(kept).triangularView<Eigen::Upper>().toDenseMatrix();
  compressed.measurement.residual = turned.head(kept);
  compressed.measurement.noise = FusionMatrix::Identity(kept, kept);
  compressed.rest = turned.tail(rows - kept).squaredNorm();
  compressed.rest_dof = static_cast<int>(rows - kept);
  return compressed;
}

// What a pixel is off when the state is moved by what the others say.
double Unlikely(const Candidate& one, const FusionVector& e) {
  const Eigen::Vector2d off = one.off_px - one.by_error * e;
  return off.squaredNorm() / (one.sigma_px * one.sigma_px);
}

// A velocity that may be none says nothing of the clock: the square of its error would be taken for
// knowledge, image after image of a trolley at rest (seen: half a millisecond, out of nothing).
bool IsMoving(const FusionFilter& filter) {
  constexpr double kSure = 4.0;
  const auto variance = filter.covariance().diagonal().segment<3>(FusionLayout::kVelocity).sum();
  return filter.state().motion.velocity_world_m_s.squaredNorm() > kSure * kSure * variance;
}

double PixelSigma(const PixelPrediction& prediction, double residual_px, double target_sigma_m) {
  const double by_target = prediction.by_target_px_per_m.norm() * target_sigma_m / std::sqrt(2.0);
  return std::hypot(residual_px, by_target);
}

PixelExposure ExposureOf(const FusionFilter& filter, const CameraModel& camera) {
  return {filter.layout(), camera, filter.rate_rad_s(), IsMoving(filter)};
}

// What all candidates together say of the error of the filter's state.
FusionVector Told(const FusionFilter& filter, const std::vector<Candidate>& candidates) {
  const Compressed all = Compress(Stack(candidates, filter.layout().size()));
  const FusionMatrix& h = all.measurement.h;
  const FusionMatrix cross = filter.covariance() * h.transpose();
  const FusionMatrix spread = h * cross + all.measurement.noise;
  return cross * spread.llt().solve(all.measurement.residual);
}

// Takes the derivatives where the image puts the state, not where the filter had it: after a long
// way without targets the two are far from each other, and what is linear there is not so here.
// Returns what the candidates then say.
FusionVector LineariseWhereTold(const FusionFilter& filter,
                                const PixelExposure& exposure,
                                std::span<const SurveyedTarget> targets,
                                std::vector<Candidate>* candidates) {
  FusionVector e = Told(filter, *candidates);
  for (int step = 0; step < kMostSteps; ++step) {
    const FusionState there = MovedBy(filter.state(), filter.layout(), e);
    std::vector<Candidate> moved = *candidates;
    double bent = 0.0;
    for (Candidate& one : moved) {
      const auto prediction =
          PredictPixel(exposure, there, targets[static_cast<std::size_t>(one.target)]);
      if (!prediction) return e;
      const Eigen::Vector2d off_px = one.pixel_px - prediction->pixel_px;
      bent = std::max(bent, (off_px - (one.off_px - one.by_error * e)).norm() / one.sigma_px);
      one.by_error = prediction->by_error;
      one.off_px = off_px + one.by_error * e;
    }
    if (bent < kStraight) break;
    *candidates = std::move(moved);
    e = Told(filter, *candidates);
  }
  return e;
}

}  // namespace

Result<PixelPrediction, CameraModelFailure> PredictPixel(const PixelExposure& exposure,
                                                         const FusionState& state,
                                                         const SurveyedTarget& target) {
  const FusionLayout& layout = exposure.layout;
  const Eigen::Vector3d& rate = exposure.rate_rad_s;
  const double late_s = state.time_offset_s;
  const Eigen::Vector3d imu_in_world =
      state.motion.position_world_m - late_s * state.motion.velocity_world_m_s;
  const Eigen::Matrix3d imu_from_world =
      (state.motion.world_from_imu * ExpRotation(-late_s * rate)).conjugate().toRotationMatrix();
  Eigen::Vector3d in_world = target.in_world_m;
  if (layout.modes() > 0 && target.by_mode.cols() == layout.modes()) {
    in_world += target.by_mode * state.modes;
  }
  const Eigen::Vector3d in_imu = imu_from_world * (in_world - imu_in_world);
  const Eigen::Matrix3d camera_from_imu = state.camera_from_imu.toRotationMatrix();
  const Eigen::Vector3d in_camera = camera_from_imu * (in_imu - state.camera_in_imu_m);
  const auto projection = Project(exposure.camera, in_camera);
  if (!projection) return Failure{projection.error()};

  PixelPrediction prediction;
  prediction.pixel_px = projection->pixel_px;
  const Eigen::Matrix<double, 2, 3> by_camera = projection->by_point_px_per_m;
  const Eigen::Matrix<double, 2, 3> by_imu = by_camera * camera_from_imu;
  prediction.by_target_px_per_m = by_imu * imu_from_world;
  Row& h = prediction.by_error;
  h = Row::Zero(2, layout.size());
  h.middleCols<3>(FusionLayout::kPosition) = -prediction.by_target_px_per_m;
  h.middleCols<3>(FusionLayout::kVelocity) = late_s * prediction.by_target_px_per_m;
  // An error of the attitude, seen from the axes at the exposure; a gyro's bias turns them on the
  // way from there to the stamp.
  h.middleCols<3>(FusionLayout::kAttitude) =
      by_imu * Skew(in_imu) * ExpRotation(late_s * rate).toRotationMatrix();
  h.middleCols<3>(FusionLayout::kGyroBias) =
      late_s * by_imu * Skew(in_imu) * ExpRotation(0.5 * late_s * rate).toRotationMatrix();
  if (layout.Has(FusionOption::kTimeOffset) && exposure.is_moving) {
    h.col(layout.At(FusionOption::kTimeOffset)) =
        prediction.by_target_px_per_m * state.motion.velocity_world_m_s -
        by_imu * (Skew(in_imu) * rate);
  }
  if (layout.Has(FusionOption::kCameraRotation)) {
    h.middleCols<3>(layout.At(FusionOption::kCameraRotation)) = -by_camera * Skew(in_camera);
  }
  if (layout.Has(FusionOption::kCameraPosition)) {
    h.middleCols<3>(layout.At(FusionOption::kCameraPosition)) = -by_imu;
  }
  if (layout.modes() > 0 && target.by_mode.cols() == layout.modes()) {
    h.rightCols(layout.modes()) = prediction.by_target_px_per_m * target.by_mode;
  }
  return prediction;
}

Result<PixelPrediction, CameraModelFailure> PredictPixel(const FusionFilter& filter,
                                                         const CameraModel& camera,
                                                         const SurveyedTarget& target) {
  return PredictPixel(ExposureOf(filter, camera), filter.state(), target);
}

TargetsVerdict UpdateByTargets(FusionFilter& filter,
                               const CameraModel& camera,
                               double residual_px,
                               std::span<const SurveyedTarget> targets,
                               std::span<const TargetPixel> pixels) {
  TargetsVerdict outcome;
  outcome.verdict.update = FusionUpdate::kTargets;
  outcome.verdict.sensed_at = filter.now();
  const int size = filter.layout().size();
  const PixelExposure exposure = ExposureOf(filter, camera);

  std::vector<Candidate> candidates;
  for (const TargetPixel& pixel : pixels) {
    const SurveyedTarget& target = targets[static_cast<std::size_t>(pixel.target)];
    const auto prediction = PredictPixel(exposure, filter.state(), target);
    if (!prediction) {
      outcome.rejected.push_back(
          {pixel.target, "behind_camera", std::numeric_limits<double>::quiet_NaN()});
      continue;
    }
    const double sigma_px =
        PixelSigma(*prediction, std::max(residual_px, pixel.sigma_px), target.sigma_m);
    const Eigen::Vector2d off_px = pixel.pixel_px - prediction->pixel_px;
    const Row cross = prediction->by_error * filter.covariance();
    Eigen::Matrix2d spread = cross * prediction->by_error.transpose();
    spread.diagonal().array() += sigma_px * sigma_px;
    const double nis = off_px.dot(spread.inverse() * off_px);
    if (!(ChiSquaredTail(nis, 2) >= kLeastLikelyPoint)) {
      outcome.rejected.push_back({pixel.target, "far_from_prediction", off_px.norm()});
      continue;
    }
    candidates.push_back({pixel.target, pixel.pixel_px, prediction->by_error, off_px, sigma_px});
  }

  // The worst that does not fit what the rest say goes, until all that is left fits.
  for (int round = 0; round < kRounds && candidates.size() > 2; ++round) {
    const FusionVector e = LineariseWhereTold(filter, exposure, targets, &candidates);
    double worst = 0.0;
    std::vector<double> off(candidates.size());
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      off[i] = Unlikely(candidates[i], e);
      worst = std::max(worst, off[i]);
    }
    if (ChiSquaredTail(worst, 2) >= kLeastLikelyRest) break;
    std::vector<Candidate> left;
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      // Those that are nearly as bad go with it: what they share pulled the rest.
      if (off[i] > 0.5 * worst) {
        outcome.rejected.push_back(
            {candidates[i].target, "does_not_fit", std::sqrt(off[i]) * candidates[i].sigma_px});
      } else {
        left.push_back(candidates[i]);
      }
    }
    candidates = std::move(left);
  }

  if (2 * candidates.size() < pixels.size() || candidates.empty()) {
    outcome.verdict.why_not =
        candidates.empty() && pixels.empty() ? "no_target" : "most_do_not_fit";
    return outcome;
  }
  const Compressed all = Compress(Stack(candidates, size));
  outcome.verdict.dof = all.rest_dof;
  outcome.verdict.nis = all.rest;
  outcome.verdict = filter.Take(all.measurement, outcome.verdict, 0.0);
  outcome.taken = static_cast<int>(candidates.size());
  return outcome;
}

}  // namespace tbm
