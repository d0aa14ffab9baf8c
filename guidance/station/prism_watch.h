#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "pose/base/time.h"
#include "pose/geometry/rigid3.h"

namespace tbm {

// A prism on the rear shield, as the total station looks for it.
struct StationPrism {
  std::string name;
  Eigen::Vector3d p_in_rear_shield = Eigen::Vector3d::Zero();  // [m] x forward, y left, z up
  double sigma_m = 0.0;                                        // of each coordinate
};

// Where somebody believes the rear shield to be.
struct ShieldBelief {
  Timestamp valid_at;
  Rigid3 site_from_rear_shield;
  PoseCovariance covariance = PoseCovariance::Zero();
  double speed_m_per_s = 0.0;  // along its own x axis
  double speed_sigma_m_per_s = 0.0;
};

// A prism measured under a name; whether it is the one of that name is the question.
struct SightedPrism {
  int prism = 0;  // index into the prisms
  Timestamp at;
  Eigen::Vector3d p_in_site = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // [m^2] of the reading alone
};

enum class PrismVerdict {
  kConfirmed,  // where the shield says it is, or at the right distances from two others or more
  kUnchecked,  // nothing contradicts it, and too little speaks for it
  kWrong,      // another prism, a reflection, a vest
  kSwapped,    // it and another one stand in each other's place
};

struct PrismJudgement {
  PrismVerdict verdict = PrismVerdict::kUnchecked;
  std::optional<int> rather;  // the prism that it is instead, where that is known
  // From where the shield says it is; without a belief the largest misfit of a distance. [m]
  double off_m = 0.0;
};

struct PrismWatchOptions {
  Duration belief_max_age = std::chrono::minutes(5);
  // A belief that is vaguer than this cannot tell prisms apart and is not asked. [m]
  double vague_m = 0.15;
  double floor_m = 0.003;                          // of where the shield says a prism is
  double gate_sigmas = 5.0;                        // in space
  double distance_gate_sigmas = 4.0;               // of one distance
  double unknown_speed_sigma_m_per_s = 2e-3;       // of the machine, with no belief
  Duration remembered = std::chrono::seconds(90);  // beyond it a prism is not compared with
  double attitude_within_rad = 0.5;                // from the attitude that is known
};

// Tells by geometry whether a prism that was measured is the one that was meant: by where the rear
// shield says it is, and by its distances from the others, which the workshop has measured and
// which neither the shield's motion nor the station's errors change.
//
// A belief alone is not obeyed: when three prisms or more stand at their distances from each other,
// and the right way up, elsewhere than believed, the shield has moved.
class PrismWatch {
 public:
  PrismWatch(std::vector<StationPrism> prisms, const PrismWatchOptions& options);

  // The shield's attitude as roughly known from the config: the last word only where no belief is.
  void SetAttitude(const Eigen::Quaterniond& site_from_rear_shield) {
    attitude_ = site_from_rear_shield;
  }
  // The last belief; older than the one before is fine.
  void Believe(const ShieldBelief& belief);

  // What it is, remembering it.
  PrismJudgement Judge(const SightedPrism& seen);

  // After a change of the station what was seen before cannot be compared with.
  void Forget();

  struct Expected {
    Eigen::Vector3d p_in_site;
    Eigen::Matrix3d covariance;  // [m^2]
    bool is_believed = false;    // false: its last place
  };
  // Where to look for a prism at a moment; empty when nobody knows.
  std::optional<Expected> Where(int prism, Timestamp at) const;

  const std::vector<StationPrism>& prisms() const { return prisms_; }
  // The last one that was confirmed or unchecked.
  const std::optional<SightedPrism>& last(int prism) const {
    return last_[static_cast<std::size_t>(prism)];
  }

 private:
  std::optional<Expected> Believed(int prism, Timestamp at) const;
  bool IsAt(const SightedPrism& seen, const Expected& expected) const;
  double DistanceMisfit(const SightedPrism& a, int a_is, const SightedPrism& b, int b_is) const;
  std::vector<SightedPrism> Recent(Timestamp at) const;
  // How many of `all`, the first included, agree with the first and with each other when they are
  // called `names`; with three or more the attitude must be right as well.
  std::size_t Agreeing(const std::vector<SightedPrism>& all, const std::vector<int>& names) const;
  bool IsUpright(const std::vector<SightedPrism>& all, const std::vector<int>& names) const;
  PrismJudgement JudgeByDistances(const std::vector<SightedPrism>& all) const;

  const std::vector<StationPrism> prisms_;
  const PrismWatchOptions options_;
  std::optional<ShieldBelief> belief_;
  std::optional<Eigen::Quaterniond> attitude_;
  std::vector<std::optional<SightedPrism>> candidates_;  // the last of each name, right or wrong
  std::vector<std::optional<SightedPrism>> last_;
};

}  // namespace tbm
