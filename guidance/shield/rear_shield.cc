#include "guidance/shield/rear_shield.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

#include "pose/solve/dense_cholesky.h"
#include "pose/solve/tails.h"

namespace tbm {
namespace {

constexpr int kUnknowns = 7;                                         // turn, shift, speed
constexpr int kMostRows = 3 * static_cast<int>(kMaxPrismFixes) + 4;  // up: 2, heading, speed
constexpr int kMostSteps = 20;
constexpr double kSettled = 1e-10;  // [m], [rad]
constexpr double kLeastSigma = 1e-9;
// Prisms that span less than this in plan do not say how the shield is turned.
constexpr double kLeastSpan_m = 0.05;

using Rows = Eigen::Matrix<double, Eigen::Dynamic, kUnknowns, 0, kMostRows, kUnknowns>;
using Values = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMostRows, 1>;
using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMostRows, kMostRows>;
using Vector7 = Eigen::Matrix<double, kUnknowns, 1>;
using Matrix7 = Eigen::Matrix<double, kUnknowns, kUnknowns>;

struct State {
  Rigid3 site_from_shield;
  double speed_m_per_s;
};

// Which prism each fix is taken to be of, and which fixes are left out.
struct Naming {
  std::optional<int> left_out;
  std::optional<std::array<int, 2>> exchanged;

  int PrismOf(const PrismFix& fix) const {
    if (exchanged && fix.prism == (*exchanged)[0]) return (*exchanged)[1];
    if (exchanged && fix.prism == (*exchanged)[1]) return (*exchanged)[0];
    return fix.prism;
  }
  bool Uses(const PrismFix& fix) const { return left_out != fix.prism; }
};

const Eigen::Vector3d& PlaceOf(const RearShieldProblem& problem, int prism) {
  return problem.prisms[static_cast<std::size_t>(prism)].p_in_rear_shield;
}

// Rotation that brings `up` to the vertical by the shortest way, then turns about it so that the
// prisms fit best in plan (or the heading does). Complex numbers as in the station's set-up.
std::optional<Eigen::Quaterniond> StartFromUp(const RearShieldProblem& problem,
                                              const Naming& naming) {
  const Eigen::Quaterniond level =
      TurnBetween(problem.up->up_in_rear_shield, Eigen::Vector3d::UnitZ());
  Eigen::Vector3d body_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d site_mean = Eigen::Vector3d::Zero();
  int count = 0;
  for (const PrismFix& fix : problem.fixes) {
    if (!naming.Uses(fix)) continue;
    body_mean += level * PlaceOf(problem, naming.PrismOf(fix));
    site_mean += fix.p_in_site;
    ++count;
  }
  body_mean /= count;
  site_mean /= count;
  double in_phase = 0.0;
  double in_quadrature = 0.0;
  double span_m = 0.0;
  for (const PrismFix& fix : problem.fixes) {
    if (!naming.Uses(fix)) continue;
    const Eigen::Vector3d a = level * PlaceOf(problem, naming.PrismOf(fix)) - body_mean;
    const Eigen::Vector3d b = fix.p_in_site - site_mean;
    in_phase += a.x() * b.x() + a.y() * b.y();
    in_quadrature += a.x() * b.y() - a.y() * b.x();
    span_m = std::max(span_m, std::hypot(a.x(), a.y()));
  }
  double turn_rad = 0.0;  // about the vertical, anticlockwise
  if (span_m > kLeastSpan_m) {
    turn_rad = std::atan2(in_quadrature, in_phase);
  } else if (problem.heading) {
    turn_rad = HeadingOf({level, Eigen::Vector3d::Zero()}) - problem.heading->heading_rad;
  } else {
    return {};
  }
  return ExpRotation({0.0, 0.0, turn_rad}) * level;
}

// The rotation that fits three or more points best: Kabsch's, by singular values.
std::optional<Eigen::Quaterniond> StartFromPrisms(const RearShieldProblem& problem,
                                                  const Naming& naming) {
  Eigen::Vector3d body_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d site_mean = Eigen::Vector3d::Zero();
  int count = 0;
  for (const PrismFix& fix : problem.fixes) {
    if (!naming.Uses(fix)) continue;
    body_mean += PlaceOf(problem, naming.PrismOf(fix));
    site_mean += fix.p_in_site;
    ++count;
  }
  if (count < 3) return {};
  body_mean /= count;
  site_mean /= count;
  Eigen::Matrix3d mixed = Eigen::Matrix3d::Zero();
  for (const PrismFix& fix : problem.fixes) {
    if (!naming.Uses(fix)) continue;
    mixed += (fix.p_in_site - site_mean) *
             (PlaceOf(problem, naming.PrismOf(fix)) - body_mean).transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(mixed, Eigen::ComputeFullU | Eigen::ComputeFullV);
  // On one line, or all in one place: any turn about the line fits as well.
  if (!(std::sqrt(svd.singularValues()[1]) > kLeastSpan_m)) return {};
  Eigen::Matrix3d u = svd.matrixU();
  if (u.determinant() * svd.matrixV().determinant() < 0.0) u.col(2) = -u.col(2);
  return Eigen::Quaterniond(Eigen::Matrix3d(u * svd.matrixV().transpose()));
}

std::optional<State> Start(const RearShieldProblem& problem, const Naming& naming) {
  std::optional<Eigen::Quaterniond> turned;
  if (problem.up) turned = StartFromUp(problem, naming);
  if (!turned) turned = StartFromPrisms(problem, naming);
  if (!turned && problem.start) turned = problem.start->rotation;
  if (!turned) return {};
  State state{{*turned, Eigen::Vector3d::Zero()}, problem.speed_m_per_s};
  int count = 0;
  for (const PrismFix& fix : problem.fixes) {
    if (!naming.Uses(fix)) continue;
    state.site_from_shield.translation +=
        fix.p_in_site - *turned * PlaceOf(problem, naming.PrismOf(fix));
    ++count;
  }
  state.site_from_shield.translation /= count;
  return state;
}

struct System {
  Rows rows;
  Values misclosure;
  Square covariance;
  int fix_rows = 0;
};

void Assemble(const RearShieldProblem& problem,
              const Naming& naming,
              const State& state,
              System& system) {
  int fixes = 0;
  for (const PrismFix& fix : problem.fixes) fixes += naming.Uses(fix);
  system.fix_rows = 3 * fixes;
  const int count = system.fix_rows + (problem.up ? 2 : 0) + (problem.heading ? 1 : 0) + 1;
  system.rows.setZero(count, kUnknowns);
  system.misclosure.setZero(count);
  system.covariance.setZero(count, count);
  const Eigen::Matrix3d turned = state.site_from_shield.rotation.toRotationMatrix();

  Eigen::Matrix<double, Eigen::Dynamic, 4, 0, kMostRows, 4> by_station;
  by_station.setZero(system.fix_rows, 4);
  FixedVector<int, kMaxPrismFixes> prism_of_row;
  int row = 0;
  for (const PrismFix& fix : problem.fixes) {
    if (!naming.Uses(fix)) continue;
    const int prism = naming.PrismOf(fix);
    const double ahead_s = SecondsBetween(problem.at, fix.sensed_at);
    Eigen::Vector3d p = PlaceOf(problem, prism);
    p.x() += state.speed_m_per_s * ahead_s + fix.moved_m;
    system.rows.block<3, 6>(row, 0) = PointByError(state.site_from_shield, p);
    system.rows.block<3, 1>(row, 6) = turned.col(0) * ahead_s;
    system.misclosure.segment<3>(row) = fix.p_in_site - state.site_from_shield * p;
    system.covariance.block<3, 3>(row, row) +=
        fix.covariance +
        fix.moved_sigma_m * fix.moved_sigma_m * turned.col(0) * turned.col(0).transpose();
    by_station.middleRows<3>(row) = fix.by_station;
    for (std::size_t other = 0; other <= prism_of_row.size(); ++other) {
      const bool same = other == prism_of_row.size() || prism_of_row[other] == prism;
      if (!same) continue;
      const double sigma_m = problem.prisms[static_cast<std::size_t>(prism)].sigma_m;
      const int at = 3 * static_cast<int>(other);
      for (int i = 0; i < 3; ++i) {
        system.covariance(row + i, at + i) += sigma_m * sigma_m;
        if (at != row) system.covariance(at + i, row + i) += sigma_m * sigma_m;
      }
    }
    prism_of_row.push_back(prism);
    row += 3;
  }
  system.covariance.topLeftCorner(row, row) +=
      by_station * problem.station_covariance * by_station.transpose();
  if (problem.up) {
    const Eigen::Vector3d up = turned * problem.up->up_in_rear_shield;
    system.rows.block<2, 3>(row, 0) = -Skew(up).topRows<2>();
    system.misclosure.segment<2>(row) = -up.head<2>();
    const double sigma = std::max(problem.up->sigma_rad, kLeastSigma);
    system.covariance(row, row) = system.covariance(row + 1, row + 1) = sigma * sigma;
    row += 2;
  }
  if (problem.heading) {
    const Eigen::Vector3d ahead = turned.col(0);
    const double plan2 = ahead.head<2>().squaredNorm();
    system.rows.block<1, 3>(row, 0) =
        Eigen::RowVector3d(ahead.y(), -ahead.x(), 0.0) / plan2 * -Skew(ahead);
    system.misclosure[row] = std::remainder(
        problem.heading->heading_rad - HeadingOf(state.site_from_shield), 2.0 * std::numbers::pi);
    const double sigma = std::max(problem.heading->sigma_rad, kLeastSigma);
    system.covariance(row, row) = sigma * sigma;
    ++row;
  }
  const double speed_sigma = std::max(problem.speed_sigma_m_per_s, kLeastSigma);
  system.rows(row, 6) = 1.0;
  system.misclosure[row] = problem.speed_m_per_s - state.speed_m_per_s;
  system.covariance(row, row) = speed_sigma * speed_sigma;
}

struct Normal {
  Matrix7 information;
  Vector7 gradient;
  double chi2;
};

std::optional<Normal> NormalOfSystem(System& system) {
  if (!FactoriseCholesky(system.covariance)) return {};
  SolveLower(system.covariance, system.rows);
  SolveLower(system.covariance, system.misclosure);
  return Normal{system.rows.transpose() * system.rows,
                system.rows.transpose() * system.misclosure,
                system.misclosure.squaredNorm()};
}

// Scaled to ones on the diagonal first, so that metres and radians compare: then the square of a
// pivot is the share of what is known about an unknown that the others do not explain. False where
// it is nothing but rounding.
bool InvertInformation(const Matrix7& information, Matrix7& covariance) {
  constexpr double kLeastShare = 1e-12;
  if (!(information.diagonal().minCoeff() > 0.0)) return false;
  const Vector7 scale = information.diagonal().cwiseSqrt().cwiseInverse();
  Matrix7 factor = scale.asDiagonal() * information * scale.asDiagonal();
  if (!FactoriseCholesky(factor)) return false;
  if (!(factor.diagonal().cwiseAbs2().minCoeff() > kLeastShare)) return false;
  Matrix7 inverse;
  InvertLower(factor, inverse);
  covariance = scale.asDiagonal() * (inverse.transpose() * inverse) * scale.asDiagonal();
  return true;
}

Result<RearShieldFix, RearShieldFailure> FixWith(const RearShieldProblem& problem,
                                                 const RearShieldOptions& options,
                                                 const Naming& naming) {
  int fixes = 0;
  unsigned prisms = 0;
  for (const PrismFix& fix : problem.fixes) {
    if (!naming.Uses(fix)) continue;
    ++fixes;
    prisms |= 1u << fix.prism;
  }
  // The speed brings its own observation along.
  const int dof = 3 * fixes + (problem.up ? 2 : 0) + (problem.heading ? 1 : 0) - 6;
  if (fixes == 0 || dof < 0) return Failure{RearShieldFailure::kTooFewFixes};
  const std::optional<State> start = Start(problem, naming);
  if (!start) return Failure{RearShieldFailure::kNoStart};
  State state = *start;
  System system;
  std::optional<Normal> normal;
  Matrix7 covariance;
  double rms_m = 0.0;
  for (int step = 0;; ++step) {
    Assemble(problem, naming, state, system);
    rms_m = std::sqrt(system.misclosure.head(system.fix_rows).squaredNorm() / system.fix_rows);
    normal = NormalOfSystem(system);
    if (!normal) return Failure{RearShieldFailure::kNotFinite};
    if (!InvertInformation(normal->information, covariance)) {
      return Failure{RearShieldFailure::kNotObservable};
    }
    const Vector7 change = covariance * normal->gradient;
    if (!change.allFinite()) return Failure{RearShieldFailure::kNotFinite};
    if (change.head<6>().lpNorm<Eigen::Infinity>() < kSettled) break;
    if (step == kMostSteps) return Failure{RearShieldFailure::kNotConverged};
    state.site_from_shield = Moved(state.site_from_shield, change.head<6>());
    state.speed_m_per_s += change[6];
  }
  const auto largest = [](const Eigen::Matrix3d& block) {
    return std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(block, Eigen::EigenvaluesOnly)
                         .eigenvalues()[2]);
  };
  if (!(largest(covariance.block<3, 3>(0, 0)) <= options.worst_sigma_rad) ||
      !(largest(covariance.block<3, 3>(3, 3)) <= options.worst_sigma_m)) {
    return Failure{RearShieldFailure::kNotObservable};
  }
  RearShieldFix fix;
  fix.at = problem.at;
  fix.site_from_rear_shield = state.site_from_shield;
  fix.covariance = covariance.topLeftCorner<6, 6>();
  fix.speed_m_per_s = state.speed_m_per_s;
  fix.speed_sigma_m_per_s = std::sqrt(covariance(6, 6));
  fix.chi2 = normal->chi2;
  fix.dof = dof;
  fix.prisms_used = std::popcount(prisms);
  fix.rms_m = rms_m;
  if (problem.up) {
    // The rows are whitened, and their residual is minus the reading's error.
    const double sigma = std::max(problem.up->sigma_rad, kLeastSigma);
    fix.by_up =
        -covariance.topRows<6>() * system.rows.middleRows<2>(system.fix_rows).transpose() / sigma;
  }
  fix.left_out = naming.left_out;
  fix.exchanged = naming.exchanged;
  return fix;
}

bool Agrees(const RearShieldFix& fix, double gate_risk) {
  return fix.dof == 0 || ChiSquaredTail(fix.chi2, fix.dof) >= gate_risk;
}

bool IsFinite(const RearShieldProblem& problem) {
  for (const PrismFix& fix : problem.fixes) {
    if (!fix.p_in_site.allFinite() || !fix.covariance.allFinite()) return false;
  }
  if (problem.up && !problem.up->up_in_rear_shield.allFinite()) return false;
  return !problem.heading || std::isfinite(problem.heading->heading_rad);
}

}  // namespace

double HeadingOf(const Rigid3& site_from_shield) {
  const Eigen::Vector3d ahead = site_from_shield.rotation * Eigen::Vector3d::UnitX();
  return std::atan2(ahead.x(), ahead.y());
}

Result<RearShieldFix, RearShieldFailure> FixRearShield(const RearShieldProblem& problem,
                                                       const RearShieldOptions& options) {
  const int prisms = static_cast<int>(problem.prisms.size());
  for (const PrismFix& fix : problem.fixes) TBM_CHECK(fix.prism >= 0 && fix.prism < prisms);
  if (!IsFinite(problem)) return Failure{RearShieldFailure::kNotFinite};
  Result<RearShieldFix, RearShieldFailure> all = FixWith(problem, options, {});
  if (!all && all.error() != RearShieldFailure::kNotConverged) return all;
  if (all && Agrees(*all, options.gate_risk)) return all;

  std::optional<RearShieldFix> mended;
  bool only_one = true;
  const auto consider = [&](const Naming& naming) {
    const auto fix = FixWith(problem, options, naming);
    // What nothing checks agrees with anything.
    if (!fix || fix->dof == 0 || !Agrees(*fix, options.gate_risk)) return;
    only_one = !mended;
    mended = *fix;
  };
  for (int a = 0; a < prisms && only_one; ++a) {
    for (int b = a + 1; b < prisms && only_one; ++b) consider({{}, std::array{a, b}});
  }
  // An exchange explains all fixes; leaving one out explains all but one, so it comes second.
  if (mended && only_one) return *mended;
  mended.reset();
  only_one = true;
  for (int prism = 0; prism < prisms && only_one; ++prism) consider({prism, {}});
  if (!mended || !only_one) return Failure{RearShieldFailure::kInconsistent};
  return *mended;
}

}  // namespace tbm
