#include "pose/solve/start_pose.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/QR>

#include "pose/solve/rows.h"

namespace tbm {
namespace {

// One LED of Eq. 14. With v = (alpha, beta, 1) its place in `camera` is turned * v + t, where
// `turned` holds what the two levelling rotations make of its coordinates (the c-matrix of Eq. 7).
struct LevelledLed {
  NormalisedPoint seen;
  Eigen::Matrix3d turned;
};

struct Levelled {
  std::array<LevelledLed, kMaxLeds> leds;
  int count = 0;
  Eigen::Matrix3d camera_from_level;
  Eigen::Matrix3d target_from_level;
};

// Any rotation whose third column is `up`: level frames with the same z, free about it.
Eigen::Matrix3d BodyFromLevel(const Eigen::Vector3d& up) {
  Eigen::Matrix3d body_from_level;
  body_from_level.leftCols<2>() = TangentBasis(up);
  body_from_level.col(2) = up;
  // TangentBasis is right-handed with `up` last: col1 = up x col0.
  return body_from_level;
}

// camera_from_target turns by R^c = [alpha beta 0; -beta alpha 0; 0 0 1] between the level frames.
Eigen::Matrix3d RotationAt(const Levelled& levelled, double alpha, double beta) {
  Eigen::Matrix3d between;
  between << alpha, beta, 0.0, -beta, alpha, 0.0, 0.0, 0.0, 1.0;
  return levelled.camera_from_level * between * levelled.target_from_level.transpose();
}

// Takes the tilts and the lens out of the problem. False without usable tilts.
bool Level(const PoseProblem& problem, Levelled& levelled) {
  const auto tilts = TiltConstraint::From(problem);
  if (!tilts) return false;
  levelled.camera_from_level = BodyFromLevel(tilts->up_in_camera);
  levelled.target_from_level = BodyFromLevel(tilts->up_in_target);
  const Eigen::Matrix3d& a = levelled.camera_from_level;
  for (const LedObservation& led : problem.leds) {
    const auto seen = NormalisedFromPixel(problem.rig->camera, led.pixel_px);
    if (!seen) continue;  // outside the calibrated lens: the start does without it
    const Eigen::Vector3d d =
        levelled.target_from_level.transpose() *
        problem.rig->leds[static_cast<std::size_t>(led.led_index)].p_led_in_target;
    LevelledLed& out = levelled.leds[static_cast<std::size_t>(levelled.count++)];
    out.seen = *seen;
    out.turned.col(0) = d.x() * a.col(0) + d.y() * a.col(1);
    out.turned.col(1) = d.y() * a.col(0) - d.x() * a.col(1);
    out.turned.col(2) = d.z() * a.col(2);
  }
  return true;
}

// Eq. 14 with t eliminated: what is left of the squared residuals is v^T form v.
struct Eliminated {
  Eigen::Matrix3d form;
  // t = by_v * v
  Eigen::Matrix3d t_by_v;
};

// Each LED gives x Z - X = 0 and y Z - Y = 0 with (X, Y, Z) = turned v + t. Subtracting the means
// over the LEDs takes t1 and t2 out; what remains is linear in t3.
bool Eliminate(const Levelled& levelled, Eliminated& out) {
  const double inverse_count = 1.0 / levelled.count;
  Eigen::Vector2d mean_seen = Eigen::Vector2d::Zero();
  Eigen::Matrix<double, 2, 3> mean_rows = Eigen::Matrix<double, 2, 3>::Zero();
  std::array<Eigen::Matrix<double, 2, 3>, kMaxLeds> rows;
  for (int i = 0; i < levelled.count; ++i) {
    const LevelledLed& led = levelled.leds[static_cast<std::size_t>(i)];
    Eigen::Matrix<double, 2, 3>& row = rows[static_cast<std::size_t>(i)];
    row.noalias() = led.seen * led.turned.row(2) - led.turned.topRows<2>();
    mean_seen += led.seen;
    mean_rows += row;
  }
  mean_seen *= inverse_count;
  mean_rows *= inverse_count;

  double spread = 0.0;
  Eigen::RowVector3d by_depth = Eigen::RowVector3d::Zero();
  Eigen::Matrix3d form = Eigen::Matrix3d::Zero();
  for (int i = 0; i < levelled.count; ++i) {
    const Eigen::Vector2d seen = levelled.leds[static_cast<std::size_t>(i)].seen - mean_seen;
    const Eigen::Matrix<double, 2, 3> row = rows[static_cast<std::size_t>(i)] - mean_rows;
    spread += seen.squaredNorm();
    by_depth.noalias() += seen.transpose() * row;
    form.noalias() += row.transpose() * row;
  }
  if (!(spread > 1e-14)) return false;  // all bearings the same: no depth
  const Eigen::RowVector3d t3_by_v = -by_depth / spread;
  out.form = form + by_depth.transpose() * t3_by_v;
  out.t_by_v.topRows<2>() = mean_rows + mean_seen * t3_by_v;
  out.t_by_v.row(2) = t3_by_v;
  return true;
}

// Roots of one linear equation h . (alpha, beta) + c = 0 on the unit circle: two LEDs. The rays of
// both span a plane that holds the baseline, so only the yaw that turns the baseline into it fits.
// Where noise leaves no root, the nearest point of the circle.
FixedVector<Eigen::Vector2d, 2> RootsOfPair(const Levelled& levelled) {
  const Eigen::Vector3d normal =
      levelled.leds[0].seen.homogeneous().cross(levelled.leds[1].seen.homogeneous());
  const Eigen::RowVector3d equation =
      normal.transpose() * (levelled.leds[1].turned - levelled.leds[0].turned);
  const Eigen::Vector2d h = equation.head<2>().transpose();
  const double c = equation[2];
  const double h_squared = h.squaredNorm();
  FixedVector<Eigen::Vector2d, 2> roots;
  if (!(h_squared > 0.0)) return roots;
  const double off_circle = 1.0 - c * c / h_squared;
  if (off_circle <= 0.0) {
    roots.push_back((c > 0.0 ? -1.0 : 1.0) * h.normalized());
    return roots;
  }
  const Eigen::Vector2d foot = (-c / h_squared) * h;
  const Eigen::Vector2d along = std::sqrt(off_circle / h_squared) * Eigen::Vector2d(-h.y(), h.x());
  roots.push_back(foot + along);
  roots.push_back(foot - along);
  return roots;
}

// The squared residual on the circle (alpha, beta) = (cos k, sin k) is the trigonometric polynomial
// a0 + a1 cos k + b1 sin k + a2 cos 2k + b2 sin 2k: at most two minima.
struct OnCircle {
  double a0, a1, b1, a2, b2;

  explicit OnCircle(const Eigen::Matrix3d& form)
      : a0(0.5 * (form(0, 0) + form(1, 1)) + form(2, 2)),
        a1(2.0 * form(0, 2)),
        b1(2.0 * form(1, 2)),
        a2(0.5 * (form(0, 0) - form(1, 1))),
        b2(form(0, 1)) {}

  double At(const Eigen::Vector2d& v) const {
    const double cos_2k = v.x() * v.x() - v.y() * v.y();
    const double sin_2k = 2.0 * v.x() * v.y();
    return a0 + a1 * v.x() + b1 * v.y() + a2 * cos_2k + b2 * sin_2k;
  }

  // Newton on the angle from a point near a minimum.
  Eigen::Vector2d Minimum(Eigen::Vector2d v) const {
    for (int iteration = 0; iteration < 12; ++iteration) {
      const double cos_2k = v.x() * v.x() - v.y() * v.y();
      const double sin_2k = 2.0 * v.x() * v.y();
      const double slope = -a1 * v.y() + b1 * v.x() + 2.0 * (b2 * cos_2k - a2 * sin_2k);
      const double bend = -a1 * v.x() - b1 * v.y() - 4.0 * (a2 * cos_2k + b2 * sin_2k);
      if (!(std::abs(bend) > 0.0)) return v;
      const double turn = std::clamp(-slope / std::abs(bend), -0.2, 0.2);
      v = Eigen::Vector2d(v.x() - turn * v.y(), v.y() + turn * v.x()).normalized();
      if (std::abs(turn) < 1e-8) return v;  // quadratic: the next step is below rounding
    }
    return v;
  }
};

// The lowest minimum first.
FixedVector<Eigen::Vector2d, 2> MinimaOnCircle(const Eigen::Matrix3d& form) {
  constexpr int kSamples = 16;
  static const auto kCircle = [] {
    std::array<Eigen::Vector2d, kSamples> circle;
    for (int i = 0; i < kSamples; ++i) {
      const double angle_rad = 2.0 * std::numbers::pi * i / kSamples;
      circle[static_cast<std::size_t>(i)] = {std::cos(angle_rad), std::sin(angle_rad)};
    }
    return circle;
  }();
  const OnCircle squared_residual(form);
  std::array<double, kSamples> value{};
  for (std::size_t i = 0; i < kSamples; ++i) value[i] = squared_residual.At(kCircle[i]);
  FixedVector<Eigen::Vector2d, 2> minima;
  for (std::size_t i = 0; i < kSamples && !minima.full(); ++i) {
    const double before = value[(i + kSamples - 1) % kSamples];
    const double after = value[(i + 1) % kSamples];
    if (value[i] < before && value[i] <= after) {
      minima.push_back(squared_residual.Minimum(kCircle[i]));
    }
  }
  if (minima.size() == 2 && squared_residual.At(minima[1]) < squared_residual.At(minima[0])) {
    std::swap(minima[0], minima[1]);
  }
  return minima;
}

bool AllInFront(const Levelled& levelled, const Eigen::Vector3d& v, double t3) {
  for (int i = 0; i < levelled.count; ++i) {
    if (!(levelled.leds[static_cast<std::size_t>(i)].turned.row(2) * v + t3 > 0.0)) return false;
  }
  return true;
}

}  // namespace

Result<StartPoses, PoseFailure> StartPose(const PoseProblem& problem) {
  TBM_CHECK(problem.rig != nullptr);
  if (problem.leds.size() < 2) return Failure{PoseFailure::kTooFewLeds};
  Levelled levelled;
  if (!Level(problem, levelled)) return Failure{PoseFailure::kNotObservable};
  if (levelled.count < 2) return Failure{PoseFailure::kTooFewLeds};
  Eliminated eliminated;
  if (!Eliminate(levelled, eliminated)) return Failure{PoseFailure::kNotObservable};

  const bool is_pair = levelled.count == 2;
  const auto roots = is_pair ? RootsOfPair(levelled) : MinimaOnCircle(eliminated.form);
  if (roots.empty()) return Failure{PoseFailure::kNotObservable};
  StartPoses starts;
  for (const Eigen::Vector2d& root : roots) {
    const Eigen::Vector3d v(root.x(), root.y(), 1.0);
    const Eigen::Vector3d t = eliminated.t_by_v * v;
    if (!AllInFront(levelled, v, t.z())) continue;
    const Eigen::Matrix3d rotation = RotationAt(levelled, root.x(), root.y());
    starts.camera_from_target.push_back({Eigen::Quaterniond(rotation).normalized(), t});
    if (!is_pair) break;
  }
  if (starts.camera_from_target.empty()) return Failure{PoseFailure::kBehindCamera};
  return starts;
}

Result<Rigid3, PoseFailure> StartPoseLinear(const PoseProblem& problem) {
  TBM_CHECK(problem.rig != nullptr);
  Levelled levelled;
  if (problem.leds.size() < 3) return Failure{PoseFailure::kTooFewLeds};
  if (!Level(problem, levelled)) return Failure{PoseFailure::kNotObservable};
  if (levelled.count < 3) return Failure{PoseFailure::kTooFewLeds};
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, 5, 0, 2 * kMaxLeds, 5>;
  using Column = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 2 * kMaxLeds, 1>;
  Rows left(2 * levelled.count, 5);
  Column right(2 * levelled.count);
  for (int i = 0; i < levelled.count; ++i) {
    const LevelledLed& led = levelled.leds[static_cast<std::size_t>(i)];
    const Eigen::Matrix<double, 2, 3> row = led.seen * led.turned.row(2) - led.turned.topRows<2>();
    left.middleRows<2>(2 * i) << row.leftCols<2>(), -Eigen::Matrix2d::Identity(), led.seen;
    right.segment<2>(2 * i) = -row.col(2);
  }
  const Eigen::ColPivHouseholderQR<Rows> decomposed(left);
  if (decomposed.rank() < 5) return Failure{PoseFailure::kNotObservable};
  const Eigen::Matrix<double, 5, 1> x = decomposed.solve(right);
  const double length = x.head<2>().norm();
  // Without the circle the scale is free: alpha and beta near zero are the collapse at one height.
  if (!(length > 1e-6)) return Failure{PoseFailure::kNotObservable};
  const Eigen::Vector3d v(x[0], x[1], 1.0);
  if (!AllInFront(levelled, v, x[4])) return Failure{PoseFailure::kBehindCamera};
  const Eigen::Matrix3d rotation = RotationAt(levelled, x[0] / length, x[1] / length);
  return Rigid3{Eigen::Quaterniond(rotation).normalized(), x.tail<3>()};
}

}  // namespace tbm
