#include "guidance/station/prism_watch.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <Eigen/Cholesky>
#include <Eigen/SVD>

#include "pose/base/check.h"

namespace tbm {
namespace {

constexpr double kDistanceFloor_m = 1e-3;

std::vector<int> NamesOf(const std::vector<SightedPrism>& all) {
  std::vector<int> names;
  names.reserve(all.size());
  for (const SightedPrism& one : all) names.push_back(one.prism);
  return names;
}

}  // namespace

PrismWatch::PrismWatch(std::vector<StationPrism> prisms, const PrismWatchOptions& options)
    : prisms_(std::move(prisms)),
      options_(options),
      candidates_(prisms_.size()),
      last_(prisms_.size()) {}

void PrismWatch::Believe(const ShieldBelief& belief) {
  belief_ = belief;
  attitude_ = belief.site_from_rear_shield.rotation;
}

void PrismWatch::Forget() { std::fill(candidates_.begin(), candidates_.end(), std::nullopt); }

std::optional<PrismWatch::Expected> PrismWatch::Believed(int prism, Timestamp at) const {
  if (!belief_) return {};
  const double later_s = SecondsBetween(belief_->valid_at, at);
  if (std::abs(later_s) > 1e-9 * static_cast<double>(options_.belief_max_age.count())) return {};
  const StationPrism& known = prisms_[static_cast<std::size_t>(prism)];
  const Rigid3& pose = belief_->site_from_rear_shield;
  const Eigen::Vector3d ahead = pose.rotation * Eigen::Vector3d::UnitX();
  const Eigen::Matrix<double, 3, 6> by_pose = PointByError(pose, known.p_in_rear_shield);
  Expected expected;
  expected.p_in_site = pose * known.p_in_rear_shield + later_s * belief_->speed_m_per_s * ahead;
  const double along_m = later_s * belief_->speed_sigma_m_per_s;
  expected.covariance = by_pose * belief_->covariance * by_pose.transpose() +
                        along_m * along_m * ahead * ahead.transpose() +
                        (known.sigma_m * known.sigma_m + options_.floor_m * options_.floor_m) *
                            Eigen::Matrix3d::Identity();
  expected.is_believed = true;
  if (!expected.p_in_site.allFinite() || !expected.covariance.allFinite()) return {};
  if (!(expected.covariance.trace() < options_.vague_m * options_.vague_m)) return {};
  return expected;
}

std::optional<PrismWatch::Expected> PrismWatch::Where(int prism, Timestamp at) const {
  if (auto believed = Believed(prism, at)) return believed;
  const auto& seen = last_[static_cast<std::size_t>(prism)];
  if (!seen) return {};
  const double moved_m = SecondsBetween(seen->at, at) * options_.unknown_speed_sigma_m_per_s;
  return Expected{
      seen->p_in_site, seen->covariance + moved_m * moved_m * Eigen::Matrix3d::Identity(), false};
}

bool PrismWatch::IsAt(const SightedPrism& seen, const Expected& expected) const {
  const Eigen::Vector3d off = seen.p_in_site - expected.p_in_site;
  const Eigen::LLT<Eigen::Matrix3d> weight(expected.covariance + seen.covariance);
  if (weight.info() != Eigen::Success) return false;
  return off.dot(weight.solve(off)) <= options_.gate_sigmas * options_.gate_sigmas;
}

// In sigmas of one distance.
double PrismWatch::DistanceMisfit(const SightedPrism& a,
                                  int a_is,
                                  const SightedPrism& b,
                                  int b_is) const {
  const StationPrism& known_a = prisms_[static_cast<std::size_t>(a_is)];
  const StationPrism& known_b = prisms_[static_cast<std::size_t>(b_is)];
  const double known_m = (known_a.p_in_rear_shield - known_b.p_in_rear_shield).norm();
  // The shield goes on between the two, along an axis that is known at least roughly.
  const double later_s = SecondsBetween(b.at, a.at);
  Eigen::Vector3d moved = Eigen::Vector3d::Zero();
  double moved_sigma_m = std::abs(later_s) * options_.unknown_speed_sigma_m_per_s;
  Eigen::Vector3d ahead = Eigen::Vector3d::Zero();
  if (attitude_) ahead = *attitude_ * Eigen::Vector3d::UnitX();
  if (belief_) {
    moved = later_s * belief_->speed_m_per_s * ahead;
    moved_sigma_m = std::min(moved_sigma_m, std::abs(later_s) * belief_->speed_sigma_m_per_s);
  }
  const Eigen::Vector3d way = a.p_in_site - moved - b.p_in_site;
  const double seen_m = way.norm();
  if (!(seen_m > 0.0)) return known_m / kDistanceFloor_m;
  const Eigen::Vector3d along = way / seen_m;
  const double share = attitude_ ? along.dot(ahead) : 1.0;
  const double variance = along.dot((a.covariance + b.covariance) * along) +
                          known_a.sigma_m * known_a.sigma_m + known_b.sigma_m * known_b.sigma_m +
                          std::pow(share * moved_sigma_m, 2) + kDistanceFloor_m * kDistanceFloor_m;
  return std::abs(seen_m - known_m) / std::sqrt(variance);
}

std::vector<SightedPrism> PrismWatch::Recent(Timestamp at) const {
  std::vector<SightedPrism> recent;
  for (const auto& candidate : candidates_) {
    if (candidate && at - candidate->at <= options_.remembered) recent.push_back(*candidate);
  }
  return recent;
}

// The turn that fits best, by the cross-covariance's singular vectors.
bool PrismWatch::IsUpright(const std::vector<SightedPrism>& all,
                           const std::vector<int>& names) const {
  if (!attitude_ || all.size() < 3) return true;
  Eigen::Vector3d mean_site = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_shield = Eigen::Vector3d::Zero();
  const auto known = [&](std::size_t i) -> const Eigen::Vector3d& {
    return prisms_[static_cast<std::size_t>(names[i])].p_in_rear_shield;
  };
  const double count = static_cast<double>(all.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    mean_site += all[i].p_in_site / count;
    mean_shield += known(i) / count;
  }
  Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < all.size(); ++i) {
    cross += (all[i].p_in_site - mean_site) * (known(i) - mean_shield).transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(cross, Eigen::ComputeFullU | Eigen::ComputeFullV);
  if (!(svd.singularValues()[1] > 1e-4)) return true;  // on one line: no attitude
  Eigen::Matrix3d handed = Eigen::Matrix3d::Identity();
  handed(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  const Eigen::Quaterniond fitted(
      Eigen::Matrix3d(svd.matrixU() * handed * svd.matrixV().transpose()));
  return fitted.angularDistance(*attitude_) <= options_.attitude_within_rad;
}

std::size_t PrismWatch::Agreeing(const std::vector<SightedPrism>& all,
                                 const std::vector<int>& names) const {
  const auto agree = [&](std::size_t i, std::size_t j) {
    return DistanceMisfit(all[i], names[i], all[j], names[j]) <= options_.distance_gate_sigmas;
  };
  std::vector<std::size_t> group = {0};
  for (std::size_t i = 1; i < all.size(); ++i) {
    if (agree(0, i)) group.push_back(i);
  }
  // Who disagrees most with the others goes, until all agree. The first stays.
  while (group.size() > 2) {
    std::size_t worst = 0;
    int most = 0;
    for (std::size_t k = 1; k < group.size(); ++k) {
      int against = 0;
      for (std::size_t m = 1; m < group.size(); ++m) {
        if (m != k && !agree(group[k], group[m])) ++against;
      }
      if (against > most) {
        most = against;
        worst = k;
      }
    }
    if (most == 0) break;
    group.erase(group.begin() + static_cast<std::ptrdiff_t>(worst));
  }
  if (group.size() < 3) return group.size();
  std::vector<SightedPrism> members;
  std::vector<int> member_names;
  for (const std::size_t i : group) {
    members.push_back(all[i]);
    member_names.push_back(names[i]);
  }
  return IsUpright(members, member_names) ? group.size() : 1;
}

PrismJudgement PrismWatch::JudgeByDistances(const std::vector<SightedPrism>& all) const {
  PrismJudgement judgement;
  if (all.size() < 2) return judgement;
  const std::vector<int> names = NamesOf(all);
  const std::size_t as_named = Agreeing(all, names);
  for (std::size_t i = 1; i < all.size(); ++i) {
    const double known_m = (prisms_[static_cast<std::size_t>(names[0])].p_in_rear_shield -
                            prisms_[static_cast<std::size_t>(names[i])].p_in_rear_shield)
                               .norm();
    const double misfit_m = std::abs((all[0].p_in_site - all[i].p_in_site).norm() - known_m);
    judgement.off_m = std::max(judgement.off_m, misfit_m);
  }
  for (std::size_t i = 1; i < all.size(); ++i) {
    std::vector<int> swapped = names;
    std::swap(swapped[0], swapped[i]);
    const std::size_t count = Agreeing(all, swapped);
    if (count < 3 || count <= as_named) continue;
    judgement.verdict = PrismVerdict::kSwapped;
    judgement.rather = names[i];
    return judgement;
  }
  if (as_named >= 3) {
    judgement.verdict = PrismVerdict::kConfirmed;
    return judgement;
  }
  // One prism measured under two names stands where the other one is.
  for (std::size_t i = 1; i < all.size(); ++i) {
    if ((all[0].p_in_site - all[i].p_in_site).norm() > 0.05) continue;
    judgement.verdict = PrismVerdict::kWrong;
    judgement.rather = names[i];
    return judgement;
  }
  if (as_named < 2) judgement.verdict = PrismVerdict::kWrong;
  return judgement;
}

PrismJudgement PrismWatch::Judge(const SightedPrism& seen) {
  TBM_CHECK(seen.prism >= 0 && static_cast<std::size_t>(seen.prism) < prisms_.size());
  auto& candidate = candidates_[static_cast<std::size_t>(seen.prism)];
  candidate.reset();
  std::vector<SightedPrism> all = Recent(seen.at);
  all.insert(all.begin(), seen);
  candidate = seen;

  PrismJudgement judgement = JudgeByDistances(all);
  if (const auto expected = Believed(seen.prism, seen.at)) {
    const bool stands_elsewhere = judgement.verdict == PrismVerdict::kConfirmed;
    const bool is_swapped = judgement.verdict == PrismVerdict::kSwapped;
    judgement.off_m = (seen.p_in_site - expected->p_in_site).norm();
    if (IsAt(seen, *expected)) {
      if (!is_swapped) judgement = {PrismVerdict::kConfirmed, {}, judgement.off_m};
    } else if (!stands_elsewhere && !is_swapped) {
      judgement.verdict = PrismVerdict::kWrong;
      for (int other = 0; other < static_cast<int>(prisms_.size()); ++other) {
        const auto there = other == seen.prism ? std::nullopt : Believed(other, seen.at);
        if (!there || !IsAt(seen, *there)) continue;
        judgement.rather = other;
        const auto& its = candidates_[static_cast<std::size_t>(other)];
        if (its && seen.at - its->at <= options_.remembered && IsAt(*its, *expected)) {
          judgement.verdict = PrismVerdict::kSwapped;
        }
      }
    }
  }
  if (judgement.verdict == PrismVerdict::kConfirmed ||
      judgement.verdict == PrismVerdict::kUnchecked) {
    last_[static_cast<std::size_t>(seen.prism)] = seen;
  }
  return judgement;
}

}  // namespace tbm
