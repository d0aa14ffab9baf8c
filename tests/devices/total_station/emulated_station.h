#pragma once

#include <cmath>
#include <numbers>

#include "devices/total_station/geocom_emulator.h"
#include "devices/total_station/geocom_fault.h"

namespace tbm::test {

inline EmulatedPrism StandingPrism(const char* name, double east_m, double north_m, double up_m) {
  const Eigen::Vector3d p_in_site(east_m, north_m, up_m);
  return {name, [p_in_site](Timestamp) { return std::optional(p_in_site); }, 0.0};
}

// Where the tests' instrument stands, and what it looks at: three prisms on a machine some 60 m
// ahead, and one behind it.
inline const Eigen::Vector3d kPillar(1000.0, 2000.0, 50.0);

// Faultless optics in a straight line of sight, so that truth can be written down.
inline EmulatedInstrument FaultlessInstrument() {
  EmulatedInstrument instrument;
  instrument.pillar.p_in_site = kPillar;
  instrument.pillar.circle_zero_bearing_rad = 0.25;
  instrument.errors.refraction_k = 0.0;
  instrument.errors.earth_radius_m = 1e15;
  instrument.prisms = {StandingPrism("left", 997.0, 2060.0, 52.0),
                       StandingPrism("right", 1003.0, 2061.0, 52.5),
                       StandingPrism("low", 1001.0, 2058.0, 49.0),
                       StandingPrism("back", 1001.0, 1960.0, 51.0)};
  return instrument;
}

// Circles and slope distance of a point in the first face, written out a second time: plan bearing
// less the circle's zero, angle from the plumb line.
struct TrueSight {
  CircleReading circles;
  double slope_m;
};
inline TrueSight SightOf(const Eigen::Vector3d& p_in_site, double circle_zero_bearing_rad = 0.25) {
  const Eigen::Vector3d way = p_in_site - kPillar;
  double circle_rad = std::numbers::pi / 2 - std::atan2(way.y(), way.x()) - circle_zero_bearing_rad;
  while (circle_rad < 0) circle_rad += 2 * std::numbers::pi;
  return {{circle_rad, std::acos(way.z() / way.norm())}, way.norm()};
}

// All that can happen to a line on its way, or to the connection.
inline constexpr GeocomFaultKind kLineFaults[] = {GeocomFaultKind::kLate,
                                                  GeocomFaultKind::kLostReply,
                                                  GeocomFaultKind::kLostRequest,
                                                  GeocomFaultKind::kMissingValues,
                                                  GeocomFaultKind::kGarbageBefore,
                                                  GeocomFaultKind::kBitError,
                                                  GeocomFaultKind::kLostFirst,
                                                  GeocomFaultKind::kSplit,
                                                  GeocomFaultKind::kGlued,
                                                  GeocomFaultKind::kTwice,
                                                  GeocomFaultKind::kCloses};

}  // namespace tbm::test
