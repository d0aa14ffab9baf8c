#include "pose/solve/start_pose.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <Eigen/QR>

#include "pose/solve/cubic.h"
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
  double seen_sigma = 0.0;      // of a bearing on the plane z = 1, centres and calibration residual
  double tilt_sigma_rad = 0.0;  // of the level frames against each other
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

double SeenSigma(const PoseProblem& problem) {
  const double residual_px = problem.rig->calibration_residual_px;
  double sum_px2 = 0.0;
  for (const LedObservation& led : problem.leds) {
    const double centre_px = std::max(led.sigma_px, kLeastCentreSigmaPx);
    sum_px2 += centre_px * centre_px + residual_px * residual_px;
  }
  const double leds = static_cast<double>(problem.leds.size());
  return std::sqrt(sum_px2 / leds) / problem.rig->camera.fx_px;
}

// Takes the tilts and the lens out of the problem. False without usable tilts.
bool Level(const PoseProblem& problem, Levelled& levelled) {
  const auto tilts = TiltConstraint::From(problem);
  if (!tilts) return false;
  levelled.camera_from_level = BodyFromLevel(tilts->up_in_camera);
  levelled.target_from_level = BodyFromLevel(tilts->up_in_target);
  const Eigen::Matrix3d& a = levelled.camera_from_level;
  levelled.seen_sigma = SeenSigma(problem);
  levelled.tilt_sigma_rad =
      std::sqrt(tilts->camera_covariance.trace() + tilts->target_deviation.squaredNorm());
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

// One over the yaw sigma [rad] beyond which a pair says nothing about yaw: 6 degrees.
constexpr double kLeastYawSignal = 10.0;

// Roots of one linear equation h . (alpha, beta) + c = 0 on the unit circle: two LEDs. The rays of
// both span a plane that holds the baseline, so only the yaw that turns the baseline into it fits.
// Where noise leaves no root, the nearest point of the circle.
FixedVector<Eigen::Vector2d, 2> RootsOfPair(const Levelled& levelled) {
  const Eigen::Vector3d normal =
      levelled.leds[0].seen.homogeneous().cross(levelled.leds[1].seen.homogeneous());
  const Eigen::Matrix3d baseline = levelled.leds[1].turned - levelled.leds[0].turned;
  const Eigen::RowVector3d equation = normal.transpose() * baseline;
  const Eigen::Vector2d h = equation.head<2>().transpose();
  const double c = equation[2];
  const double h_squared = h.squaredNorm();
  // Both LEDs at camera height or on one plumb line: h is nothing but noise, every yaw fits.
  const double h_sigma = levelled.seen_sigma * baseline.col(0).norm() +
                         levelled.tilt_sigma_rad * normal.norm() * baseline.norm();
  FixedVector<Eigen::Vector2d, 2> roots;
  if (!(std::sqrt(h_squared) > kLeastYawSignal * h_sigma)) return roots;
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

  OnCircle(double a0_, double a1_, double b1_, double a2_, double b2_)
      : a0(a0_), a1(a1_), b1(b1_), a2(a2_), b2(b2_) {}

  // The same with k counted from v.
  OnCircle SeenFrom(const Eigen::Vector2d& v) const {
    const double cos_2k = v.x() * v.x() - v.y() * v.y();
    const double sin_2k = 2.0 * v.x() * v.y();
    return {a0,
            a1 * v.x() + b1 * v.y(),
            b1 * v.x() - a1 * v.y(),
            a2 * cos_2k + b2 * sin_2k,
            b2 * cos_2k - a2 * sin_2k};
  }

  double Bend(const Eigen::Vector2d& v) const {
    const double cos_2k = v.x() * v.x() - v.y() * v.y();
    const double sin_2k = 2.0 * v.x() * v.y();
    return -a1 * v.x() - b1 * v.y() - 4.0 * (a2 * cos_2k + b2 * sin_2k);
  }

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
      const double bend = Bend(v);
      if (!(std::abs(bend) > 0.0)) return v;
      const double turn = std::clamp(-slope / std::abs(bend), -0.2, 0.2);
      v = Eigen::Vector2d(v.x() - turn * v.y(), v.y() + turn * v.x()).normalized();
      if (std::abs(turn) < 1e-8) return v;  // quadratic: the next step is below rounding
    }
    return v;
  }
};

// The lowest minimum first. One is found by Newton from the best of a few samples; seen from there
// (k = 0, where the slope b1 + 2 b2 vanishes) the other stationary points are, with u = tan(k / 2),
// the roots of 2 b2 u^3 + (4 a2 - a1) u^2 - 6 b2 u - (a1 + 4 a2). Minima as close as one likes come
// out.
FixedVector<Eigen::Vector2d, 2> MinimaOnCircle(const Eigen::Matrix3d& form) {
  constexpr double kDiagonal = 0.70710678118654752440;
  static const std::array<Eigen::Vector2d, 8> kSamples = {Eigen::Vector2d(1.0, 0.0),
                                                          {kDiagonal, kDiagonal},
                                                          {0.0, 1.0},
                                                          {-kDiagonal, kDiagonal},
                                                          {-1.0, 0.0},
                                                          {-kDiagonal, -kDiagonal},
                                                          {0.0, -1.0},
                                                          {kDiagonal, -kDiagonal}};
  const OnCircle squared_residual(form);
  const Eigen::Vector2d* best = &kSamples[0];
  for (const Eigen::Vector2d& sample : kSamples) {
    if (squared_residual.At(sample) < squared_residual.At(*best)) best = &sample;
  }
  FixedVector<Eigen::Vector2d, 2> minima;
  const Eigen::Vector2d first = squared_residual.Minimum(*best);
  if (!first.allFinite()) return minima;
  minima.push_back(first);

  const OnCircle seen = squared_residual.SeenFrom(first);
  double c3 = 2.0 * seen.b2;
  double c2 = 4.0 * seen.a2 - seen.a1;
  double c1 = -6.0 * seen.b2;
  double c0 = -(seen.a1 + 4.0 * seen.a2);
  const bool is_inverse = std::abs(c3) < std::abs(c0);
  if (is_inverse) {
    std::swap(c3, c0);
    std::swap(c2, c1);
  }
  if (c3 == 0.0) return minima;
  for (const double root : CubicRoots(c3, c2, c1, c0)) {
    const Eigen::Vector2d half =
        (is_inverse ? Eigen::Vector2d(root, 1.0) : Eigen::Vector2d(1.0, root)).normalized();
    const double cos_k = half.x() * half.x() - half.y() * half.y();
    const double sin_k = 2.0 * half.x() * half.y();
    const Eigen::Vector2d v(first.x() * cos_k - first.y() * sin_k,
                            first.y() * cos_k + first.x() * sin_k);
    if (minima.full() || !(squared_residual.Bend(v) > 0.0)) continue;
    minima.push_back(squared_residual.Minimum(v));
  }
  if (minima.size() == 2 && squared_residual.At(minima[1]) < squared_residual.At(minima[0])) {
    std::swap(minima[0], minima[1]);
  }
  return minima;
}

// A second minimum that fits worse than the first by this many squared sigmas is not worth a look:
// the solver's own chi2 would have to err by more than half of it.
constexpr double kClearExcess = 60.0;

// Expected square of one equation of Eq. 14 at a root: noise of the bearing times the depth, and of
// the tilts times the LEDs' spread about their mean. Both are upper estimates.
double SquaredNoise(const Levelled& levelled, const Eigen::Vector3d& v, double t3) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  double sum_of_squares = 0.0;
  for (int i = 0; i < levelled.count; ++i) {
    const Eigen::Vector3d arm = levelled.leds[static_cast<std::size_t>(i)].turned * v;
    mean += arm;
    sum_of_squares += arm.squaredNorm();
  }
  mean /= levelled.count;
  const double spread_squared = sum_of_squares / levelled.count - mean.squaredNorm();
  const double by_seen = levelled.seen_sigma * (mean.z() + t3);
  return by_seen * by_seen + levelled.tilt_sigma_rad * levelled.tilt_sigma_rad * spread_squared;
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
  double best_misfit = 0.0;
  for (const Eigen::Vector2d& root : roots) {
    const Eigen::Vector3d v(root.x(), root.y(), 1.0);
    const Eigen::Vector3d t = eliminated.t_by_v * v;
    if (!AllInFront(levelled, v, t.z())) continue;
    const double misfit = v.dot(eliminated.form * v);
    const bool is_first = starts.camera_from_target.empty();
    if (is_first) best_misfit = misfit;
    const double excess = misfit - best_misfit;
    if (!is_first && !is_pair && excess > kClearExcess * SquaredNoise(levelled, v, t.z())) break;
    const Eigen::Matrix3d rotation = RotationAt(levelled, root.x(), root.y());
    starts.camera_from_target.push_back({Eigen::Quaterniond(rotation).normalized(), t});
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
