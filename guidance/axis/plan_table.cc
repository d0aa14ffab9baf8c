#include <algorithm>
#include <cmath>
#include <memory>

#include "guidance/axis/cubic_spline.h"
#include "guidance/axis/plan_build.h"
#include "guidance/axis/quadrature.h"

namespace tbm {
namespace {

constexpr double kLargest_m = 1e8;
constexpr double kShortest_m = 1e-6;
// A table has a point every metre or so; an interval that turns by more is no tunnel.
constexpr double kLargestTurn_rad = 0.5;

// One interval of the plane spline, by its length.
struct SplineInterval {
  CubicSpline::Cubic x;
  CubicSpline::Cubic y;
  double step = 0.0;  // of the spline's parameter

  Eigen::Vector2d Velocity(double t) const {
    return {x.b + t * (2.0 * x.c + t * 3.0 * x.d), y.b + t * (2.0 * y.c + t * 3.0 * y.d)};
  }
  double Curvature(double t) const {
    const Eigen::Vector2d velocity = Velocity(t);
    const Eigen::Vector2d acceleration(2.0 * x.c + 6.0 * t * x.d, 2.0 * y.c + 6.0 * t * y.d);
    const double speed = velocity.norm();
    return CrossProduct(velocity, acceleration) / (speed * speed * speed);
  }
  double Length(double t) const {
    return IntegrateGauss([this](double at) { return Velocity(at).norm(); }, 0.0, t, /*pieces=*/1);
  }
  double Parameter(double s_m, double length_m) const {
    double t = step * s_m / length_m;
    for (int iteration = 0; iteration < 10; ++iteration) {
      const double change = (s_m - Length(t)) / Velocity(t).norm();
      t += change;
      if (std::abs(change) < 1e-14 * step) break;
    }
    return t;
  }
  double Turn(double t) const {
    const Eigen::Vector2d first = Velocity(0.0);
    const Eigen::Vector2d now = Velocity(t);
    return std::atan2(CrossProduct(first, now), first.dot(now));
  }
  // Everything below relies on a nearly even pace and a small turn.
  bool IsTame() const {
    for (int i = 0; i <= 8; ++i) {
      const double t = step * i / 8.0;
      const double speed = Velocity(t).norm();
      if (!(speed > 0.5 && speed < 2.0) || !(std::abs(Turn(t)) < kLargestTurn_rad)) return false;
    }
    return true;
  }
};

PlanShape ShapeOf(const SplineInterval& interval) {
  PlanShape shape;
  const double length_m = interval.Length(interval.step);
  shape.length_m = length_m;
  shape.turn_rad = [=](double s_m) { return interval.Turn(interval.Parameter(s_m, length_m)); };
  shape.curvature_left_per_m = [=](double s_m) {
    return interval.Curvature(interval.Parameter(s_m, length_m));
  };
  return shape;
}

class TableBuilder {
 public:
  TableBuilder(const AxisDescription& description, AxisRemarks* remarks)
      : table_(description.table), start_(description.start), remarks_(*remarks) {}

  std::optional<PlanRuns> Build() {
    if (table_.size() < 2) {
      Say(AxisRemarkCode::kNoPlan, Severity::kRefused, 0, 0.0);
      return std::nullopt;
    }
    if (!CheckPoints()) return std::nullopt;
    runs_.origin = table_.front().plan.array().round().matrix();
    if (!MakeRuns()) return std::nullopt;
    CheckSpacing();
    CheckSmoothness();
    CheckRounding();
    return std::move(runs_);
  }

 private:
  AxisRemark& Say(AxisRemarkCode code, Severity severity, std::size_t point, double size) {
    const int line = point < table_.size() ? table_[point].line : 0;
    const double at_m = point < chainages_m_.size() ? chainages_m_[point] : 0.0;
    remarks_.push_back(RemarkAt(code, severity, line, {at_m}, size));
    return remarks_.back();
  }

  bool CheckPoints() {
    bool is_fine = true;
    const auto refuse = [&](AxisRemarkCode code, std::size_t point, double size) {
      Say(code, Severity::kRefused, point, size);
      is_fine = false;
    };
    for (std::size_t i = 0; i < table_.size(); ++i) {
      const TablePoint& point = table_[i];
      const TablePoint& first = table_.front();
      const bool is_finite = std::abs(point.plan.x()) < kLargest_m &&
                             std::abs(point.plan.y()) < kLargest_m &&
                             std::abs(point.up_m.value_or(0.0)) < kLargest_m &&
                             std::abs(point.chainage_m.value_or(0.0)) < kLargest_m;
      if (!is_finite) refuse(AxisRemarkCode::kNotFinite, i, 0.0);
      if (point.up_m.has_value() != first.up_m.has_value() ||
          point.chainage_m.has_value() != first.chainage_m.has_value()) {
        refuse(AxisRemarkCode::kTableMixed, i, 0.0);
      }
      if (i == 0) continue;
      const double step_m = (point.plan - table_[i - 1].plan).norm();
      if (!(step_m > kShortest_m)) refuse(AxisRemarkCode::kNoLength, i, step_m);
      if (point.chainage_m && table_[i - 1].chainage_m &&
          !(*point.chainage_m - *table_[i - 1].chainage_m > kShortest_m)) {
        refuse(AxisRemarkCode::kTableChainage, i, *point.chainage_m - *table_[i - 1].chainage_m);
      }
    }
    return is_fine;
  }

  bool MakeRuns() {
    std::vector<double> x;
    std::vector<double> y;
    for (const TablePoint& point : table_) {
      const Eigen::Vector2d place = point.plan - runs_.origin;
      knots_m_.push_back(
          x.empty() ? 0.0 : knots_m_.back() + (place - Eigen::Vector2d(x.back(), y.back())).norm());
      x.push_back(place.x());
      y.push_back(place.y());
    }
    const CubicSpline spline_x(knots_m_, x);
    const CubicSpline spline_y(knots_m_, y);
    chainages_m_.push_back(table_.front().chainage_m.value_or(start_.m));
    bool is_fine = true;
    for (std::size_t i = 0; i + 1 < table_.size(); ++i) {
      const SplineInterval interval{spline_x.On(i), spline_y.On(i), knots_m_[i + 1] - knots_m_[i]};
      if (!interval.IsTame()) {
        Say(AxisRemarkCode::kTurnsTooFar, Severity::kRefused, i, kLargestTurn_rad);
        is_fine = false;
        chainages_m_.push_back(chainages_m_.back() + interval.step);
        continue;
      }
      const PlanShape shape = ShapeOf(interval);
      PlanRun run{CutIntoPieces(shape), chainages_m_.back(), shape.length_m};
      PlaceRun({x[i], y[i]}, {x[i + 1], y[i + 1]}, &run.pieces);
      CheckChainage(i, shape.length_m, &run);
      chainages_m_.push_back(run.start_m + run.length_m);
      runs_.runs.push_back(std::move(run));
    }
    return is_fine;
  }

  // The table's own chainage counts, where it has one.
  void CheckChainage(std::size_t i, double length_m, PlanRun* run) {
    if (!table_[i].chainage_m) return;
    run->start_m = *table_[i].chainage_m;
    run->length_m = *table_[i + 1].chainage_m - *table_[i].chainage_m;
    const double off_m = std::abs(run->length_m - length_m);
    if (!(off_m > std::max(kGapRefusedAbove_m, 1e-3 * length_m))) return;
    AxisRemark& remark = Say(AxisRemarkCode::kTableChainage, Severity::kOdd, i, off_m);
    remark.stated = run->length_m;
    remark.computed = length_m;
  }

  double UsualSpacing() const {
    std::vector<double> steps;
    for (std::size_t i = 1; i < knots_m_.size(); ++i) {
      steps.push_back(knots_m_[i] - knots_m_[i - 1]);
    }
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::nth_element(steps.begin(), middle, steps.end());
    return *middle;
  }

  void CheckSpacing() {
    const double usual_m = UsualSpacing();
    for (std::size_t i = 1; i < knots_m_.size(); ++i) {
      const double step_m = knots_m_[i] - knots_m_[i - 1];
      if (step_m > 3.0 * usual_m) {
        Say(AxisRemarkCode::kTableSpacing, Severity::kOdd, i - 1, step_m);
      }
    }
  }

  // Distance of a point from the cubic through its two neighbours on either side.
  double OffNeighbours(std::size_t i) const {
    Eigen::Vector2d expected = Eigen::Vector2d::Zero();
    const std::size_t neighbours[] = {i - 2, i - 1, i + 1, i + 2};
    for (const std::size_t k : neighbours) {
      double weight = 1.0;
      for (const std::size_t other : neighbours) {
        if (other == k) continue;
        weight *= (knots_m_[i] - knots_m_[other]) / (knots_m_[k] - knots_m_[other]);
      }
      expected += weight * (table_[k].plan - table_[i].plan);
    }
    return expected.norm();
  }

  // Where a line meets an arc without a transition, the cubic itself is off by about 0.1 of
  // spacing^2 / radius: 2 mm at 1 m and 50 m radius.
  void CheckSmoothness() {
    std::vector<double> off_m(table_.size(), 0.0);
    for (std::size_t i = 2; i + 2 < table_.size(); ++i) off_m[i] = OffNeighbours(i);
    for (std::size_t i = 2; i + 2 < table_.size(); ++i) {
      const double step_m = 0.5 * (knots_m_[i + 1] - knots_m_[i - 1]);
      const double limit_m = 0.005 + 0.002 * step_m * step_m;
      const bool is_peak = off_m[i] >= off_m[i - 1] && off_m[i] > off_m[i + 1];
      if (is_peak && off_m[i] > limit_m) {
        Say(AxisRemarkCode::kTableSticksOut, Severity::kOdd, i, off_m[i]);
      }
    }
  }

  bool AreMultiplesOf(double unit_m) const {
    return std::all_of(table_.begin(), table_.end(), [unit_m](const TablePoint& point) {
      for (const double value_m : {point.plan.x(), point.plan.y()}) {
        const double steps = value_m / unit_m;
        if (std::abs(steps - std::round(steps)) > 1e-4) return false;
      }
      return true;
    });
  }

  // Each coordinate is off by unit / sqrt(12) rms, the difference of two by sqrt(2) of that.
  void CheckRounding() {
    for (const double unit_m : {1.0, 0.1, 0.01, 0.001}) {
      if (!AreMultiplesOf(unit_m)) continue;
      const double noise_rad = unit_m / std::sqrt(6.0) / UsualSpacing();
      if (noise_rad <= 1e-4) return;
      AxisRemark& remark = Say(AxisRemarkCode::kTableRounded, Severity::kOdd, 0, noise_rad);
      remark.stated = unit_m;
      return;
    }
  }

  const std::vector<TablePoint>& table_;
  InternalChainage start_;
  AxisRemarks& remarks_;
  PlanRuns runs_;
  std::vector<double> knots_m_;
  std::vector<double> chainages_m_;
};

}  // namespace

std::optional<PlanRuns> BuildTableRuns(const AxisDescription& description, AxisRemarks* remarks) {
  return TableBuilder(description, remarks).Build();
}

}  // namespace tbm
