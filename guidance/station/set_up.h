#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "guidance/station/polar.h"
#include "pose/base/result.h"

namespace tbm {

// A surveyed point with a prism on it.
struct Reference {
  Eigen::Vector3d p_in_site = Eigen::Vector3d::Zero();
  double sigma_m = 0.0;  // of each coordinate, centring of the prism included
};

// One reading on a reference.
struct ReferenceSighting {
  int reference = 0;  // index into the references
  PolarReading reading;
  PolarSigma sigma;
};

// What is known of the station beforehand: all of it after a forced centring on a known point, and
// nothing for a free station.
struct StationPrior {
  Station station;
  // Per coordinate, east, north, up [m], circle zero [rad]; empty: not known. Known coordinates
  // and one backsight are the classical set-up.
  std::array<std::optional<double>, 4> sigma;
};

enum class SetUpFailure {
  kNoSuchReference,  // a sighting's index
  kNotFinite,        // a reading, a sigma or a reference that is no number, or a sigma of zero
  kTooFewSightings,  // fewer values than unknowns
  kNoStart,          // a free station needs distances to two references a metre apart in plan
  kWeakGeometry,     // a coordinate or the orientation is left without a usable sigma
  kNotConverged,
  kInconsistent,  // residuals too large, and leaving out no one reference mends it
};

// The residual of one sighting: observed minus computed, in the units of the reading. Where there
// is no distance, its residual is empty. `share` is what the other observations know of this one,
// 0: nothing, so that an error in it cannot be seen.
struct SightingResidual {
  int reference = 0;
  double circle_rad = 0.0;
  double zenith_rad = 0.0;
  std::optional<double> slope_m;
  double across_m = 0.0;  // the same at the reference: to the right
  double up_m = 0.0;
  double checked_share = 0.0;  // mean redundancy of the values, 0..1
  double standardised = 0.0;   // largest of the values: residual over its own sigma
};

struct SetUp {
  Station station;
  StationCovariance covariance = StationCovariance::Zero();
  std::vector<SightingResidual> residuals;  // in the order of the sightings, left out ones too
  double chi2 = 0.0;
  int dof = 0;
  // The reference that disagreed with all the others and was left out.
  std::optional<int> left_out;
};

struct SetUpOptions {
  SightModel sight;
  double refraction_k_sigma = 0.2;  // enters the weights of the zenith angles
  double worst_sigma_m = 0.01;      // of a coordinate, beyond which the geometry is weak
  double worst_sigma_rad = 2e-4;    // of the circle zero
  double gate_risk = 1e-3;          // that good sightings are called inconsistent
};

// Where the station stands and how its circle is turned, from sightings on references: weighted
// least squares over circle, zenith and slope, the references' own errors included, with the prior
// as further observations. From any start; deterministic; allocates.
//
// Several sightings on one reference share that reference's error: it does not average out.
//
// With a chi-squared test that fails, each reference is left out in turn; when leaving out exactly
// one makes the rest agree, it is named in `left_out` and not used.
Result<SetUp, SetUpFailure> SolveSetUp(std::span<const Reference> references,
                                       std::span<const ReferenceSighting> sightings,
                                       const StationPrior& prior,
                                       const SetUpOptions& options);

}  // namespace tbm
