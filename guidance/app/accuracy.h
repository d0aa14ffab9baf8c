#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "devices/replay/csv.h"
#include "pose/base/result.h"
#include "pose/base/time.h"
#include "pose/geometry/rigid3.h"

namespace tbm {

// One point of one frame as `tbm solve` wrote it, or as a total station measured it. Lengths in mm:
// both files and the report speak mm, and nothing is computed but differences.
struct PlacedPoint {
  std::optional<Timestamp> at;            // empty: pairs in order
  std::optional<Eigen::Vector3d> xyz_mm;  // empty: status none
  int line = 0;
};

// The columns stamp_ns, status and POINT_x_mm, _y_mm, _z_mm of a table of poses.
Result<std::vector<PlacedPoint>, FileFault> ReadPosedPoint(std::string text,
                                                           const std::string& file,
                                                           std::string_view point);

struct SurveyLog {
  std::vector<PlacedPoint> points;  // those with the wanted name, in the order of the file
  std::size_t other_points = 0;
};

// A CSV with stamp_ns, point, x_mm, y_mm, z_mm, or a Leica GSI file (east, north, height become x,
// y, z). Names compare without leading zeros, as total stations pad them.
Result<SurveyLog, FileFault> ReadSurveyLog(std::string text,
                                           const std::string& file,
                                           std::string_view point);

enum class Pairing {
  kInOrder,       // one side has no stamps
  kExact,         // a pose with the very stamp
  kInterpolated,  // between the poses before and after
  kNearest,       // a pose on one side only
};
std::string_view PairingWord(Pairing pairing);

struct Observation {
  std::optional<Timestamp> at;
  Pairing pairing = Pairing::kInOrder;
  Eigen::Vector3d posed_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d surveyed_mm = Eigen::Vector3d::Zero();  // aligned, when that was asked for
  Eigen::Vector3d difference_mm() const { return posed_mm - surveyed_mm; }
};

struct Pairs {
  std::vector<Observation> observations;
  std::size_t without_pose = 0;     // survey rows whose pose has status none
  std::size_t without_partner = 0;  // survey rows with no pose within the tolerance
};

// Pairs survey rows with poses. With stamps on both sides each survey row takes the pose of its
// stamp: interpolated linearly between neighbours that are both within `tolerance`, or the nearest
// when only one is. Otherwise the rows pair in order: row by row, or pose by pose leaving out
// status none when only that makes the counts equal. The error is a sentence for the user.
Result<Pairs, std::string> PairUp(const std::vector<PlacedPoint>& poses,
                                  const std::vector<PlacedPoint>& survey,
                                  Duration tolerance);

// Turns and shifts the surveyed points onto the posed ones (least squares, no scale) and says how
// many degrees of freedom the data gave to that: 6, 5 when all points stand on one line, 3 when
// there is one point only.
struct Alignment {
  Rigid3 posed_from_surveyed;  // translation in mm
  int degrees_of_freedom = 0;
};
Alignment AlignRigid(Pairs& pairs);

struct Spread {
  double mean_mm = 0.0;
  double rms_mm = 0.0;
  double p95_mm = 0.0;  // smallest value that 95 % of the absolute values do not exceed
  double max_mm = 0.0;  // of the absolute values
};
Spread SpreadOf(std::vector<double> values_mm);

}  // namespace tbm
