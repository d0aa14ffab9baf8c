#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "guidance/axis/chainage.h"

namespace tbm {

// What a file says about a design axis, in SI units and in `site` (x east, y north, z up), before
// anything is computed from it. Loaders fill it in; DesignAxis::Build and Inspect read it. Every
// part knows its line in the file, so that what is odd in it can be found there.

enum class Turning { kLeft, kRight };  // seen in the direction of increasing chainage

// Transition curves. The first group gives the curvature as a function of the length, the second
// the height of the curve over its tangent. Formulas and sources: docs/axis.md.
enum class SpiralLaw {
  kClothoid,
  kBloss,
  kCosine,
  kSinusoid,
  kBiquadratic,  // Helmert, Schramm
  kWienerBogen,  // the seventh-degree law, without the roll axis' height
  kCubicSpiral,  // y = l^3 / (6 R L), l along the curve
  kCubicParabola,
  kJapaneseCubic,
  kSineHalfWave,
  kBiquadraticParabola,
};

struct LineElement {
  Eigen::Vector2d start = Eigen::Vector2d::Zero();
  Eigen::Vector2d end = Eigen::Vector2d::Zero();
};

struct CurveElement {
  Eigen::Vector2d start = Eigen::Vector2d::Zero();
  Eigen::Vector2d end = Eigen::Vector2d::Zero();
  std::optional<Eigen::Vector2d> centre;  // centre or radius must be there
  std::optional<double> radius_m;
  Turning turning = Turning::kLeft;
};

struct SpiralElement {
  Eigen::Vector2d start = Eigen::Vector2d::Zero();
  Eigen::Vector2d end = Eigen::Vector2d::Zero();
  SpiralLaw law = SpiralLaw::kClothoid;
  double length_m = 0.0;
  double curvature_start_per_m = 0.0;  // of the side it turns to; 0 for an infinite radius
  double curvature_end_per_m = 0.0;
  Turning turning = Turning::kLeft;
};

// What the file says beyond what the geometry needs. Compared with the geometry, never used in it,
// except length_m: chainage is counted as the file counts it.
struct StatedValues {
  std::optional<double> length_m;
  std::optional<double> start_chainage_m;
  std::optional<double> chord_m;
  std::optional<double> turn_rad;           // delta of a curve, theta of a spiral; without sign
  std::optional<double> bearing_start_rad;  // clockwise from north; of a line: its only bearing
  std::optional<double> bearing_end_rad;
  std::optional<double> clothoid_constant_m;  // A
  std::optional<double> total_x_m;
  std::optional<double> total_y_m;
  std::optional<double> tangent_m;  // of a curve
  std::optional<double> tangent_long_m;
  std::optional<double> tangent_short_m;
  std::optional<Eigen::Vector2d> intersection;  // of the tangents at both ends
};

struct PlanElement {
  std::variant<LineElement, CurveElement, SpiralElement> shape;
  StatedValues stated;
  int line = 0;
};

// A point of the tunneller's table. Without heights there is no profile.
struct TablePoint {
  Eigen::Vector2d plan = Eigen::Vector2d::Zero();
  std::optional<double> up_m;
  std::optional<double> chainage_m;
  int line = 0;
};

enum class ProfileKind {
  kPoint,             // tangents meet with a kink
  kParabola,          // length_in_m is the whole horizontal length, half on either side
  kUnequalParabolas,  // length_in_m before the point, length_out_m behind it
  kCircle,            // radius_m; length_in_m is what the file states
};

// A point of vertical intersection: two gradients meet here, rounded or not.
struct ProfileElement {
  ProfileKind kind = ProfileKind::kPoint;
  InternalChainage at;
  double up_m = 0.0;
  double length_in_m = 0.0;
  double length_out_m = 0.0;
  double radius_m = 0.0;
  int line = 0;
};

// Cant is the height of the left rail over the right one: positive in a right-hand curve, the right
// side goes down. Linear between stations.
struct CantStation {
  InternalChainage at;
  double left_over_right_m = 0.0;
  int line = 0;
};

enum class CantPivot { kUnknown, kInsideRail, kOutsideRail, kCentre, kLeftRail, kRightRail };

struct AxisDescription {
  std::string name;
  std::string file_sha256;  // hexadecimal, of the file's bytes; goes into every record
  InternalChainage start;
  std::optional<double> stated_length_m;
  std::vector<PlanElement> plan;  // either this ..
  std::vector<TablePoint> table;  // .. or this
  std::vector<ProfileElement> profile;
  std::vector<CantStation> cant;
  double gauge_m = 0.0;  // 0: no cant
  CantPivot pivot = CantPivot::kUnknown;
  std::vector<StationEquation> equations;
};

}  // namespace tbm
