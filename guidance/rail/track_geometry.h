#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "guidance/rail/rail_line.h"

namespace tbm {

// The line of one rail in the quantities of EN 13848-1 (docs/settlement.md, section 6, says what
// differs from the standard).
struct TrackGeometryOptions {
  double step_m = 0.25;         // 0.05 .. 0.5
  std::vector<double> bases_m;  // of the twist, each > 0
  double gauge_m = 1.435;       // what the cross level is taken over
};

struct WaveBand {
  double shortest_m;
  double longest_m;
};
inline constexpr WaveBand kBandD1 = {3.0, 25.0};
inline constexpr WaveBand kBandD2 = {25.0, 70.0};

// Empty is what nothing can be said of: too near to an end, or to a hole, for the filter or the
// base of the twist.
struct TrackPlace {
  double distance_m = 0.0;
  std::optional<double> level_d1_m;  // + up
  std::optional<double> level_d2_m;
  std::optional<double> alignment_d1_m;  // + to the left
  std::optional<double> alignment_d2_m;
  // + where the left side is higher. A constant tilt of the unit on the trolley stands in it.
  std::optional<double> cross_level_m;
  std::vector<std::optional<double>> twist;  // m/m over each base, which is centred here
};

// Gain of the whole way from line to level or alignment: band-pass, and mean over a step.
double TrackGain(const WaveBand& band, double step_m, double wavelength_m);

// The length of line, at either end, for which a band stays empty.
double TrackRoom(const WaveBand& band);

// Every multiple of the step of the line's distance. Nothing when the line is shorter than a step.
std::vector<TrackPlace> MeasureTrack(std::span<const RailPoint> points,
                                     const TrackGeometryOptions& options);

}  // namespace tbm
