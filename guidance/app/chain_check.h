#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "pose/base/result.h"
#include "pose/base/time.h"

namespace tbm {

// Where guidance said that a point of the machine is, in `site`.
struct GuidedSample {
  Timestamp at;
  bool is_valid = false;  // the rest means something: VALID or DEGRADED
  Eigen::Vector3d p_in_site_m = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance_m2 = Eigen::Matrix3d::Zero();
};

// Of one point, in order of time, one for each moment.
using GuidedTrack = std::vector<GuidedSample>;

// By the point's name.
using GuidedTracks = std::map<std::string, GuidedTrack, std::less<>>;

// One independent shot of a total station at a point of the machine.
struct MachineShot {
  Timestamp at;  // by the log's clock
  std::string point;
  Eigen::Vector3d p_in_site_m = Eigen::Vector3d::Zero();
};

enum class NoGuidedPlace {
  kNoPartner,  // no samples close enough on both sides, or it would be extrapolated
  kInvalid,    // a neighbour says that nothing is known
};

// Linear between the neighbours, which must both be valid and no further apart than `most_gap`;
// the covariance is the larger one's. Never beyond the first or last sample.
struct GuidedPlace {
  Eigen::Vector3d p_in_site_m = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance_m2 = Eigen::Matrix3d::Zero();
};
Result<GuidedPlace, NoGuidedPlace> PlaceAt(const GuidedTrack& track,
                                           Timestamp at,
                                           Duration most_gap);

// How fast the point moves around a moment: the slope through what lies within 15 s, and zero below
// 6 mm/min or what the samples' own scatter makes of a machine that stands. Empty with less than 5
// s of samples.
std::optional<Eigen::Vector3d> VelocityAt(const GuidedTrack& track, Timestamp at);

struct ChainOptions {
  Duration most_gap = std::chrono::milliseconds(500);
  double log_sigma_m = 0.0;  // of each coordinate of a shot
  double clock_range_s = 7200.0;
};

// How far the log's clock is ahead of the one that guidance runs on.
//
//   published(t_log - ahead) - shot = bias + noise
//
// The bias is one vector with the published covariance as its prior: a machine at one steady speed
// tells the clock no better than guidance knows the chainage. What changes in speed tells more.
struct ClockEstimate {
  double ahead_s = 0.0;
  double sigma_s = 0.0;
  bool is_significant = false;  // more than three sigma
};
enum class NoClockEstimate {
  kTooFewShots,     // fewer than three have a partner
  kMovedTooLittle,  // nothing moves while it is shot at: sigma beyond a minute
  kOtherFault,      // more than a fifth contradict each other whatever the clock: it is not that
};
Result<ClockEstimate, NoClockEstimate> EstimateClock(const GuidedTracks& tracks,
                                                     const std::vector<MachineShot>& shots,
                                                     const ChainOptions& options);

struct ChainObservation {
  Timestamp at;  // by guidance's clock
  std::string point;
  Eigen::Vector3d published_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d surveyed_m = Eigen::Vector3d::Zero();
  double sigma_m = 0.0;  // root of the trace of the covariance of the difference
  double standardised_2 =
      0.0;  // squared distance in units of that covariance; 3 degrees of freedom
  Eigen::Vector3d difference_m() const { return published_m - surveyed_m; }
  bool IsInside95() const;
};

struct ChainPairs {
  std::vector<ChainObservation> observations;
  std::size_t without_pose = 0;     // shots while guidance said that it does not know
  std::size_t without_partner = 0;  // shots with nothing published around them
};

// Each shot at its time less `ahead_s`, whose sigma enters along the way of the machine.
ChainPairs PairShots(const GuidedTracks& tracks,
                     const std::vector<MachineShot>& shots,
                     double ahead_s,
                     double ahead_sigma_s,
                     const ChainOptions& options);

}  // namespace tbm
