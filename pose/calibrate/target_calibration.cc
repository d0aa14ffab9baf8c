#include "pose/calibrate/target_calibration.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/SVD>

#include "pose/geometry/rigid3.h"

namespace tbm {
namespace {

constexpr int kIterations = 20;
constexpr double kMostSigmas = 5.0;

// The rigid transform that brings `from` onto `to` with the least squares (Kabsch), and by how much
// the second largest extent of `from` differs from none.
struct RigidFit {
  Rigid3 to_from;
  double breadth_m = 0.0;
  double worst_m = 0.0;
};

RigidFit FitRigid(const std::vector<Eigen::Vector3d>& from,
                  const std::vector<Eigen::Vector3d>& to) {
  const auto count = static_cast<double>(from.size());
  Eigen::Vector3d from_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d to_mean = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    from_mean += from[i] / count;
    to_mean += to[i] / count;
  }
  Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    cross += (to[i] - to_mean) * (from[i] - from_mean).transpose();
    scatter += (from[i] - from_mean) * (from[i] - from_mean).transpose() / count;
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(cross, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d flip = Eigen::Matrix3d::Identity();
  flip(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  RigidFit fit;
  fit.to_from.rotation =
      Eigen::Quaterniond(Eigen::Matrix3d(svd.matrixU() * flip * svd.matrixV().transpose()));
  fit.to_from.translation = to_mean - fit.to_from.rotation * from_mean;
  fit.breadth_m = std::sqrt(scatter.jacobiSvd().singularValues()[1]);
  for (std::size_t i = 0; i < from.size(); ++i) {
    fit.worst_m = std::max(fit.worst_m, (fit.to_from * from[i] - to[i]).norm());
  }
  return fit;
}

// Unknowns: three for each LED, then turn (about the site's axes) and shift for each placement.
class Adjustment {
 public:
  Adjustment(std::span<const Eigen::Vector3d> nominal_m,
             std::span<const TargetPlacement> placements,
             std::vector<Rigid3> site_from_target)
      : nominal_(nominal_m),
        placements_(placements),
        leds_(nominal_m.begin(), nominal_m.end()),
        site_from_target_(std::move(site_from_target)) {}

  void Solve() {
    for (int i = 0; i < kIterations; ++i) {
      Fill();
      const Eigen::VectorXd step = information_.ldlt().solve(pull_);
      Move(step);
      if (step.norm() < 1e-14) break;
    }
    Fill();
  }

  TargetCalibration Found() const {
    TargetCalibration result;
    result.led_in_target_m = leds_;
    const Eigen::MatrixXd spread = information_.inverse();
    for (std::size_t j = 0; j < leds_.size(); ++j) {
      const auto row = static_cast<Eigen::Index>(3 * j);
      result.led_sigma_m.push_back(std::sqrt(spread.block<3, 3>(row, row).trace() / 3.0));
    }
    int observed = 0;
    for (std::size_t i = 0; i < placements_.size(); ++i) {
      for (std::size_t j = 0; j < leds_.size(); ++j) {
        const auto& measured = placements_[i].led_in_site_m[j];
        if (!measured) continue;
        observed += 3;
        const double off = (site_from_target_[i] * leds_[j] - *measured).norm();
        const double sigmas = off / placements_[i].sigma_m;
        result.chi2 += sigmas * sigmas;
        if (sigmas <= result.worst_sigmas) continue;
        result.worst_sigmas = sigmas;
        result.worst_led = j;
        result.worst_placement = i;
      }
    }
    // Six of the unknowns are the frame, which the constraints hold.
    result.dof = observed - static_cast<int>(3 * leds_.size() + 6 * placements_.size()) + 6;
    return result;
  }

  const std::vector<Rigid3>& site_from_target() const { return site_from_target_; }

 private:
  Eigen::Index PlacementAt(std::size_t i) const {
    return static_cast<Eigen::Index>(3 * leds_.size() + 6 * i);
  }

  void Fill() {
    const Eigen::Index size = PlacementAt(placements_.size());
    information_ = Eigen::MatrixXd::Zero(size, size);
    pull_ = Eigen::VectorXd::Zero(size);
    double largest_weight = 0.0;
    for (std::size_t i = 0; i < placements_.size(); ++i) {
      const double weight = 1.0 / (placements_[i].sigma_m * placements_[i].sigma_m);
      largest_weight = std::max(largest_weight, weight);
      const Eigen::Matrix3d rotation = site_from_target_[i].rotation.toRotationMatrix();
      const Eigen::Index p = PlacementAt(i);
      for (std::size_t j = 0; j < leds_.size(); ++j) {
        const auto& measured = placements_[i].led_in_site_m[j];
        if (!measured) continue;
        const auto l = static_cast<Eigen::Index>(3 * j);
        Eigen::Matrix<double, 3, 6> by_placement;
        by_placement.leftCols<3>() = -Skew(rotation * leds_[j]);
        by_placement.rightCols<3>().setIdentity();
        const Eigen::Vector3d off = *measured - site_from_target_[i] * leds_[j];
        information_.block<3, 3>(l, l) += weight * Eigen::Matrix3d::Identity();
        information_.block<6, 6>(p, p) += weight * by_placement.transpose() * by_placement;
        const Eigen::Matrix<double, 3, 6> mixed = weight * rotation.transpose() * by_placement;
        information_.block<3, 6>(l, p) += mixed;
        information_.block<6, 3>(p, l) += mixed.transpose();
        pull_.segment<3>(l) += weight * rotation.transpose() * off;
        pull_.segment<6>(p) += weight * by_placement.transpose() * off;
      }
    }
    HoldFrame(largest_weight);
  }

  // The frame is that of the nominal LEDs: neither shift nor turn between them and the new ones.
  void HoldFrame(double weight) {
    const auto count = static_cast<Eigen::Index>(leds_.size());
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& led : nominal_) mean += led / static_cast<double>(count);
    Eigen::MatrixXd hold = Eigen::MatrixXd::Zero(6, 3 * count);
    Eigen::VectorXd off(3 * count);
    for (Eigen::Index j = 0; j < count; ++j) {
      const auto at = static_cast<std::size_t>(j);
      hold.block<3, 3>(0, 3 * j).setIdentity();
      hold.block<3, 3>(3, 3 * j) = Skew(nominal_[at] - mean);
      off.segment<3>(3 * j) = nominal_[at] - leds_[at];
    }
    information_.topLeftCorner(3 * count, 3 * count) += 1e3 * weight * hold.transpose() * hold;
    pull_.head(3 * count) += 1e3 * weight * hold.transpose() * (hold * off);
  }

  void Move(const Eigen::VectorXd& step) {
    for (std::size_t j = 0; j < leds_.size(); ++j) {
      leds_[j] += step.segment<3>(static_cast<Eigen::Index>(3 * j));
    }
    for (std::size_t i = 0; i < placements_.size(); ++i) {
      const PoseError e = step.segment<6>(PlacementAt(i));
      site_from_target_[i] = Moved(site_from_target_[i], e);
    }
  }

  std::span<const Eigen::Vector3d> nominal_;
  std::span<const TargetPlacement> placements_;
  std::vector<Eigen::Vector3d> leds_;
  std::vector<Rigid3> site_from_target_;
  Eigen::MatrixXd information_;
  Eigen::VectorXd pull_;
};

// The inclinometer feels the site's plumb line, which the total station knows.
void FindMounting(std::span<const TargetPlacement> placements,
                  const std::vector<Rigid3>& site_from_target,
                  TargetCalibration* result) {
  std::vector<TiltPlacement> tilted;
  for (std::size_t i = 0; i < placements.size(); ++i) {
    if (!placements[i].up_in_housing) continue;
    TiltPlacement one;
    one.camera_from_board = site_from_target[i].rotation.conjugate().toRotationMatrix();
    one.up_in_housing = *placements[i].up_in_housing;
    one.tilt_sigma_rad = placements[i].tilt_sigma_rad;
    // How well the LEDs' coordinates hold the board's attitude.
    one.camera_sigma_rad = placements[i].sigma_m / 0.3;
    tilted.push_back(one);
  }
  TiltRotationOptions options;
  options.up_in_board = Eigen::Vector3d::UnitZ();
  const auto rotation = FindTiltRotation(tilted, options);
  if (!rotation) {
    result->mounting_missing = rotation.error().fault;
    return;
  }
  result->housing_from_target = rotation->camera_from_housing.transpose();
  result->mounting_covariance = rotation->covariance;
}

Failure<TargetCalibrationFailure> Fail(TargetCalibrationFault fault,
                                       std::size_t led,
                                       std::size_t placement,
                                       double off_m = 0.0) {
  return Failure{TargetCalibrationFailure{fault, led, placement, off_m}};
}

}  // namespace

Result<TargetCalibration, TargetCalibrationFailure> CalibrateTarget(
    std::span<const Eigen::Vector3d> nominal_m,
    std::span<const TargetPlacement> placements,
    double most_off_m) {
  std::vector<Rigid3> starts;
  std::vector<bool> is_seen(nominal_m.size(), false);
  for (std::size_t i = 0; i < placements.size(); ++i) {
    std::vector<Eigen::Vector3d> from;
    std::vector<Eigen::Vector3d> to;
    for (std::size_t j = 0; j < nominal_m.size(); ++j) {
      if (!placements[i].led_in_site_m[j]) continue;
      is_seen[j] = true;
      from.push_back(nominal_m[j]);
      to.push_back(*placements[i].led_in_site_m[j]);
    }
    if (from.size() < 3) return Fail(TargetCalibrationFault::kTooFewLeds, 0, i);
    const RigidFit fit = FitRigid(from, to);
    if (fit.breadth_m < 0.01) return Fail(TargetCalibrationFault::kOnOneLine, 0, i);
    if (fit.worst_m > most_off_m) {
      return Fail(TargetCalibrationFault::kOtherBoard, 0, i, fit.worst_m);
    }
    starts.push_back(fit.to_from);
  }
  const auto missing = std::find(is_seen.begin(), is_seen.end(), false);
  if (placements.empty() || missing != is_seen.end()) {
    return Fail(TargetCalibrationFault::kTooFewLeds,
                static_cast<std::size_t>(missing - is_seen.begin()),
                0);
  }
  Adjustment adjustment(nominal_m, placements, std::move(starts));
  adjustment.Solve();
  TargetCalibration result = adjustment.Found();
  if (result.dof > 0 && result.worst_sigmas > kMostSigmas) {
    const double off_m = result.worst_sigmas * placements[result.worst_placement].sigma_m;
    return Fail(
        TargetCalibrationFault::kDoesNotFit, result.worst_led, result.worst_placement, off_m);
  }
  FindMounting(placements, adjustment.site_from_target(), &result);
  return result;
}

}  // namespace tbm
