#include "guidance/core/joint_closing.h"

#include <algorithm>
#include <cmath>

namespace tbm {
namespace {

constexpr double kDeadBand_m = 0.005;      // vibration and noise stay below
constexpr double kFastest_m_per_s = 0.15;  // ten times a usual regrip
constexpr double kLargestJump_m = 0.02;    // beside that, from one pose to the next
constexpr Duration kLongestGap = std::chrono::seconds(15);

}  // namespace

void JointClosing::Add(Timestamp at, double length_m) {
  if (at.ns < 0 || !std::isfinite(length_m)) return;
  if (last_ && at <= *last_) return;
  const double step_s = last_ ? SecondsBetween(*last_, at) : 0.0;
  const bool goes_on =
      last_ && at - *last_ <= kLongestGap &&
      std::abs(length_m - last_length_m_) <= kLargestJump_m + kFastest_m_per_s * step_s;
  if (!goes_on) {
    Forget();
    first_ = at;
    longest_m_ = length_m;
  }
  if (length_m < longest_m_ - kDeadBand_m) {
    closed_m_ += longest_m_ - length_m;
    longest_m_ = length_m;
  }
  longest_m_ = std::max(longest_m_, length_m);
  last_length_m_ = length_m;
  const std::int64_t number = at.ns / kBinNs;
  // Seconds without a pose take over what was known.
  if (last_) {
    for (std::int64_t between = last_->ns / kBinNs + 1; between < number; ++between) {
      Bin& bin = bins_[static_cast<std::size_t>(between) % kBins];
      bin = {between, bins_[static_cast<std::size_t>(between - 1) % kBins].closed_m};
    }
  }
  bins_[static_cast<std::size_t>(number) % kBins] = {number, closed_m_};
  last_ = at;
}

std::optional<double> JointClosing::Until(Timestamp at) const {
  if (!first_ || at < *first_ - std::chrono::seconds(1) || at > *last_ + kLongestGap) return {};
  if (at >= *last_) return closed_m_;
  const std::int64_t number = std::max(at.ns / kBinNs, first_->ns / kBinNs);
  const Bin& bin = bins_[static_cast<std::size_t>(number) % kBins];
  const Bin& before = bins_[static_cast<std::size_t>(number - 1) % kBins];
  if (bin.number != number) return {};
  if (before.number != number - 1) return bin.closed_m;
  const double share = static_cast<double>(at.ns - number * kBinNs) * 1e-9;
  return before.closed_m + std::clamp(share, 0.0, 1.0) * (bin.closed_m - before.closed_m);
}

std::optional<double> JointClosing::Between(Timestamp from, Timestamp to) const {
  const auto a = Until(from);
  const auto b = Until(to);
  if (!a || !b) return {};
  return *b - *a;
}

}  // namespace tbm
