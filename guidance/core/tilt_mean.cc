#include "guidance/core/tilt_mean.h"

namespace tbm {

void TiltMean::Add(Timestamp sensed_at, const Inclination& inclination) {
  if (sensed_at.ns < 0) return;
  const std::int64_t number = sensed_at.ns / kBinNs;
  Bin& bin = bins_[static_cast<std::size_t>(number) % kBins];
  if (bin.number != number) bin = {number, 0.0, 0.0, 0};
  bin.beta_rad += inclination.beta_rad;
  bin.gamma_rad += inclination.gamma_rad;
  ++bin.count;
  if (!newest_ || sensed_at > *newest_) newest_ = sensed_at;
}

std::optional<TiltMean::Mean> TiltMean::Around(Timestamp at) const {
  Mean mean;
  const std::int64_t middle = at.ns / kBinNs;
  for (std::int64_t number = middle - 2; number <= middle + 2; ++number) {
    if (number < 0) continue;
    const Bin& bin = bins_[static_cast<std::size_t>(number) % kBins];
    if (bin.number != number) continue;
    mean.inclination.beta_rad += bin.beta_rad;
    mean.inclination.gamma_rad += bin.gamma_rad;
    mean.count += bin.count;
  }
  if (mean.count == 0) return {};
  mean.inclination.beta_rad /= mean.count;
  mean.inclination.gamma_rad /= mean.count;
  return mean;
}

}  // namespace tbm
