#include "pose/calibrate/target_calibration.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "pose/calibrate/misfit.h"
#include "pose/calibrate/target_fit.h"

namespace tbm {
namespace {

constexpr int kIterations = 20;
// What is left of the weight of a point that is left out. Not 0: without it a placement may have
// fewer LEDs than it takes.
constexpr double kLeftOut = 1e-6;

// Unknowns: three for each LED, then turn (about the site's axes) and shift for each placement.
class Adjustment {
 public:
  Adjustment(std::span<const Eigen::Vector3d> nominal_m,
             std::span<const TargetPlacement> placements,
             std::vector<Rigid3> site_from_target)
      : nominal_(nominal_m),
        placements_(placements),
        leds_(nominal_m.begin(), nominal_m.end()),
        site_from_target_(std::move(site_from_target)) {
    for (std::size_t i = 0; i < placements.size(); ++i) {
      for (std::size_t j = 0; j < leds_.size(); ++j) {
        if (placements[i].led_in_site_m[j]) points_.push_back({i, j});
      }
    }
  }

  const std::vector<TargetPoint>& points() const { return points_; }
  double SigmaOf(const TargetPoint& point) const { return placements_[point.placement].sigma_m; }

  void Solve(const std::vector<bool>& is_out) {
    is_out_ = is_out;
    for (int i = 0; i < kIterations; ++i) {
      Fill();
      const Eigen::VectorXd step = information_.ldlt().solve(pull_);
      Move(step);
      if (step.norm() < 1e-11) break;
    }
    Fill();
    spread_ = information_.inverse();
  }

  AdjustedFit Fit() const {
    AdjustedFit fit;
    double dof = 0.0;
    for (std::size_t k = 0; k < points_.size(); ++k) {
      const Eigen::Matrix3d control = Control(k);
      const Eigen::Vector3d off_sigmas = Off(points_[k]) / SigmaOf(points_[k]);
      fit.misfits.push_back(MisfitOf(control, off_sigmas));
      if (is_out_[k]) continue;
      fit.chi2 += off_sigmas.squaredNorm();
      dof += control.trace();
    }
    fit.dof = static_cast<int>(std::lround(dof));
    return fit;
  }

  TargetCalibration Found() const {
    const AdjustedFit fit = Fit();
    TargetCalibration result;
    result.led_in_target_m = leds_;
    result.site_from_target = site_from_target_;
    result.chi2 = fit.chi2;
    result.dof = fit.dof;
    result.sigma_factor = ScatterFactor(fit.chi2, fit.dof);
    for (std::size_t k = 0; k < points_.size(); ++k) {
      const auto& [i, j] = points_[k];
      const Misfit& misfit = fit.misfits[k];
      result.sightings.push_back({i,
                                  j,
                                  Off(points_[k]),
                                  misfit.chi2,
                                  misfit.dof,
                                  misfit.from_others_sigmas * SigmaOf(points_[k])});
    }
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

  Eigen::Vector3d Off(const TargetPoint& point) const {
    const auto& [i, j] = point;
    return *placements_[i].led_in_site_m[j] - site_from_target_[i] * leds_[j];
  }

  Eigen::Matrix<double, 3, 6> ByPlacement(const TargetPoint& point) const {
    const auto& [i, j] = point;
    Eigen::Matrix<double, 3, 6> by_placement;
    by_placement.leftCols<3>() = -Skew(site_from_target_[i].rotation * leds_[j]);
    by_placement.rightCols<3>().setIdentity();
    return by_placement;
  }

  // Which share of an error of this point shows in its residual: one less what the point itself
  // says of the unknowns.
  Eigen::Matrix3d Control(std::size_t k) const {
    const TargetPoint& point = points_[k];
    const Eigen::Index l = LedAt(point.led);
    const Eigen::Index p = PlacementAt(point.placement);
    const Eigen::Matrix3d by_led = site_from_target_[point.placement].rotation.toRotationMatrix();
    const Eigen::Matrix<double, 3, 6> by_placement = ByPlacement(point);
    const Eigen::Matrix3d mixed = by_led * spread_.block<3, 6>(l, p) * by_placement.transpose();
    const Eigen::Matrix3d adjusted =
        by_led * spread_.block<3, 3>(l, l) * by_led.transpose() + mixed + mixed.transpose() +
        by_placement * spread_.block<6, 6>(p, p) * by_placement.transpose();
    return Eigen::Matrix3d::Identity() - WeightOf(k) * adjusted;
  }

  double WeightOf(std::size_t k) const {
    const double sigma_m = SigmaOf(points_[k]);
    return (is_out_[k] ? kLeftOut : 1.0) / (sigma_m * sigma_m);
  }

  void Fill() {
    const Eigen::Index size = PlacementAt(placements_.size());
    information_ = Eigen::MatrixXd::Zero(size, size);
    pull_ = Eigen::VectorXd::Zero(size);
    double largest_weight = 0.0;
    for (std::size_t k = 0; k < points_.size(); ++k) {
      const double weight = WeightOf(k);
      largest_weight = std::max(largest_weight, weight);
      const auto& [i, j] = points_[k];
      const Eigen::Matrix3d rotation = site_from_target_[i].rotation.toRotationMatrix();
      const Eigen::Index l = LedAt(j);
      const Eigen::Index p = PlacementAt(i);
      const Eigen::Matrix<double, 3, 6> by_placement = ByPlacement(points_[k]);
      const Eigen::Vector3d off = Off(points_[k]);
      information_.block<3, 3>(l, l) += weight * Eigen::Matrix3d::Identity();
      information_.block<6, 6>(p, p) += weight * by_placement.transpose() * by_placement;
      const Eigen::Matrix<double, 3, 6> mixed = weight * rotation.transpose() * by_placement;
      information_.block<3, 6>(l, p) += mixed;
      information_.block<6, 3>(p, l) += mixed.transpose();
      pull_.segment<3>(l) += weight * rotation.transpose() * off;
      pull_.segment<6>(p) += weight * by_placement.transpose() * off;
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
  std::vector<TargetPoint> points_;
  std::vector<bool> is_out_;  // side by side with these
  Eigen::MatrixXd information_;
  Eigen::MatrixXd spread_;
  Eigen::VectorXd pull_;
};

// Why the points contradict one another, if they do; the adjustment is left as it comes.
std::optional<TargetCalibrationFailure> Contradiction(Adjustment* adjustment) {
  const std::vector<TargetPoint>& points = adjustment->points();
  const std::vector<WrongMeasurement> wrong =
      FindWrong(points.size(), [&](const std::vector<bool>& is_out) {
        adjustment->Solve(is_out);
        return adjustment->Fit();
      });
  if (wrong.empty()) return {};
  TargetCalibrationFailure failure;
  failure.fault = TargetCalibrationFault::kDoesNotFit;
  for (const WrongMeasurement& one : wrong) {
    const TargetPoint& point = points[one.which];
    failure.wrong.push_back(
        {point, one.misfit.from_others_sigmas * adjustment->SigmaOf(point), {}});
    for (const std::size_t other : one.or_rather) {
      failure.wrong.back().or_rather.push_back(points[other]);
    }
  }
  return failure;
}

// None of them to blame, and more than any total station does.
std::optional<TargetCalibrationFailure> Scatter(const TargetCalibration& found) {
  if (!IsBeyondScatter(found.chi2, found.dof)) return {};
  const auto worst = std::max_element(
      found.sightings.begin(),
      found.sightings.end(),
      [](const TargetSighting& a, const TargetSighting& b) { return a.misfit < b.misfit; });
  TargetCalibrationFailure failure;
  failure.fault = TargetCalibrationFault::kScatters;
  failure.wrong = {{{worst->placement, worst->led}, worst->from_others_m, {}}};
  failure.sigma_factor = found.sigma_factor;
  return failure;
}

// The inclinometer feels the site's plumb line, which the total station knows.
void FindMounting(std::span<const TargetPlacement> placements,
                  const Adjustment& adjustment,
                  TargetCalibration* result) {
  std::vector<TiltPlacement> tilted;
  std::vector<std::size_t> which;
  for (std::size_t i = 0; i < placements.size(); ++i) {
    if (!placements[i].up_in_housing) continue;
    TiltPlacement one;
    one.camera_from_board = result->site_from_target[i].rotation.conjugate().toRotationMatrix();
    one.up_in_housing = *placements[i].up_in_housing;
    one.tilt_sigma_rad = placements[i].tilt_sigma_rad;
    one.camera_sigma_rad = result->sigma_factor * adjustment.UpSigma_rad(i);
    tilted.push_back(one);
    which.push_back(i);
  }
  TiltRotationOptions options;
  options.up_in_board = Eigen::Vector3d::UnitZ();
  const auto rotation = FindTiltRotation(tilted, options);
  if (!rotation) {
    result->mounting_missing = rotation.error();
    for (WrongTilt& wrong : result->mounting_missing->wrong) {
      wrong.placement = which[wrong.placement];
      for (std::size_t& other : wrong.or_rather) other = which[other];
    }
    return;
  }
  result->housing_from_target = rotation->camera_from_housing.transpose();
  result->mounting_covariance = rotation->covariance;
  result->mounting_factor = rotation->sigma_factor;
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
      for (WrongTargetPoint& wrong : failure.wrong) wrong.point.placement = i;
      return Failure{std::move(failure)};
    }
    starts.push_back(*start);
  }
  if (const auto failure = Unmeasured(nominal_m.size(), placements)) return Failure{*failure};
  Adjustment adjustment(nominal_m, placements, std::move(starts));
  if (auto failure = Contradiction(&adjustment)) return Failure{std::move(*failure)};
  adjustment.Solve(std::vector<bool>(adjustment.points().size(), false));
  TargetCalibration result = adjustment.Found();
  if (auto failure = Scatter(result)) return Failure{std::move(*failure)};
  FindMounting(placements, adjustment, &result);
  return result;
}

}  // namespace tbm
