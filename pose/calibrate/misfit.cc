#include "pose/calibrate/misfit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <Eigen/Eigenvalues>

namespace tbm {
namespace {

// Below this an error hardly shows, and rounding would judge it.
constexpr double kLeastControl = 0.02;
// As likely as the worst to one in ninety: exp(-9 / 2).
constexpr double kAsBad = 9.0;
// So many wrong measurements are a list that nobody reads.
constexpr std::size_t kMostTaken = 12;
constexpr double kMostScatter = 3.0;

double ByDirections(const std::array<double, 3>& limits, int dof) {
  return limits[static_cast<std::size_t>(std::clamp(dof, 1, 3) - 1)];
}

// A misfit over what chance and the scatter of the others explain; above 1 it is wrong.
double Excess(const AdjustedFit& fit, std::size_t i, double slack) {
  const Misfit& misfit = fit.misfits[i];
  if (misfit.dof == 0) return 0.0;
  const int rest_dof = fit.dof - misfit.dof;
  const double rest = rest_dof > 0 ? (fit.chi2 - misfit.chi2) / rest_dof : 1.0;
  return misfit.chi2 / (slack * MostMisfit(misfit.dof) * std::max(1.0, rest));
}

// Empty when nothing is controlled.
std::optional<std::size_t> Worst(const AdjustedFit& fit,
                                 const std::vector<bool>& is_out,
                                 double slack) {
  std::optional<std::size_t> worst;
  double most = 0.0;
  for (std::size_t i = 0; i < fit.misfits.size(); ++i) {
    const double excess = is_out[i] ? 0.0 : Excess(fit, i, slack);
    if (!(excess > most)) continue;
    most = excess;
    worst = i;
  }
  return worst;
}

// Candidates, in the order in which they were taken out.
std::vector<std::size_t> Suspects(std::size_t count, const AdjustWithout& adjust, double slack) {
  std::vector<bool> is_out(count, false);
  AdjustedFit fit = adjust(is_out);
  const int most_dof = fit.dof / 2;
  std::vector<std::size_t> taken;
  std::size_t wrong = 0;
  int taken_dof = 0;
  while (taken.size() < kMostTaken) {
    const auto worst = Worst(fit, is_out, slack);
    if (!worst) break;
    taken_dof += fit.misfits[*worst].dof;
    if (!taken.empty() && taken_dof > most_dof) break;
    taken.push_back(*worst);
    if (Excess(fit, *worst, slack) > 1.0) {
      wrong = taken.size();
    } else if (ScatterFactor(fit.chi2, fit.dof) == 1.0) {
      break;  // nothing left to hide
    }
    is_out[*worst] = true;
    fit = adjust(is_out);
  }
  taken.resize(wrong);
  return taken;
}

}  // namespace

Misfit MisfitOf(const Eigen::MatrixXd& control, const Eigen::VectorXd& off_sigmas) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(control);
  const Eigen::VectorXd along = axes.eigenvectors().transpose() * off_sigmas;
  Misfit misfit;
  double from_others2 = 0.0;
  for (Eigen::Index i = 0; i < along.size(); ++i) {
    const double share = axes.eigenvalues()[i];
    if (!(share >= kLeastControl)) continue;
    ++misfit.dof;
    misfit.chi2 += along[i] * along[i] / share;
    from_others2 += along[i] * along[i] / (share * share);
  }
  misfit.from_others_sigmas = std::sqrt(from_others2);
  return misfit;
}

double MostMisfit(int dof) { return ByDirections({18.8, 22.3, 25.0}, dof); }
double DoubtfulMisfit(int dof) { return ByDirections({10.8, 13.8, 16.3}, dof); }

double ScatterFactor(double chi2, int dof) {
  if (dof <= 0) return 1.0;
  const double ratio = chi2 / dof;
  return ratio > 1.0 + 3.0 * std::sqrt(2.0 / dof) ? std::sqrt(ratio) : 1.0;
}

bool IsBeyondScatter(double chi2, int dof) {
  // Of one or two degrees of freedom nine times as much is still chance.
  return dof > 0 && chi2 > kMostScatter * kMostScatter * dof && chi2 > MostMisfit(dof);
}

std::vector<WrongMeasurement> FindWrong(std::size_t count,
                                        const AdjustWithout& adjust,
                                        double slack) {
  const std::vector<std::size_t> suspects = Suspects(count, adjust, slack);
  std::vector<bool> is_out(count, false);
  for (const std::size_t suspect : suspects) is_out[suspect] = true;
  std::vector<WrongMeasurement> wrong;
  if (suspects.empty()) return wrong;
  const AdjustedFit rest = adjust(is_out);
  if (IsBeyondScatter(rest.chi2, rest.dof)) return wrong;
  for (const std::size_t suspect : suspects) {
    is_out[suspect] = false;
    const AdjustedFit fit = adjust(is_out);
    if (!(Excess(fit, suspect, slack) > 1.0)) continue;  // taken out for another's sake
    is_out[suspect] = true;
    WrongMeasurement one{suspect, fit.misfits[suspect], {}};
    for (std::size_t i = 0; i < count; ++i) {
      const bool is_as_bad = fit.misfits[i].chi2 > one.misfit.chi2 - kAsBad;
      if (!is_out[i] && is_as_bad && Excess(fit, i, slack) > 1.0) one.or_rather.push_back(i);
    }
    wrong.push_back(one);
  }
  return wrong;
}

}  // namespace tbm
