#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "devices/total_station/total_station.h"

namespace tbm {

// A prism as a function of time; empty while something stands in the line of sight.
struct EmulatedPrism {
  std::string name;
  std::function<std::optional<Eigen::Vector3d>(Timestamp)> p_in_site;
  double constant_m = 0.0;  // what has to be added to a raw distance to it
};

// A knock against the bracket.
struct EmulatedKnock {
  Timestamp at;
  Eigen::Vector3d shift_m = Eigen::Vector3d::Zero();
  double turn_rad = 0.0;  // of the circle's zero, clockwise
};

// Where the instrument stands and how: everything that moves when its bracket does.
struct EmulatedPillar {
  Eigen::Vector3d p_in_site = Eigen::Vector3d::Zero();  // where its axes cross
  double circle_zero_bearing_rad = 0.0;                 // clockwise from north
  double lean_east_rad = 0.0;                           // of the standing axis
  double lean_north_rad = 0.0;
  // Drift from `since` on.
  Timestamp since;
  Eigen::Vector3d drift_m_per_s = Eigen::Vector3d::Zero();
  double drift_rad_per_s = 0.0;  // of the circle's zero, clockwise
  std::vector<EmulatedKnock> knocks;
};

// What stays wrong in the instrument after its own corrections, and the air between.
struct EmulatedErrors {
  std::uint64_t seed = 1;
  double angle_sigma_rad = 0.0;  // white, of each pointing and axis
  double slope_sigma_m = 0.0;
  double slope_sigma_ppm = 0.0;
  // Face one reads: circle = true + c / sin z + a cot z, zenith = true + i. Face two has c and a
  // with the other sign and i with the same.
  double collimation_rad = 0.0;
  double trunnion_rad = 0.0;
  double index_rad = 0.0;
  double compensator_range_rad = 0.0011;  // about 4 arc minutes; beyond it the lean stays in
  double air_ppm = 0.0;                   // a raw distance is too short by so much
  double refraction_k = 0.13;
  double earth_radius_m = 6.371e6;
  double lateral_bend_rad_per_m = 0.0;  // of the line of sight along a warm wall, to the right
};

// The optics and mechanics of a motorised total station: what it reads when, in a world of prisms.
// No protocol and no time of its own.
class EmulatedInstrument {
 public:
  // How far beside the line of sight the distance meter's beam still meets a prism: its divergence
  // with the prism's radius.
  static constexpr double kBeamRad = 1e-3;
  static constexpr double kPrismRadiusM = 0.03;
  // Field of view of target recognition, half.
  static constexpr double kRecognitionRad = 0.0125;

  EmulatedPillar pillar;
  EmulatedErrors errors;
  std::vector<EmulatedPrism> prisms;

  double prism_constant_m = 0.0;  // set by the client
  double ppm = 0.0;
  bool compensator_is_on = true;
  // The next recognition goes to the second nearest prism in sight instead of the nearest, however
  // far away: what a reflecting vest or a strange prism does.
  bool takes_wrong_prism = false;

  // Where the telescope points, as ideal circles would read it.
  const CircleReading& telescope() const { return telescope_; }
  void PointTo(const CircleReading& reading) { telescope_ = reading; }
  // The telescope in the other face, at the same direction.
  void PlungeTelescope();

  // What ideal circles of this pillar read on a point, in a face.
  CircleReading IdealReading(const Eigen::Vector3d& p_in_site, Timestamp at, Face face) const;

  // Points at the prism next to the telescope within +-half of the window. 0, or a return code.
  int FindPrism(double horizontal_window_rad, double zenith_window_rad, Timestamp at);

  // Follows the prism that FindPrism found last, while it is in sight.
  void Lock() { is_locked_ = found_.has_value(); }
  void Unlock() { is_locked_ = false; }
  LockState LockAt(Timestamp at) const;

  // Circles with all their errors, where the telescope points (or the locked prism stands).
  CircleReading ReadCircles(Timestamp at);
  // Lean of the standing axis along and across the line of sight, as the compensator tells it.
  std::pair<double, double> ReadLean(Timestamp at) const;
  bool IsWithinCompensatorRange() const;
  // Displayed slope distance; empty when the beam meets no prism.
  std::optional<double> ReadSlope(Timestamp at);

 private:
  struct Seen {
    std::size_t prism;
    CircleReading reading;  // ideal
    double away_rad;        // from the telescope
  };
  std::vector<Seen> InSight(Timestamp at) const;
  Eigen::Vector3d PillarAt(Timestamp at) const;
  double CircleZeroAt(Timestamp at) const;
  void Follow(Timestamp at);
  double Noise();

  CircleReading telescope_{0.0, 1.5707963267948966};
  std::optional<std::size_t> found_;
  bool is_locked_ = false;
  std::uint64_t draws_ = 0;
};

}  // namespace tbm
