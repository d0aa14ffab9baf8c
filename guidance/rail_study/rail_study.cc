#include "guidance/rail_study/rail_study.h"

#include <algorithm>
#include <cmath>

#include "guidance/rail/inertial_line.h"
#include "guidance/rail_study/paper_line.h"

namespace tbm {

std::string_view Word(StudiedLine line) {
  switch (line) {
    case StudiedLine::kInertial:
      return "inertial";
    case StudiedLine::kPaper:
      return "paper";
    case StudiedLine::kFilter:
      return "filter";
    case StudiedLine::kSmoothed:
      return "smoothed";
  }
  return "";
}

LineDeviation CompareLine(const RailLine& line, const std::vector<KnownPoint>& truth) {
  LineDeviation result;
  Eigen::Vector3d sum_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d sum_m2 = Eigen::Vector3d::Zero();
  double over_sigma = 0.0;
  auto known = truth.begin();
  for (const RailPoint& point : line.points) {
    while (known != truth.end() && known->at < point.at) ++known;
    if (known == truth.end()) break;
    if (known->at != point.at) continue;
    const Eigen::Vector3d off_m = point.position_world_m - known->position_world_m;
    result.largest_m = result.largest_m.cwiseMax(off_m.cwiseAbs());
    sum_m += off_m;
    sum_m2 += off_m.cwiseAbs2();
    over_sigma += off_m.cwiseQuotient(point.sigma_world_m).squaredNorm() / 3.0;
    ++result.points;
  }
  if (result.points == 0) return result;
  const auto count = static_cast<double>(result.points);
  result.deviation_m = (sum_m2 / count - (sum_m / count).cwiseAbs2()).cwiseMax(0.0).cwiseSqrt();
  result.error_over_sigma = std::sqrt(over_sigma / count);
  return result;
}

Result<RailLine, RailStartFailure> SolveStudiedLine(const RailSetup& setup,
                                                    const RailRecording& recording,
                                                    StudiedLine way) {
  switch (way) {
    case StudiedLine::kInertial:
      return SolveInertialLine(setup, recording);
    case StudiedLine::kPaper:
      return SolvePaperLine(setup, recording);
    case StudiedLine::kFilter:
      return SolveRailLine(setup, recording, RailMethod::kFilter);
    case StudiedLine::kSmoothed:
      break;
  }
  return SolveRailLine(setup, recording, RailMethod::kSmoothed);
}

LineDeviation MedianOf(const std::vector<LineDeviation>& runs) {
  LineDeviation result;
  if (runs.empty()) return result;
  const auto median = [&](auto value) {
    std::vector<double> values;
    for (const LineDeviation& run : runs) values.push_back(value(run));
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
  };
  for (int i = 0; i < 3; ++i) {
    result.largest_m[i] = median([&](const LineDeviation& run) { return run.largest_m[i]; });
    result.deviation_m[i] = median([&](const LineDeviation& run) { return run.deviation_m[i]; });
  }
  double squared = 0.0;
  for (const LineDeviation& run : runs) {
    squared += run.error_over_sigma * run.error_over_sigma;
    result.points += run.points;
  }
  result.error_over_sigma = std::sqrt(squared / static_cast<double>(runs.size()));
  return result;
}

}  // namespace tbm
