#pragma once

#include <optional>
#include <span>

namespace tbm {

struct TroughSample {
  double distance_m = 0.0;
  double dz_m = 0.0;
  double sigma_m = 0.0;  // > 0
};

// dz = -depth exp(-(distance - centre)^2 / (2 width^2)), the usual shape over a tunnel.
struct TroughFit {
  double depth_m = 0.0;
  double centre_m = 0.0;
  double width_m = 0.0;  // from the centre to the point of inflection
  // The largest that each can be, however the errors along the line hang together.
  double sigma_depth_m = 0.0;
  double sigma_centre_m = 0.0;
  double sigma_width_m = 0.0;
};

// By weighted least squares over what lies within three widths of the sample at `peak_m`, which is
// the deepest. Samples in the order of distance. Empty where no such shape is found: fewer than
// five samples, none of them on one side, or no end of the steps.
std::optional<TroughFit> FitTrough(std::span<const TroughSample> samples, double peak_m);

}  // namespace tbm
