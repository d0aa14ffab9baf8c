#include "pose/calibrate/target_calibration.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "pose/calibrate/target_fit.h"

namespace tbm {
namespace {

constexpr int kIterations = 20;
// Three coordinates of one point: once in 70 000 by chance.
constexpr double kMostMisfit = 25.0;
// An error of a point shows by less than this share in its residual: nothing controls it.
constexpr double kLeastControl = 0.02;

// chi2 over its degrees of freedom where that is more than chance, else 1.
double Factor2(double chi2, int dof) {
  if (dof <= 0) return 1.0;
  const double ratio = chi2 / dof;
  return ratio > 1.0 + 3.0 * std::sqrt(2.0 / dof) ? ratio : 1.0;
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
    spread_ = information_.inverse();
  }

  TargetCalibration Found() const {
    TargetCalibration result;
    result.led_in_target_m = leds_;
    result.site_from_target = site_from_target_;
    for (std::size_t i = 0; i < placements_.size(); ++i) {
      for (std::size_t j = 0; j < leds_.size(); ++j) {
        if (!placements_[i].led_in_site_m[j]) continue;
        result.sightings.push_back(Sighting(i, j));
        const double sigmas = result.sightings.back().off_in_site_m.norm() / placements_[i].sigma_m;
        result.chi2 += sigmas * sigmas;
      }
    }
    // Six of the unknowns are the frame, which the constraints hold.
    result.dof =
        static_cast<int>(3 * result.sightings.size() - 3 * leds_.size() - 6 * placements_.size()) +
        6;
    result.sigma_factor = std::sqrt(Factor2(result.chi2, result.dof));
    for (std::size_t j = 0; j < leds_.size(); ++j) {
      const Eigen::Index row = LedAt(j);
      result.led_sigma_m.push_back(result.sigma_factor *
                                   std::sqrt(spread_.block<3, 3>(row, row).trace() / 3.0));
    }
    return result;
  }

  // Of a placement's two turns that move up.
  double UpSigma_rad(std::size_t i) const {
    const Eigen::Index p = PlacementAt(i);
    return std::sqrt(spread_.block<2, 2>(p, p).trace() / 2.0);
  }

 private:
  Eigen::Index LedAt(std::size_t j) const { return static_cast<Eigen::Index>(3 * j); }
  Eigen::Index PlacementAt(std::size_t i) const {
    return static_cast<Eigen::Index>(3 * leds_.size() + 6 * i);
  }

  Eigen::Matrix<double, 3, 6> ByPlacement(std::size_t i, std::size_t j) const {
    Eigen::Matrix<double, 3, 6> by_placement;
    by_placement.leftCols<3>() = -Skew(site_from_target_[i].rotation * leds_[j]);
    by_placement.rightCols<3>().setIdentity();
    return by_placement;
  }

  // Which share of an error of this point shows in its residual: one less what the point itself
  // says of the unknowns.
  Eigen::Matrix3d Control(std::size_t i, std::size_t j) const {
    const Eigen::Index l = LedAt(j);
    const Eigen::Index p = PlacementAt(i);
    const Eigen::Matrix3d by_led = site_from_target_[i].rotation.toRotationMatrix();
    const Eigen::Matrix<double, 3, 6> by_placement = ByPlacement(i, j);
    const Eigen::Matrix3d mixed = by_led * spread_.block<3, 6>(l, p) * by_placement.transpose();
    const Eigen::Matrix3d adjusted =
        by_led * spread_.block<3, 3>(l, l) * by_led.transpose() + mixed + mixed.transpose() +
        by_placement * spread_.block<6, 6>(p, p) * by_placement.transpose();
    const double sigma_m = placements_[i].sigma_m;
    return Eigen::Matrix3d::Identity() - adjusted / (sigma_m * sigma_m);
  }

  TargetSighting Sighting(std::size_t i, std::size_t j) const {
    TargetSighting sighting{i, j, Off(i, j), 0.0, 0.0};
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> control(Control(i, j));
    if (control.eigenvalues()[0] < kLeastControl) return sighting;
    const Eigen::Vector3d along = control.eigenvectors().transpose() * sighting.off_in_site_m;
    const double sigma_m = placements_[i].sigma_m;
    sighting.misfit =
        along.cwiseAbs2().cwiseQuotient(control.eigenvalues()).sum() / (sigma_m * sigma_m);
    sighting.from_others_m = along.cwiseQuotient(control.eigenvalues()).norm();
    return sighting;
  }

  Eigen::Vector3d Off(std::size_t i, std::size_t j) const {
    return *placements_[i].led_in_site_m[j] - site_from_target_[i] * leds_[j];
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
        if (!placements_[i].led_in_site_m[j]) continue;
        const Eigen::Index l = LedAt(j);
        const Eigen::Matrix<double, 3, 6> by_placement = ByPlacement(i, j);
        const Eigen::Vector3d off = Off(i, j);
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
    for (std::size_t j = 0; j < leds_.size(); ++j) leds_[j] += step.segment<3>(LedAt(j));
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
  Eigen::MatrixXd spread_;
  Eigen::VectorXd pull_;
};

// The point that does not belong to the others, if there is one.
std::optional<TargetCalibrationFailure> Outlier(const TargetCalibration& found) {
  const auto worst = std::max_element(
      found.sightings.begin(),
      found.sightings.end(),
      [](const TargetSighting& a, const TargetSighting& b) { return a.misfit < b.misfit; });
  // Where all points scatter more than was declared, it is the declaration that is wrong.
  const double rest = Factor2(found.chi2 - worst->misfit, found.dof - 3);
  if (!(worst->misfit > kMostMisfit * rest)) return {};
  TargetCalibrationFailure failure;
  failure.fault = TargetCalibrationFault::kDoesNotFit;
  failure.led = worst->led;
  failure.placement = worst->placement;
  failure.off_m = worst->from_others_m;
  for (const TargetSighting& other : found.sightings) {
    const bool is_as_bad = other.misfit > worst->misfit - 1.0;
    if (other.led == worst->led && other.placement != worst->placement && is_as_bad) {
      failure.or_placement = other.placement;
    }
  }
  return failure;
}

// The inclinometer feels the site's plumb line, which the total station knows.
void FindMounting(std::span<const TargetPlacement> placements,
                  const Adjustment& adjustment,
                  TargetCalibration* result) {
  std::vector<TiltPlacement> tilted;
  for (std::size_t i = 0; i < placements.size(); ++i) {
    if (!placements[i].up_in_housing) continue;
    TiltPlacement one;
    one.camera_from_board = result->site_from_target[i].rotation.conjugate().toRotationMatrix();
    one.up_in_housing = *placements[i].up_in_housing;
    one.tilt_sigma_rad = placements[i].tilt_sigma_rad;
    one.camera_sigma_rad = result->sigma_factor * adjustment.UpSigma_rad(i);
    tilted.push_back(one);
  }
  TiltRotationOptions options;
  options.up_in_board = Eigen::Vector3d::UnitZ();
  const auto rotation = FindTiltRotation(tilted, options);
  if (!rotation) {
    result->mounting_missing = rotation.error();
    return;
  }
  result->housing_from_target = rotation->camera_from_housing.transpose();
  result->mounting_covariance = Factor2(rotation->chi2, rotation->dof) * rotation->covariance;
}

std::optional<TargetCalibrationFailure> Unmeasured(std::size_t leds,
                                                   std::span<const TargetPlacement> placements) {
  TargetCalibrationFailure failure;
  if (placements.empty()) return failure;
  for (std::size_t j = 0; j < leds; ++j) {
    const auto has_it = [j](const TargetPlacement& one) {
      return one.led_in_site_m[j].has_value();
    };
    if (std::any_of(placements.begin(), placements.end(), has_it)) continue;
    failure.fault = TargetCalibrationFault::kNeverMeasured;
    failure.led = j;
    return failure;
  }
  return {};
}

}  // namespace

Result<TargetCalibration, TargetCalibrationFailure> CalibrateTarget(
    std::span<const Eigen::Vector3d> nominal_m,
    std::span<const TargetPlacement> placements,
    double most_off_m) {
  std::vector<Rigid3> starts;
  for (std::size_t i = 0; i < placements.size(); ++i) {
    const auto start = StartTarget(nominal_m, placements[i].led_in_site_m, most_off_m);
    if (!start) {
      TargetCalibrationFailure failure = start.error();
      failure.placement = i;
      return Failure{std::move(failure)};
    }
    starts.push_back(*start);
  }
  if (const auto failure = Unmeasured(nominal_m.size(), placements)) return Failure{*failure};
  Adjustment adjustment(nominal_m, placements, std::move(starts));
  adjustment.Solve();
  TargetCalibration result = adjustment.Found();
  if (result.dof > 0) {
    if (const auto outlier = Outlier(result)) return Failure{*outlier};
  }
  FindMounting(placements, adjustment, &result);
  return result;
}

}  // namespace tbm
