#include "guidance/axis/plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "guidance/axis/plan_build.h"
#include "pose/base/check.h"

namespace tbm {
namespace {

constexpr std::size_t kFanOut = 8;
// A file has at most some 1e7 pieces; eight to the eighth is enough, and bounds the stack.
constexpr std::size_t kMostLevels = 10;
// How far beyond the very ends a foot still belongs to the axis: rounding.
constexpr double kAtEnd_m = 1e-9;
// A point so near to a corner has no direction to it.
constexpr double kAtCorner_m = 1e-6;
// Two feet nearer to each other are one: both sides of a joint found it.
constexpr double kSameFoot_m = 1e-7;

double SquaredDistance(const Eigen::Vector2d& low,
                       const Eigen::Vector2d& high,
                       const Eigen::Vector2d& p) {
  const double x = std::max({low.x() - p.x(), 0.0, p.x() - high.x()});
  const double y = std::max({low.y() - p.y(), 0.0, p.y() - high.y()});
  return x * x + y * y;
}

double RightOf(const Eigen::Vector2d& direction, const Eigen::Vector2d& from_foot) {
  return -CrossProduct(direction, from_foot);
}

bool IsSameFoot(const PlanFoot& a, const PlanFoot& b) {
  return std::abs(a.chainage.m - b.chainage.m) < kSameFoot_m;
}

}  // namespace

std::optional<Plan> Plan::Build(const AxisDescription& description, AxisRemarks* remarks) {
  const std::optional<PlanRuns> runs = BuildPlanRuns(description, remarks);
  if (!runs) return std::nullopt;
  Plan plan;
  plan.origin_ = runs->origin;
  for (const PlanRun& run : runs->runs) plan.Add(run.pieces, run.start_m, run.length_m);
  const double end_m = runs->runs.back().start_m + runs->runs.back().length_m;
  plan.first_m_.push_back(end_m);
  plan.element_start_m_.push_back(end_m);
  plan.Finish();
  return plan;
}

void Plan::Add(const PieceRun& run, double start_m, double length_m) {
  double whole_m = 0.0;
  for (const PlanPiece& piece : run.pieces) whole_m += 2.0 * piece.half_length_m;
  double done_m = 0.0;
  element_start_m_.push_back(start_m);
  for (const PlanPiece& piece : run.pieces) {
    pieces_.push_back(piece);
    first_m_.push_back(start_m + length_m * (done_m / whole_m));
    done_m += 2.0 * piece.half_length_m;
    const PlanState first = StateAt(piece, -1.0);
    const PlanState last = StateAt(piece, 1.0);
    ends_.push_back(
        {first.place, first.direction.normalized(), last.place, last.direction.normalized()});
  }
}

void Plan::Finish() {
  TBM_CHECK(!pieces_.empty());
  for (std::size_t i = 0; i < pieces_.size(); ++i) boxes_.push_back(BoxOfPiece(i));
  levels_.push_back({0, boxes_.size()});
  while (levels_.back().count > 1) {
    const Level below = levels_.back();
    const std::size_t first = boxes_.size();
    for (std::size_t i = 0; i < below.count; i += kFanOut) {
      Box box = boxes_[below.first_box + i];
      for (std::size_t k = i + 1; k < std::min(i + kFanOut, below.count); ++k) {
        const Box& other = boxes_[below.first_box + k];
        box.low = box.low.cwiseMin(other.low);
        box.high = box.high.cwiseMax(other.high);
      }
      boxes_.push_back(box);
    }
    levels_.push_back({first, boxes_.size() - first});
  }
  TBM_CHECK(levels_.size() <= kMostLevels);
}

// Both ends, widened by how far a curve of that length can bulge from its chord.
Plan::Box Plan::BoxOfPiece(std::size_t piece) const {
  const Ends& ends = ends_[piece];
  const double chord_m = (ends.last - ends.first).norm();
  const double half_m = pieces_[piece].half_length_m;
  const double bulge_m = std::sqrt(std::max(half_m * half_m - 0.25 * chord_m * chord_m, 0.0));
  const Eigen::Vector2d margin = Eigen::Vector2d::Constant(bulge_m + 1e-9);
  return {ends.first.cwiseMin(ends.last) - margin, ends.first.cwiseMax(ends.last) + margin};
}

std::size_t Plan::PieceAt(double chainage_m) const {
  const auto next = std::upper_bound(first_m_.begin(), first_m_.end() - 1, chainage_m);
  return next == first_m_.begin() ? 0 : static_cast<std::size_t>(next - first_m_.begin()) - 1;
}

double Plan::Tau(std::size_t piece, double chainage_m) const {
  const double from_m = first_m_[piece];
  const double to_m = first_m_[piece + 1];
  return (chainage_m - from_m) / (to_m - from_m) * 2.0 - 1.0;
}

PlanPoint Plan::At(InternalChainage chainage) const {
  const std::size_t piece = PieceAt(chainage.m);
  const double tau = Tau(piece, chainage.m);
  const PlanState state = StateAt(pieces_[piece], tau);
  return {origin_ + state.place, state.direction, -CurvatureLeftAt(pieces_[piece], tau)};
}

// Newton on the distance along the axis, kept inside the piece, where it changes sign once.
std::optional<PlanFoot> Plan::FootInside(std::size_t index,
                                         const Eigen::Vector2d& p,
                                         double at_first_m,
                                         double at_last_m,
                                         double reach_m) const {
  const PlanPiece& piece = pieces_[index];
  double low = -1.0;
  double high = 1.0;
  double tau = at_first_m > at_last_m ? -1.0 + 2.0 * at_first_m / (at_first_m - at_last_m) : 0.0;
  for (int iteration = 0; iteration < 60; ++iteration) {
    const PlanState state = StateAt(piece, tau);
    const Eigen::Vector2d from_foot = p - state.place;
    const double ahead_m = from_foot.dot(state.direction);
    const double offset_left_m = CrossProduct(state.direction, from_foot);
    const double curvature = CurvatureLeftAt(piece, tau);
    (ahead_m >= 0.0 ? low : high) = tau;
    // Going on by a metre brings the foot nearer by this.
    const double gain = 1.0 - curvature * offset_left_m;
    double next = tau + ahead_m / (gain * piece.half_length_m);
    if (!(next >= low && next <= high) || gain <= 0.0) next = 0.5 * (low + high);
    const double step_m = std::abs(next - tau) * piece.half_length_m;
    tau = next;
    // The error behind a step is of the order of curvature times its square.
    if (step_m < 1e-7) break;
  }
  const PlanState state = StateAt(piece, tau);
  const double curvature = CurvatureLeftAt(piece, tau);
  const double offset_right_m = RightOf(state.direction, p - state.place);
  const bool is_foot =
      std::abs(offset_right_m) <= reach_m && -curvature * offset_right_m < kLargestShareOfRadius;
  if (!is_foot) return std::nullopt;
  const double chainage_m =
      first_m_[index] + 0.5 * (tau + 1.0) * (first_m_[index + 1] - first_m_[index]);
  return PlanFoot{{chainage_m}, state.direction, offset_right_m, -curvature};
}

// Where the piece before ends ahead of no foot and the next begins behind it: at a kink, on its
// outer side, the corner itself is the nearest place.
std::optional<PlanFoot> Plan::FootAtJoint(std::size_t joint,
                                          const Eigen::Vector2d& p,
                                          double reach_m) const {
  const std::size_t before = joint == 0 ? 0 : joint - 1;
  const Ends& ends = ends_[before];
  const Eigen::Vector2d from_foot = p - (joint == 0 ? ends.first : ends.last);
  const Eigen::Vector2d direction = joint == 0 ? ends.first_direction : ends.last_direction;
  const double distance_m = from_foot.norm();
  const double bend = CurvatureLeftAt(pieces_[before], joint == 0 ? -1.0 : 1.0);
  PlanFoot foot{{first_m_[joint]}, direction, RightOf(direction, from_foot), -bend};
  if (distance_m > reach_m || -bend * foot.offset_right_m >= kLargestShareOfRadius) {
    return std::nullopt;
  }
  // Square to the line to the point, so that offset and direction belong together.
  if (distance_m > kAtCorner_m) {
    const double side = foot.offset_right_m < 0.0 ? -1.0 : 1.0;
    foot.direction = side / distance_m * LeftOf(from_foot);
    foot.offset_right_m = side * distance_m;
  }
  return foot;
}

template <class Sink>
void Plan::FeetOn(std::size_t piece, const Eigen::Vector2d& p, double reach_m, Sink&& sink) const {
  const Ends& ends = ends_[piece];
  const double at_first_m = (p - ends.first).dot(ends.first_direction);
  const double at_last_m = (p - ends.last).dot(ends.last_direction);
  if (at_first_m >= 0.0 && at_last_m < 0.0) {
    if (const auto foot = FootInside(piece, p, at_first_m, at_last_m, reach_m)) sink(*foot);
  }
  if (piece == 0 && at_first_m < 0.0 && at_first_m > -kAtEnd_m) {
    if (const auto foot = FootAtJoint(0, p, reach_m)) sink(*foot);
  }
  if (at_last_m < 0.0) return;
  const bool is_last = piece + 1 == pieces_.size();
  const bool is_at_joint =
      is_last ? at_last_m < kAtEnd_m
              : (p - ends_[piece + 1].first).dot(ends_[piece + 1].first_direction) < 0.0;
  if (!is_at_joint) return;
  if (const auto foot = FootAtJoint(piece + 1, p, reach_m)) sink(*foot);
}

// Pieces that may be within reach, which may shrink on the way.
template <class Visit>
void Plan::VisitNear(const Eigen::Vector2d& p, const double& reach_m, Visit&& visit) const {
  struct Node {
    std::size_t level;
    std::size_t index;
  };
  std::array<Node, kFanOut * kMostLevels> waiting;
  std::size_t count = 0;
  waiting[count++] = {levels_.size() - 1, 0};
  while (count > 0) {
    const Node node = waiting[--count];
    const Box& box = boxes_[levels_[node.level].first_box + node.index];
    if (SquaredDistance(box.low, box.high, p) > reach_m * reach_m) continue;
    if (node.level == 0) {
      visit(node.index);
      continue;
    }
    const std::size_t first = node.index * kFanOut;
    const std::size_t end = std::min(first + kFanOut, levels_[node.level - 1].count);
    for (std::size_t i = first; i < end; ++i) waiting[count++] = {node.level - 1, i};
  }
}

Plan::Feet Plan::FeetWithin(const Eigen::Vector2d& p_in_site, double reach_m) const {
  const Eigen::Vector2d p = p_in_site - origin_;
  Feet feet;
  double reach_now_m = reach_m;
  const auto take = [&](const PlanFoot& foot) {
    for (const PlanFoot& known : feet) {
      if (IsSameFoot(foot, known)) return;
    }
    if (!feet.full()) {
      feet.push_back(foot);
      return;
    }
    const auto furthest =
        std::max_element(feet.begin(), feet.end(), [](const PlanFoot& a, const PlanFoot& b) {
          return std::abs(a.offset_right_m) < std::abs(b.offset_right_m);
        });
    if (std::abs(foot.offset_right_m) < std::abs(furthest->offset_right_m)) *furthest = foot;
    reach_now_m = std::abs(furthest->offset_right_m);
  };
  VisitNear(p, reach_now_m, [&](std::size_t piece) { FeetOn(piece, p, reach_now_m, take); });
  return feet;
}

std::vector<PlanFoot> Plan::AllFeet(const Eigen::Vector2d& p_in_site, double reach_m) const {
  const Eigen::Vector2d p = p_in_site - origin_;
  std::vector<PlanFoot> feet;
  VisitNear(p, reach_m, [&](std::size_t piece) {
    FeetOn(piece, p, reach_m, [&feet](const PlanFoot& foot) { feet.push_back(foot); });
  });
  std::sort(feet.begin(), feet.end(), [](const PlanFoot& a, const PlanFoot& b) {
    return a.chainage < b.chainage;
  });
  feet.erase(std::unique(feet.begin(), feet.end(), IsSameFoot), feet.end());
  return feet;
}

std::optional<PlanFoot> Plan::FootNearChainage(const Eigen::Vector2d& p_in_site,
                                               double reach_m,
                                               InternalChainage hint) const {
  const Eigen::Vector2d p = p_in_site - origin_;
  const double hint_m = std::clamp(hint.m, start().m, end().m);
  std::optional<PlanFoot> best;
  double best_m = std::numeric_limits<double>::infinity();
  const auto take = [&](const PlanFoot& foot) {
    const double away_m = std::abs(foot.chainage.m - hint_m);
    if (away_m < best_m) {
      best = foot;
      best_m = away_m;
    }
  };
  const auto look = [&](std::size_t piece) {
    const Box& box = boxes_[piece];
    if (SquaredDistance(box.low, box.high, p) <= reach_m * reach_m) FeetOn(piece, p, reach_m, take);
  };
  // Outwards from the hint, the nearer side first, until no piece could be nearer than what is
  // found. The foot at a joint belongs to the piece before it, hence <= and the one step more.
  const std::size_t middle = PieceAt(hint_m);
  std::size_t below = middle + 1;  // pieces before this one are still to be seen
  std::size_t above = middle + 1;  // pieces from this one on are still to be seen
  while (true) {
    const double down_m = below > 0 ? std::max(hint_m - first_m_[below], 0.0)
                                    : std::numeric_limits<double>::infinity();
    const double up_m =
        above < pieces_.size() ? first_m_[above] - hint_m : std::numeric_limits<double>::infinity();
    if (std::min(down_m, up_m) > best_m || (below == 0 && above >= pieces_.size())) return best;
    if (down_m <= up_m) {
      look(--below);
    } else {
      look(above++);
    }
  }
}

}  // namespace tbm
