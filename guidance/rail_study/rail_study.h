#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "guidance/rail/rail_line.h"

namespace tbm {

// The ways to a line that are compared: after the patent, after the paper, ours before and after
// the smoother.
enum class StudiedLine { kInertial, kPaper, kFilter, kSmoothed };
inline constexpr std::array<StudiedLine, 4> kStudiedLines = {
    StudiedLine::kInertial, StudiedLine::kPaper, StudiedLine::kFilter, StudiedLine::kSmoothed};
std::string_view Word(StudiedLine line);  // "inertial", "paper", "filter", "smoothed"

// Truth at one instant.
struct KnownPoint {
  Timestamp at;
  Eigen::Vector3d position_world_m = Eigen::Vector3d::Zero();
};

// How one line compares with truth, as the rail-line paper's Table 2 has it.
struct LineDeviation {
  Eigen::Vector3d largest_m = Eigen::Vector3d::Zero();    // absolute, of each coordinate
  Eigen::Vector3d deviation_m = Eigen::Vector3d::Zero();  // standard deviation about the mean
  double error_over_sigma = 0.0;                          // RMS over points and coordinates
  std::size_t points = 0;                                 // compared; 0: nothing is known of them
};

// Points of the line at instants that truth names; both in the order of time.
LineDeviation CompareLine(const RailLine& line, const std::vector<KnownPoint>& truth);

// One recording solved in one of the ways.
Result<RailLine, RailStartFailure> SolveStudiedLine(const RailSetup& setup,
                                                    const RailRecording& recording,
                                                    StudiedLine way);

// Medians over many runs, coordinate by coordinate; `error_over_sigma` is the RMS over them.
LineDeviation MedianOf(const std::vector<LineDeviation>& runs);

}  // namespace tbm
