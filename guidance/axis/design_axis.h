#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "guidance/axis/axis_description.h"
#include "guidance/axis/axis_remark.h"
#include "guidance/axis/chainage.h"
#include "guidance/axis/plan.h"
#include "guidance/axis/profile.h"
#include "pose/base/result.h"
#include "pose/geometry/rigid3.h"

namespace tbm {

enum class AxisFailure {
  kBeforeStart,  // of the axis
  kBeyondEnd,    // of the axis
  kTooFar,       // no foot within reach: the point is nowhere near this axis
  kAmbiguous,    // two places of the axis are equally near, and no hint decides
  kNotFinite,    // a coordinate or chainage that is no number
  kNoProfile,    // a height was asked for where the design gives none
};

// Cant is positive where the left rail is the higher one; then the right side goes down.
struct Cant {
  double left_over_right_m = 0.0;
  double roll_rad = 0.0;  // asin(cant / gauge); + when the right side goes down
};

// The design at one chainage. Chainage, gradient and curvature count plan length.
struct AxisPoint {
  InternalChainage chainage;
  OfficialChainage official;
  Eigen::Vector2d p_plan_in_site;          // [m] east, north
  Eigen::Vector2d direction_plan_in_site;  // unit length, increasing chainage
  double bearing_rad = 0.0;                // clockwise from north (y of site), 0 .. 2 pi
  double curvature_right_per_m = 0.0;      // + turning right: the bearing grows
  // Absent, never zero, where the design has no profile.
  std::optional<double> up_m;
  std::optional<double> gradient;            // + uphill, per plan length
  std::optional<double> curvature_up_per_m;  // + in a sag
  std::optional<Cant> cant;

  std::optional<Eigen::Vector3d> p_in_site() const;
  std::optional<Eigen::Vector3d> direction_in_site() const;  // unit length
};

// Where a point stands against the design.
struct AxisPosition {
  InternalChainage chainage;  // of the foot: the plan offset is square to the plan axis there
  OfficialChainage official;
  double deviation_right_m = 0.0;        // horizontal, + to the right of the drive
  std::optional<double> deviation_up_m;  // plumb, over the gradient line at that chainage
  double bearing_rad = 0.0;              // of the axis at the foot
  std::optional<double> gradient;        // of the axis at the foot
  double curvature_right_per_m = 0.0;    // of the axis at the foot
  // The next nearest place of the axis within reach, where it passes twice. Only without a hint.
  std::optional<InternalChainage> other_foot;
};

// A design axis: plan, profile, cant and chainage equations. A value; immutable; all questions are
// answered without heap memory, except ProjectAll. Definitions and accuracy: docs/axis.md.
class DesignAxis {
 public:
  // Refused with every remark that Inspect() would make, at least one of them kRefused.
  static Result<DesignAxis, AxisRemarks> Build(const AxisDescription& description);

  const std::string& name() const { return name_; }
  const std::string& file_sha256() const { return file_sha256_; }
  InternalChainage start() const { return plan_.start(); }
  InternalChainage end() const { return plan_.end(); }
  const ChainageEquations& equations() const { return equations_; }
  const Plan& plan() const { return plan_; }
  const Profile& profile() const { return profile_; }

  // kBeforeStart, kBeyondEnd by more than a micrometre; kNotFinite.
  Result<AxisPoint, AxisFailure> At(InternalChainage chainage) const;

  // A deviation of more than this is no deviation. The foot must also lie within 0.9 of the radius
  // of curvature: nearer to the centre the nearest place is not one place.
  static constexpr double kReach_m = 50.0;

  // With a hint: the foot whose chainage is nearest to it, however often the axis passes by.
  // Without: the nearest foot; where two are within reach, the one nearer in space, heights
  // counted. The point's height does not matter where there is no profile. kAmbiguous, kTooFar,
  // kBeforeStart, kBeyondEnd, kNotFinite.
  Result<AxisPosition, AxisFailure> Project(const Eigen::Vector3d& p_in_site,
                                            std::optional<InternalChainage> hint = {},
                                            double reach_m = kReach_m) const;

  // Every foot within reach, by chainage. Allocates.
  std::vector<AxisPosition> ProjectAll(const Eigen::Vector3d& p_in_site, double reach_m) const;

  // Frame `axis` at a chainage: origin on the gradient line, x along the drive in plan, y left, z
  // plumb up, so that a point there has the coordinates (0, -deviation_right_m, deviation_up_m).
  // kNoProfile besides what At() says.
  Result<Rigid3, AxisFailure> AxisFromSite(InternalChainage chainage) const;

 private:
  DesignAxis() = default;
  friend struct AxisBuilder;

  AxisPosition PositionOf(const PlanFoot& foot, const Eigen::Vector3d& p_in_site) const;
  AxisFailure WhyNoFoot(const Eigen::Vector2d& p_in_site, double reach_m) const;
  std::optional<Cant> CantAt(InternalChainage chainage) const;

  std::string name_;
  std::string file_sha256_;
  Plan plan_;
  Profile profile_;
  std::vector<CantStation> cant_;
  double gauge_m_ = 0.0;
  ChainageEquations equations_;
};

// Everything odd in a description, refused or not, in the order plan, profile, cant, equations.
AxisRemarks Inspect(const AxisDescription& description);

}  // namespace tbm
