#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>

#include "pose/base/fixed_vector.h"
#include "pose/base/result.h"
#include "pose/base/time.h"
#include "pose/geometry/rigid3.h"

namespace tbm {

inline constexpr std::size_t kMaxPrisms = 8;
inline constexpr std::size_t kMaxPrismFixes = 12;  // a cycle may measure a prism twice

// A prism on the rear shield, as surveyed in the workshop.
struct ShieldPrism {
  Eigen::Vector3d p_in_rear_shield = Eigen::Vector3d::Zero();  // [m] x forward, y left, z up
  double sigma_m = 0.0;  // of each coordinate; does not average out from cycle to cycle
};

// Where the total station saw one of them, at its own moment.
struct PrismFix {
  int prism = 0;  // index into the prisms
  Timestamp sensed_at;
  Eigen::Vector3d p_in_site = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // [m^2] of this reading alone
  // What the station's errors (east, north, up [m], circle zero [rad]) do to it.
  Eigen::Matrix<double, 3, 4> by_station = Eigen::Matrix<double, 3, 4>::Zero();
  // How far the shield was then along its own x axis from where it is at the problem's moment, as
  // something else has measured it: the telescopic joint. Beside what `speed` explains.
  double moved_m = 0.0;
  double moved_sigma_m = 0.0;
};

// The direction against gravity as the shield's inclinometer sees it, mounting taken out.
struct UpFix {
  Eigen::Vector3d up_in_rear_shield = Eigen::Vector3d::UnitZ();
  double sigma_rad = 0.0;  // about each horizontal axis: noise and mounting
};

// A heading from elsewhere: a gyro, or the last full fix and the articulation since.
struct HeadingFix {
  double heading_rad = 0.0;  // of the shield's x axis, clockwise from north
  double sigma_rad = 0.0;
};

// All that is known about the rear shield around one moment.
struct RearShieldProblem {
  FixedVector<ShieldPrism, kMaxPrisms> prisms;
  FixedVector<PrismFix, kMaxPrismFixes> fixes;
  Eigen::Matrix4d station_covariance = Eigen::Matrix4d::Zero();
  std::optional<UpFix> up;
  std::optional<HeadingFix> heading;
  // The machine goes on while one prism is measured after the other. Its speed along its own x axis
  // is an unknown with this prior: (0, 2 mm/s) when nothing is known, (0, tiny) at a standstill.
  double speed_m_per_s = 0.0;
  double speed_sigma_m_per_s = 2e-3;
  Timestamp at;                 // the moment the pose is wanted for; fixes lie around it
  std::optional<Rigid3> start;  // site_from_rear_shield of a moment ago
};

enum class RearShieldFailure {
  kTooFewFixes,    // fewer observations than unknowns
  kNotFinite,      // a reading or a covariance is no number
  kNoStart,        // nothing says how the shield is turned
  kNotObservable,  // a direction is left without a usable sigma; prisms on one line, or one alone
  kNotConverged,
  kInconsistent,  // they contradict each other and no single fault explains it
};

// How much one may trust a fix.
struct RearShieldFix {
  Timestamp at;
  Rigid3 site_from_rear_shield;
  PoseCovariance covariance = PoseCovariance::Zero();  // order and perturbation: rigid3.h
  double speed_m_per_s = 0.0;
  double speed_sigma_m_per_s = 0.0;
  double chi2 = 0.0;
  int dof = 0;  // 0: nothing checks anything
  int prisms_used = 0;
  double rms_m = 0.0;  // of the prisms' residuals, per coordinate
  // What an error of the up reading does to this pose: (turn, shift) by the reading's error turned
  // into `site`, its east and north part. Zero without an up reading.
  Eigen::Matrix<double, 6, 2> by_up = Eigen::Matrix<double, 6, 2>::Zero();
  std::optional<int> left_out;                  // a prism that disagreed with all the rest
  std::optional<std::array<int, 2>> exchanged;  // two prisms taken for each other, put right here
};

struct RearShieldOptions {
  double gate_risk = 1e-3;          // that good fixes are called inconsistent
  double worst_sigma_m = 0.05;      // of the shield's datum, beyond which it is not observable
  double worst_sigma_rad = 3.5e-3;  // of a turn: 0.2 degree
};

// Where the rear shield is and how it is turned, by maximum likelihood from any of: three or more
// prisms; two and the tilt; one, the tilt and a heading; more of each.
//
//   q_i = R (p_i + e_x (v (t_i - t) + moved_i)) + t_site + reading + station error
//
// Seven unknowns (turn, shift, speed v), Gauss-Newton. The covariance of all coordinates is built
// whole: the station's four errors are common to all fixes, a prism's calibration error to all
// fixes of that prism. Where prisms contradict each other and something is left to check, each is
// left out in turn and each two are exchanged; the one change that makes the rest agree is named.
//
// No heap; deterministic.
Result<RearShieldFix, RearShieldFailure> FixRearShield(const RearShieldProblem& problem,
                                                       const RearShieldOptions& options);

// Heading of a shield's x axis, clockwise from north, in [-pi, pi).
double HeadingOf(const Rigid3& site_from_shield);

}  // namespace tbm
