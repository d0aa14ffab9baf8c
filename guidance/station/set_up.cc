#include "guidance/station/set_up.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "pose/solve/tails.h"

namespace tbm {
namespace {

// The station's four unknowns and the refraction, which is known by its prior only and passes into
// the covariance of the four.
constexpr int kUnknowns = 5;
using Unknowns = Eigen::Matrix<double, kUnknowns, 1>;
using Information = Eigen::Matrix<double, kUnknowns, kUnknowns>;

constexpr int kMostSteps = 30;
// A micrometre's thousandth, and what turns a point at 1 km by as much.
constexpr double kSettled_m = 1e-9;
constexpr double kSettled_rad = 1e-12;
constexpr double kLeastApart_m = 1.0;  // of the two references that a free station starts from
constexpr double kLeastReferenceSigma_m = 1e-6;

struct State {
  Station station;
  double refraction_k;
};

// All sightings on one reference: their values, whitened together because the reference's own error
// is common to them.
struct Block {
  int reference = 0;
  std::vector<std::size_t> sightings;
  Eigen::MatrixXd rows;        // d value / d unknowns
  Eigen::VectorXd misclosure;  // observed minus computed
  Eigen::MatrixXd covariance;  // of the misclosure for a perfect station
};

int ValuesOf(const ReferenceSighting& sighting) { return sighting.reading.slope_m ? 3 : 2; }

class Problem {
 public:
  Problem(std::span<const Reference> references,
          std::span<const ReferenceSighting> sightings,
          const StationPrior& prior,
          const SetUpOptions& options)
      : references_(references), sightings_(sightings), prior_(prior), options_(options) {}

  // `left_out` is no reference's index when all are used.
  Result<SetUp, SetUpFailure> Solve(std::optional<int> left_out) const;

 private:
  std::vector<Block> Blocks(std::optional<int> left_out) const;
  std::optional<State> Start(const std::vector<Block>& blocks) const;
  bool StartFree(const std::vector<Block>& blocks, Station& station) const;
  void Linearise(const State& state, Block& block) const;
  void AddPrior(const State& state,
                Information& information,
                Unknowns& gradient,
                double& chi2) const;
  std::optional<State> Converge(State state, std::vector<Block>& blocks) const;
  void FillResiduals(const Information& cofactor,
                     const std::vector<Block>& blocks,
                     SetUp& set_up) const;
  SightModel ModelOf(const State& state) const {
    SightModel model = options_.sight;
    model.refraction_k = state.refraction_k;
    return model;
  }

  std::span<const Reference> references_;
  std::span<const ReferenceSighting> sightings_;
  const StationPrior& prior_;
  const SetUpOptions& options_;
};

std::vector<Block> Problem::Blocks(std::optional<int> left_out) const {
  std::vector<Block> blocks;
  for (std::size_t i = 0; i < sightings_.size(); ++i) {
    const int reference = sightings_[i].reference;
    if (left_out == reference) continue;
    const auto at = std::find_if(blocks.begin(), blocks.end(), [&](const Block& block) {
      return block.reference == reference;
    });
    Block& block = at != blocks.end() ? *at : blocks.emplace_back();
    block.reference = reference;
    block.sightings.push_back(i);
  }
  return blocks;
}

// Plan as complex numbers, north + i east: site = station + exp(i zero) local. With both centred on
// their means the angle of the sum of site * conj(local) is the zero's bearing.
bool Problem::StartFree(const std::vector<Block>& blocks, Station& station) const {
  std::vector<Eigen::Vector3d> local;
  std::vector<Eigen::Vector3d> site;
  for (const Block& block : blocks) {
    for (const std::size_t i : block.sightings) {
      const auto point = PointSighted({}, sightings_[i].reading, options_.sight);
      if (!point) continue;
      local.push_back(*point);
      site.push_back(references_[static_cast<std::size_t>(block.reference)].p_in_site);
      break;
    }
  }
  if (site.size() < 2) return false;
  Eigen::Vector3d local_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d site_mean = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < site.size(); ++i) {
    local_mean += local[i] / static_cast<double>(site.size());
    site_mean += site[i] / static_cast<double>(site.size());
  }
  double in_phase = 0.0;
  double in_quadrature = 0.0;
  double farthest_m = 0.0;
  for (std::size_t i = 0; i < site.size(); ++i) {
    const Eigen::Vector3d a = local[i] - local_mean;
    const Eigen::Vector3d b = site[i] - site_mean;
    in_phase += b.y() * a.y() + b.x() * a.x();
    in_quadrature += b.x() * a.y() - b.y() * a.x();
    farthest_m = std::max(farthest_m, 2.0 * std::hypot(b.x(), b.y()));
  }
  if (!(farthest_m > kLeastApart_m)) return false;
  const double zero_rad = std::atan2(in_quadrature, in_phase);
  const double c = std::cos(zero_rad);
  const double s = std::sin(zero_rad);
  const Eigen::Vector3d turned(c * local_mean.x() + s * local_mean.y(),
                               c * local_mean.y() - s * local_mean.x(),
                               local_mean.z());
  station = {site_mean - turned, Turn(zero_rad)};
  return true;
}

std::optional<State> Problem::Start(const std::vector<Block>& blocks) const {
  State state{prior_.station, options_.sight.refraction_k};
  const bool plan_known = prior_.sigma[0] && prior_.sigma[1];
  if (!plan_known) {
    Station free;
    if (!StartFree(blocks, free)) return {};
    if (prior_.sigma[2]) free.p_axes_in_site.z() = prior_.station.p_axes_in_site.z();
    state.station = free;
    return state;
  }
  if (!prior_.sigma[3]) {
    const ReferenceSighting& backsight = sightings_[blocks.front().sightings.front()];
    const auto seen = Sight({prior_.station.p_axes_in_site, 0.0},
                            references_[static_cast<std::size_t>(backsight.reference)].p_in_site,
                            options_.sight);
    if (!seen) return {};
    state.station.circle_zero_bearing_rad = Turn(seen->circle_rad - backsight.reading.circle_rad);
  }
  if (!prior_.sigma[2]) {
    for (const Block& block : blocks) {
      for (const std::size_t i : block.sightings) {
        const auto point = PointSighted({}, sightings_[i].reading, options_.sight);
        if (!point) continue;
        state.station.p_axes_in_site.z() =
            references_[static_cast<std::size_t>(block.reference)].p_in_site.z() - point->z();
        return state;
      }
    }
    return {};
  }
  return state;
}

void Problem::Linearise(const State& state, Block& block) const {
  const Reference& reference = references_[static_cast<std::size_t>(block.reference)];
  const SightModel model = ModelOf(state);
  const auto computed = Sight(state.station, reference.p_in_site, model);
  const SightJacobian by = SightBy(state.station, reference.p_in_site, model);
  // Zenith by k: the apparent rise grows by h^2 / (2 R) for each whole k.
  const double h_m = computed ? *computed->slope_m * std::sin(computed->zenith_rad) : 0.0;
  const double rise_by_k_m = h_m * h_m / (2.0 * model.earth_radius_m);
  int values = 0;
  for (const std::size_t i : block.sightings) values += ValuesOf(sightings_[i]);
  block.rows.setZero(values, kUnknowns);
  block.misclosure.setZero(values);
  Eigen::MatrixXd by_reference = Eigen::MatrixXd::Zero(values, 3);
  Eigen::VectorXd variance(values);
  int row = 0;
  for (const std::size_t i : block.sightings) {
    const ReferenceSighting& sighting = sightings_[i];
    const int count = ValuesOf(sighting);
    const Eigen::Vector3d by_k(0.0,
                               -h_m * rise_by_k_m / std::pow(*computed->slope_m, 2),
                               std::cos(computed->zenith_rad) * rise_by_k_m);
    const Eigen::Vector3d sigma(
        sighting.sigma.circle_rad, sighting.sigma.zenith_rad, sighting.sigma.slope_m);
    const Eigen::Vector3d misclosure(HalfTurn(sighting.reading.circle_rad - computed->circle_rad),
                                     sighting.reading.zenith_rad - computed->zenith_rad,
                                     sighting.reading.slope_m.value_or(0.0) - *computed->slope_m);
    block.rows.block(row, 0, count, 4) = by.by_station.topRows(count);
    block.rows.block(row, 4, count, 1) = by_k.head(count);
    by_reference.middleRows(row, count) = by.by_point.topRows(count);
    variance.segment(row, count) = sigma.head(count).cwiseAbs2();
    block.misclosure.segment(row, count) = misclosure.head(count);
    row += count;
  }
  const double sigma_m = std::max(reference.sigma_m, kLeastReferenceSigma_m);
  block.covariance = sigma_m * sigma_m * by_reference * by_reference.transpose();
  block.covariance.diagonal() += variance;
}

void Problem::AddPrior(const State& state,
                       Information& information,
                       Unknowns& gradient,
                       double& chi2) const {
  const auto add = [&](int index, double off, double sigma) {
    const double weight = 1.0 / (sigma * sigma);
    information(index, index) += weight;
    gradient[index] += weight * off;
    chi2 += weight * off * off;
  };
  for (int i = 0; i < 3; ++i) {
    const auto& sigma = prior_.sigma[static_cast<std::size_t>(i)];
    if (sigma) {
      add(i,
          prior_.station.p_axes_in_site[i] - state.station.p_axes_in_site[i],
          std::max(*sigma, kLeastReferenceSigma_m));
    }
  }
  if (prior_.sigma[3]) {
    add(3,
        HalfTurn(prior_.station.circle_zero_bearing_rad - state.station.circle_zero_bearing_rad),
        std::max(*prior_.sigma[3], kSettled_rad));
  }
  add(4,
      options_.sight.refraction_k - state.refraction_k,
      std::max(options_.refraction_k_sigma, kLeastReferenceSigma_m));
}

std::optional<State> Problem::Converge(State state, std::vector<Block>& blocks) const {
  for (int step = 0; step < kMostSteps; ++step) {
    Information information = Information::Zero();
    Unknowns gradient = Unknowns::Zero();
    double chi2 = 0.0;
    AddPrior(state, information, gradient, chi2);
    for (Block& block : blocks) {
      const Eigen::Vector3d& p = references_[static_cast<std::size_t>(block.reference)].p_in_site;
      if (!Sight(state.station, p, options_.sight)) return {};
      Linearise(state, block);
      const Eigen::LLT<Eigen::MatrixXd> weight(block.covariance);
      information += block.rows.transpose() * weight.solve(block.rows);
      gradient += block.rows.transpose() * weight.solve(block.misclosure);
    }
    const Eigen::LDLT<Information> factor(information);
    if (factor.info() != Eigen::Success || !factor.isPositive()) return {};
    const Unknowns change = factor.solve(gradient);
    if (!change.allFinite()) return {};
    state.station.p_axes_in_site += change.head<3>();
    state.station.circle_zero_bearing_rad = Turn(state.station.circle_zero_bearing_rad + change[3]);
    state.refraction_k += change[4];
    if (change.head<3>().norm() < kSettled_m && std::abs(change[3]) < kSettled_rad) return state;
  }
  return {};
}

// For the values of one block: covariance of the residual = covariance of the misclosure minus what
// the adjustment has taken up; the checked share is the diagonal of residual covariance by weight.
void Problem::FillResiduals(const Information& cofactor,
                            const std::vector<Block>& blocks,
                            SetUp& set_up) const {
  set_up.residuals.assign(sightings_.size(), {});
  for (const Block& block : blocks) {
    const bool used = set_up.left_out != block.reference;
    const Eigen::MatrixXd taken = block.rows * cofactor * block.rows.transpose();
    const Eigen::MatrixXd left = used ? Eigen::MatrixXd(block.covariance - taken)
                                      : Eigen::MatrixXd(block.covariance + taken);
    const Eigen::LLT<Eigen::MatrixXd> weight(block.covariance);
    const Eigen::MatrixXd share =
        used ? Eigen::MatrixXd(weight.solve(left))
             : Eigen::MatrixXd(Eigen::MatrixXd::Identity(left.rows(), left.cols()));
    int row = 0;
    for (const std::size_t i : block.sightings) {
      const ReferenceSighting& sighting = sightings_[i];
      SightingResidual& residual = set_up.residuals[i];
      const int count = ValuesOf(sighting);
      const double slope_m = (references_[static_cast<std::size_t>(block.reference)].p_in_site -
                              set_up.station.p_axes_in_site)
                                 .norm();
      residual.reference = block.reference;
      residual.circle_rad = block.misclosure[row];
      residual.zenith_rad = block.misclosure[row + 1];
      if (count == 3) residual.slope_m = block.misclosure[row + 2];
      residual.across_m = residual.circle_rad * slope_m * std::sin(sighting.reading.zenith_rad);
      residual.up_m = -residual.zenith_rad * slope_m;
      for (int k = row; k < row + count; ++k) {
        residual.checked_share += share(k, k) / count;
        // What nothing checks has no residual but rounding.
        if (left(k, k) < 1e-6 * block.covariance(k, k)) continue;
        residual.standardised =
            std::max(residual.standardised, std::abs(block.misclosure[k]) / std::sqrt(left(k, k)));
      }
      row += count;
    }
  }
}

Result<SetUp, SetUpFailure> Problem::Solve(std::optional<int> left_out) const {
  std::vector<Block> blocks = Blocks(left_out);
  int values = 0;
  for (const Block& block : blocks) {
    for (const std::size_t i : block.sightings) values += ValuesOf(sightings_[i]);
  }
  const auto known = std::count_if(prior_.sigma.begin(), prior_.sigma.end(), [](const auto& sigma) {
    return sigma.has_value();
  });
  const int dof = values + static_cast<int>(known) - 4;
  if (blocks.empty() || dof < 0) return Failure{SetUpFailure::kTooFewSightings};
  const std::optional<State> start = Start(blocks);
  if (!start) return Failure{SetUpFailure::kNoStart};
  const std::optional<State> state = Converge(*start, blocks);
  if (!state) return Failure{SetUpFailure::kNotConverged};

  SetUp set_up;
  set_up.station = state->station;
  set_up.left_out = left_out;
  set_up.dof = dof;
  Information information = Information::Zero();
  Unknowns gradient = Unknowns::Zero();
  AddPrior(*state, information, gradient, set_up.chi2);
  for (Block& block : blocks) {
    Linearise(*state, block);
    const Eigen::LLT<Eigen::MatrixXd> weight(block.covariance);
    information += block.rows.transpose() * weight.solve(block.rows);
    set_up.chi2 += block.misclosure.dot(weight.solve(block.misclosure));
  }
  const Information cofactor = information.ldlt().solve(Information::Identity());
  set_up.covariance = cofactor.topLeftCorner<4, 4>();
  const Eigen::Vector4d sigma = set_up.covariance.diagonal().cwiseSqrt();
  if (!(sigma.head<3>().maxCoeff() <= options_.worst_sigma_m) ||
      !(sigma[3] <= options_.worst_sigma_rad)) {
    return Failure{SetUpFailure::kWeakGeometry};
  }
  if (left_out) {
    for (Block& block : Blocks({})) {
      if (block.reference != *left_out) continue;
      const Reference& reference = references_[static_cast<std::size_t>(block.reference)];
      if (!Sight(state->station, reference.p_in_site, options_.sight)) continue;
      Linearise(*state, block);
      blocks.push_back(std::move(block));
    }
  }
  FillResiduals(cofactor, blocks, set_up);
  return set_up;
}

bool IsFinite(const Reference& reference) {
  return reference.p_in_site.allFinite() && reference.sigma_m >= 0.0 &&
         std::isfinite(reference.sigma_m);
}

bool IsFinite(const ReferenceSighting& sighting) {
  const PolarReading& reading = sighting.reading;
  const PolarSigma& sigma = sighting.sigma;
  const auto is_sigma = [](double value) { return value > 0.0 && std::isfinite(value); };
  return std::isfinite(reading.circle_rad) && std::isfinite(reading.zenith_rad) &&
         is_sigma(sigma.circle_rad) && is_sigma(sigma.zenith_rad) &&
         (!reading.slope_m || (std::isfinite(*reading.slope_m) && is_sigma(sigma.slope_m)));
}

bool Agrees(const SetUp& set_up, double gate_risk) {
  return set_up.dof == 0 || ChiSquaredTail(set_up.chi2, set_up.dof) >= gate_risk;
}

}  // namespace

Result<SetUp, SetUpFailure> SolveSetUp(std::span<const Reference> references,
                                       std::span<const ReferenceSighting> sightings,
                                       const StationPrior& prior,
                                       const SetUpOptions& options) {
  for (const ReferenceSighting& sighting : sightings) {
    if (sighting.reference < 0 || sighting.reference >= static_cast<int>(references.size())) {
      return Failure{SetUpFailure::kNoSuchReference};
    }
    if (!IsFinite(sighting) ||
        !IsFinite(references[static_cast<std::size_t>(sighting.reference)])) {
      return Failure{SetUpFailure::kNotFinite};
    }
  }
  const Problem problem(references, sightings, prior, options);
  Result<SetUp, SetUpFailure> all = problem.Solve({});
  const bool disagrees = all && !Agrees(*all, options.gate_risk);
  // A gross error can also keep the adjustment from converging.
  if (!disagrees && (all || all.error() != SetUpFailure::kNotConverged)) return all;
  std::optional<SetUp> mended;
  for (std::size_t i = 0; i < references.size(); ++i) {
    Result<SetUp, SetUpFailure> without = problem.Solve(static_cast<int>(i));
    // Without a check left the rest cannot be said to agree.
    if (!without || without->dof == 0 || !Agrees(*without, options.gate_risk)) continue;
    if (mended) return Failure{SetUpFailure::kInconsistent};
    mended = std::move(without).value();
  }
  if (!mended) return Failure{SetUpFailure::kInconsistent};
  return *std::move(mended);
}

}  // namespace tbm
