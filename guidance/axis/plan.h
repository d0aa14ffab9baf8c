#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "guidance/axis/axis_description.h"
#include "guidance/axis/axis_remark.h"
#include "guidance/axis/plan_piece.h"
#include "pose/base/fixed_vector.h"

namespace tbm {

struct PlanPoint {
  Eigen::Vector2d place;      // [m] east, north
  Eigen::Vector2d direction;  // unit length, increasing chainage
  double curvature_right_per_m = 0.0;
};

// Where a point of the plane falls onto the axis.
struct PlanFoot {
  InternalChainage chainage;
  Eigen::Vector2d direction;  // of the axis there; at a kink, square to the line from foot to point
  double offset_right_m = 0.0;
  double curvature_right_per_m = 0.0;  // of the axis
};

// The axis seen from above. Immutable; nothing here touches the heap after it is built.
class Plan {
 public:
  Plan() = default;

  // What is odd goes to `remarks`. Nothing when any of it is refused.
  static std::optional<Plan> Build(const AxisDescription& description, AxisRemarks* remarks);

  InternalChainage start() const { return {first_m_.front()}; }
  InternalChainage end() const { return {first_m_.back()}; }
  std::size_t piece_count() const { return pieces_.size(); }
  // Elements of the file, or intervals of its table; one more: the end.
  std::size_t element_count() const { return element_start_m_.size() - 1; }
  InternalChainage element_start(std::size_t element) const { return {element_start_m_[element]}; }

  // `chainage` must lie in start .. end.
  PlanPoint At(InternalChainage chainage) const;

  // A foot is a place of the axis whose distance to the point is smallest among its neighbours;
  // beyond kLargestShareOfRadius of the radius of curvature there is none. The kMostFeet nearest
  // of those within reach, in no order.
  static constexpr std::size_t kMostFeet = 16;
  using Feet = FixedVector<PlanFoot, kMostFeet>;
  Feet FeetWithin(const Eigen::Vector2d& p_in_site, double reach_m) const;

  // The foot whose chainage is nearest to `hint`.
  std::optional<PlanFoot> FootNearChainage(const Eigen::Vector2d& p_in_site,
                                           double reach_m,
                                           InternalChainage hint) const;

  // All feet in the order of chainage. Allocates.
  std::vector<PlanFoot> AllFeet(const Eigen::Vector2d& p_in_site, double reach_m) const;

  static constexpr double kLargestShareOfRadius = 0.9;

 private:
  // First and last place and direction of a piece, together in one cache line.
  struct Ends {
    Eigen::Vector2d first;
    Eigen::Vector2d first_direction;
    Eigen::Vector2d last;
    Eigen::Vector2d last_direction;
  };
  struct Box {
    Eigen::Vector2d low;
    Eigen::Vector2d high;
  };
  struct Level {
    std::size_t first_box = 0;
    std::size_t count = 0;
  };

  void Add(const PieceRun& run, double start_m, double length_m);
  void Finish();
  Box BoxOfPiece(std::size_t piece) const;
  std::size_t PieceAt(double chainage_m) const;
  double Tau(std::size_t piece, double chainage_m) const;

  // Feet that belong to a piece: inside it, and at its end where the next one does not take over.
  template <class Sink>
  void FeetOn(std::size_t piece, const Eigen::Vector2d& p, double reach_m, Sink&& sink) const;
  std::optional<PlanFoot> FootInside(std::size_t piece,
                                     const Eigen::Vector2d& p,
                                     double at_first_m,
                                     double at_last_m,
                                     double reach_m) const;
  std::optional<PlanFoot> FootAtJoint(std::size_t joint,
                                      const Eigen::Vector2d& p,
                                      double reach_m) const;
  template <class Visit>
  void VisitNear(const Eigen::Vector2d& p, const double& reach_m, Visit&& visit) const;

  Eigen::Vector2d origin_ = Eigen::Vector2d::Zero();  // pieces are relative to it
  std::vector<PlanPiece> pieces_;
  std::vector<Ends> ends_;
  std::vector<double> first_m_;  // chainage where each piece begins; one more: the end
  std::vector<double> element_start_m_;
  std::vector<Box> boxes_;  // level by level, kFanOut of one to one of the next
  std::vector<Level> levels_;
};

}  // namespace tbm
