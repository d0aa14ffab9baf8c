#include "guidance/station/reference_check.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "pose/solve/tails.h"

namespace tbm {
namespace {

// Non-centrality with which a chi-squared test at a risk of 1e-3 finds a shift in 95 of 100 cases,
// for 1 to 12 degrees of freedom: 24 to 37; the larger one serves for all.
constexpr double kFoundNonCentrality = 37.0;

// One value read twice, whitened by the noise of both readings.
struct Difference {
  int reference;
  double value;                   // now minus then, in sigmas
  Eigen::RowVector4d by_station;  // what the station's shift adds to it
};

struct Mean {
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();  // from what `station` reads there
  Eigen::Vector3d weight = Eigen::Vector3d::Zero();
};

// The three values as offsets from the computed reading, so that circles near zero average well.
Eigen::Vector3d OffsetOf(const PolarReading& reading, const PolarReading& computed) {
  return {HalfTurn(reading.circle_rad - computed.circle_rad),
          reading.zenith_rad - computed.zenith_rad,
          reading.slope_m ? *reading.slope_m - *computed.slope_m : 0.0};
}

Eigen::Vector3d WeightOf(const ReferenceSighting& sighting) {
  const PolarSigma& sigma = sighting.sigma;
  return {1.0 / (sigma.circle_rad * sigma.circle_rad),
          1.0 / (sigma.zenith_rad * sigma.zenith_rad),
          sighting.reading.slope_m ? 1.0 / (sigma.slope_m * sigma.slope_m) : 0.0};
}

std::vector<Difference> DifferencesOf(const Station& station,
                                      std::span<const Reference> references,
                                      std::span<const ReferenceSighting> then,
                                      std::span<const ReferenceSighting> now,
                                      const SightModel& model) {
  std::vector<Difference> differences;
  for (const ReferenceSighting& sighting : now) {
    const int reference = sighting.reference;
    if (reference < 0 || reference >= static_cast<int>(references.size())) continue;
    const Eigen::Vector3d& p = references[static_cast<std::size_t>(reference)].p_in_site;
    const auto computed = Sight(station, p, model);
    if (!computed) continue;
    Mean mean;
    for (const ReferenceSighting& earlier : then) {
      if (earlier.reference != reference) continue;
      const Eigen::Vector3d weight = WeightOf(earlier);
      mean.offset += weight.cwiseProduct(OffsetOf(earlier.reading, *computed));
      mean.weight += weight;
    }
    const Eigen::Vector3d offset = OffsetOf(sighting.reading, *computed);
    const Eigen::Vector3d weight = WeightOf(sighting);
    const SightJacobian by = SightBy(station, p, model);
    for (int i = 0; i < 3; ++i) {
      if (mean.weight[i] == 0.0 || weight[i] == 0.0) continue;
      const double sigma = std::sqrt(1.0 / mean.weight[i] + 1.0 / weight[i]);
      differences.push_back({reference,
                             (offset[i] - mean.offset[i] / mean.weight[i]) / sigma,
                             by.by_station.row(i) / sigma});
    }
  }
  return differences;
}

struct Fit {
  Eigen::Vector4d shift;
  StationCovariance covariance;
  double chi2;
  int dof;
};

std::optional<Fit> FitShift(const std::vector<Difference>& differences) {
  Eigen::Matrix4d information = Eigen::Matrix4d::Zero();
  Eigen::Vector4d gradient = Eigen::Vector4d::Zero();
  for (const Difference& d : differences) {
    information += d.by_station.transpose() * d.by_station;
    gradient += d.by_station.transpose() * d.value;
  }
  const Eigen::LLT<Eigen::Matrix4d> factor(information);
  if (factor.info() != Eigen::Success) return {};
  Fit fit{factor.solve(gradient),
          factor.solve(Eigen::Matrix4d::Identity()),
          0.0,
          static_cast<int>(differences.size()) - 4};
  for (const Difference& d : differences) {
    const double left = d.value - d.by_station * fit.shift;
    fit.chi2 += left * left;
  }
  return fit;
}

// How large a plan shift of the station is found whatever its direction, the circle zero free to
// turn along: from the information about the plan that turning does not explain.
std::optional<double> SmallestShiftSeen(const std::vector<Difference>& differences) {
  Eigen::Matrix4d information = Eigen::Matrix4d::Zero();
  for (const Difference& d : differences) information += d.by_station.transpose() * d.by_station;
  if (!(information(3, 3) > 0.0)) return {};
  const Eigen::Vector2d mixed = information.block<2, 1>(0, 3);
  const Eigen::Matrix2d plan =
      information.topLeftCorner<2, 2>() - mixed * mixed.transpose() / information(3, 3);
  const double least =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(plan, Eigen::EigenvaluesOnly).eigenvalues()[0];
  if (!(least > 1e-9 * plan.trace())) return {};
  return std::sqrt(kFoundNonCentrality / least);
}

bool Agrees(double chi2, int dof, double gate_risk) {
  return dof > 0 && ChiSquaredTail(chi2, dof) >= gate_risk;
}

}  // namespace

ReferenceCheck CheckReferences(const Station& station,
                               std::span<const Reference> references,
                               std::span<const ReferenceSighting> then,
                               std::span<const ReferenceSighting> now,
                               const CheckOptions& options) {
  ReferenceCheck check;
  const std::vector<Difference> differences =
      DifferencesOf(station, references, then, now, options.sight);
  if (differences.empty()) return check;
  check.dof = static_cast<int>(differences.size());
  for (const Difference& d : differences) {
    check.chi2 += d.value * d.value;
    check.largest_standardised = std::max(check.largest_standardised, std::abs(d.value));
  }
  check.sees_m = SmallestShiftSeen(differences);
  if (Agrees(check.chi2, check.dof, options.gate_risk)) {
    check.verdict = CheckVerdict::kGood;
    return check;
  }
  std::vector<int> suspects;
  for (int i = 0; i < static_cast<int>(references.size()); ++i) {
    double chi2 = 0.0;
    int dof = 0;
    for (const Difference& d : differences) {
      if (d.reference == i) continue;
      chi2 += d.value * d.value;
      ++dof;
    }
    if (dof < check.dof && Agrees(chi2, dof, options.gate_risk)) suspects.push_back(i);
  }
  const std::optional<Fit> fit = FitShift(differences);
  const bool station_fits = fit && Agrees(fit->chi2, fit->dof, options.gate_risk);
  if (suspects.size() == 1 && !station_fits) {
    check.verdict = CheckVerdict::kReferenceMoved;
    check.moved_reference = suspects.front();
  } else if (suspects.empty() && station_fits) {
    check.verdict = CheckVerdict::kStationMoved;
    check.station_shift = fit->shift;
    check.shift_covariance = fit->covariance;
  } else {
    check.verdict = CheckVerdict::kUnclear;
  }
  return check;
}

}  // namespace tbm
