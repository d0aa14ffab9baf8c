#include "guidance/fusion/fusion_smoother.h"

#include <cmath>

#include <Eigen/Cholesky>

#include "pose/base/check.h"

namespace tbm {

FusionSmoother::Half FusionSmoother::Pack(const FusionFilter& filter) const {
  const int n = layout_.size();
  Half half;
  half.state = filter.state();
  half.covariance.reserve(static_cast<std::size_t>(n * (n + 1) / 2));
  for (int row = 0; row < n; ++row) {
    for (int column = 0; column <= row; ++column) {
      half.covariance.push_back(filter.covariance()(row, column));
    }
  }
  return half;
}

FusionMatrix FusionSmoother::Unpack(const Half& half) const {
  const int n = layout_.size();
  FusionMatrix matrix(n, n);
  std::size_t at = 0;
  for (int row = 0; row < n; ++row) {
    for (int column = 0; column <= row; ++column) {
      matrix(row, column) = half.covariance[at];
      matrix(column, row) = half.covariance[at];
      ++at;
    }
  }
  return matrix;
}

void FusionSmoother::Before(const FusionFilter& filter) {
  TBM_CHECK(epochs_.empty() || !epochs_.back().after.covariance.empty());
  epochs_.push_back({filter.now(), filter.last_step(), Pack(filter), {}});
}

void FusionSmoother::After(const FusionFilter& filter) {
  TBM_CHECK(!epochs_.empty() && epochs_.back().after.covariance.empty());
  epochs_.back().after = Pack(filter);
}

FusionEpoch FusionSmoother::Filtered(std::size_t epoch) const {
  const Epoch& one = epochs_[epoch];
  return {one.at, one.after.state, Unpack(one.after)};
}

FusionEpoch FusionSmoother::Smoothed(std::size_t epoch, const FusionEpoch& later) const {
  const Epoch& next = epochs_[epoch + 1];
  FusionEpoch here = Filtered(epoch);
  const FusionMatrix predicted = Unpack(next.before);
  // Scaled to ones on the diagonal: metres, radians and numbers without unit stand side by side.
  const FusionVector scale = predicted.diagonal().cwiseSqrt().cwiseInverse();
  const FusionMatrix scaled = scale.asDiagonal() * predicted * scale.asDiagonal();
  FusionMatrix taken = here.covariance;
  next.from_last.Take(taken);  // Phi P
  const FusionMatrix weighted =
      scale.asDiagonal() * scaled.ldlt().solve(FusionMatrix(scale.asDiagonal() * taken));
  const FusionMatrix gain = weighted.transpose();  // P Phi^T P_predicted^-1
  const FusionVector e = gain * ErrorFrom(next.before.state, later.state, layout_);
  here.state = MovedBy(here.state, layout_, e);
  here.covariance += gain * (later.covariance - predicted) * gain.transpose();
  here.covariance = (0.5 * (here.covariance + here.covariance.transpose())).eval();
  return here;
}

}  // namespace tbm
