#include "guidance/rail/inertial_line.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "guidance/rail/rail_filter.h"
#include "guidance/rail/rail_start.h"

namespace tbm {
namespace {

Eigen::Quaterniond Derivative(const Eigen::Quaterniond& q, const Eigen::Vector3d& rate_rad_s) {
  Eigen::Quaterniond turn(0.0, rate_rad_s.x(), rate_rad_s.y(), rate_rad_s.z());
  Eigen::Quaterniond derivative = q * turn;
  derivative.coeffs() *= 0.5;
  return derivative;
}

Eigen::Quaterniond Plus(const Eigen::Quaterniond& q, const Eigen::Quaterniond& slope, double by) {
  Eigen::Quaterniond sum = q;
  sum.coeffs() += by * slope.coeffs();
  return sum;
}

// One step with the rate going evenly from the one sample's to the other's.
Eigen::Quaterniond RungeKutta(const Eigen::Quaterniond& q,
                              const Eigen::Vector3d& before_rad_s,
                              const Eigen::Vector3d& after_rad_s,
                              double span_s) {
  const Eigen::Vector3d middle_rad_s = 0.5 * (before_rad_s + after_rad_s);
  const Eigen::Quaterniond k1 = Derivative(q, before_rad_s);
  const Eigen::Quaterniond k2 = Derivative(Plus(q, k1, 0.5 * span_s), middle_rad_s);
  const Eigen::Quaterniond k3 = Derivative(Plus(q, k2, 0.5 * span_s), middle_rad_s);
  const Eigen::Quaterniond k4 = Derivative(Plus(q, k3, span_s), after_rad_s);
  Eigen::Quaterniond next = q;
  next.coeffs() +=
      span_s / 6.0 * (k1.coeffs() + 2.0 * k2.coeffs() + 2.0 * k3.coeffs() + k4.coeffs());
  return next.normalized();
}

// A quiet span is rest when the velocity is none within so many of its sigma, and when most of what
// there was since the last rest is gone: after a long way, or after samples are missing, the first
// alone would take any even motion for rest.
constexpr double kSure = 5.0;
constexpr double kMostLeft = 0.3;

// What FeedUpTo lets happen while samples are missing: read off a filter that knew all before.
ImuNoise NoiseOfGap(const RailSetup& setup, double gap_s) {
  const FusionLayout layout;
  const FusionMatrix nothing = 1e-30 * FusionMatrix::Identity(layout.size(), layout.size());
  FusionFilter filter(layout, {}, nothing, setup.imu.noise, setup.gravity_m_s2, {0});
  ImuSample sample;
  sample.accel_m_s2.z() = setup.gravity_m_s2;
  FeedUpTo(filter, setup, sample, {std::llround(gap_s * 1e9)}, gap_s);
  filter.BringForward();
  ImuNoise noise = setup.imu.noise;
  // Along the vertical velocity knows nothing of the lean.
  const int vertical = FusionLayout::kVelocity + 2;
  const int heading = FusionLayout::kAttitude + 2;
  noise.velocity_random_walk_m_s = std::sqrt(filter.covariance()(vertical, vertical) / gap_s);
  noise.angle_random_walk_rad = std::sqrt(filter.covariance()(heading, heading) / gap_s);
  return noise;
}

// How the errors of one horizontal axis grow where nothing corrects them: what is wrong with
// level leans gravity. At the start level and accelerometers agree, so that only what comes later
// counts, and what the rest at the start could tell of the biases: its noise over its length.
class Growth {
 public:
  using Vector5 = Eigen::Matrix<double, 5, 1>;
  using Matrix5 = Eigen::Matrix<double, 5, 5>;

  explicit Growth(const RailSetup& setup) : gravity_m_s2_(setup.gravity_m_s2) {
    const double angle = setup.imu.noise.angle_random_walk_rad;
    const double velocity = setup.imu.noise.velocity_random_walk_m_s;
    covariance_(kRate, kRate) = angle * angle / setup.start.at_rest_s;
    covariance_(kForce, kForce) = velocity * velocity / setup.start.at_rest_s;
    covariance_(kPosition, kPosition) = setup.start.sigma_position_m * setup.start.sigma_position_m;
  }

  void Advance(double span_s, const ImuNoise& noise) {
    Matrix5 step = Matrix5::Identity();
    step(kLean, kRate) = span_s;
    step(kVelocity, kLean) = gravity_m_s2_ * span_s;
    step(kVelocity, kForce) = span_s;
    step(kPosition, kVelocity) = span_s;
    step(kPosition, kLean) = 0.5 * gravity_m_s2_ * span_s * span_s;
    step(kPosition, kForce) = 0.5 * span_s * span_s;
    covariance_ = (step * covariance_ * step.transpose()).eval();
    const double angle = noise.angle_random_walk_rad;
    const double velocity = noise.velocity_random_walk_m_s;
    const double variance = velocity * velocity * span_s;
    covariance_(kLean, kLean) += angle * angle * span_s;
    covariance_(kVelocity, kVelocity) += variance;
    covariance_(kVelocity, kPosition) += variance * span_s / 2.0;
    covariance_(kPosition, kVelocity) += variance * span_s / 2.0;
    covariance_(kPosition, kPosition) += variance * span_s * span_s / 3.0;
  }

  // The velocity that there should not be is taken off evenly over the last `span_s`, and the way
  // that it made with it.
  void Rest(double span_s) {
    Matrix5 closed = Matrix5::Identity();
    closed(kPosition, kVelocity) = -0.5 * span_s;
    closed(kVelocity, kVelocity) = 0.0;
    covariance_ = (closed * covariance_ * closed.transpose()).eval();
  }

  // What all errors have in common with that of the position, itself the last of them.
  Vector5 Common() const { return covariance_.col(kPosition); }

  // Variance of a position `ago_s` before now, once the velocity of now is taken off evenly over
  // `span_s`; `common` of then.
  double ClosedVariance(const Vector5& common, double ago_s, double span_s) const {
    const double of_velocity = gravity_m_s2_ * ago_s * common(kLean) +
                               0.5 * gravity_m_s2_ * ago_s * ago_s * common(kRate) +
                               ago_s * common(kForce) + common(kVelocity);
    const double part_s = 0.5 * (span_s - ago_s) * (span_s - ago_s) / span_s;
    const double variance = common(kPosition) - 2.0 * part_s * of_velocity +
                            part_s * part_s * covariance_(kVelocity, kVelocity);
    return std::max(variance, 0.0);
  }

  double SigmaVelocity() const { return std::sqrt(covariance_(kVelocity, kVelocity)); }
  double SigmaPosition() const { return std::sqrt(covariance_(kPosition, kPosition)); }

 private:
  enum : Eigen::Index { kLean, kRate, kForce, kVelocity, kPosition };

  const double gravity_m_s2_;
  Matrix5 covariance_ = Matrix5::Zero();
};

// The quiet spans as time goes by.
class QuietSpans {
 public:
  explicit QuietSpans(std::vector<RestSpan> spans) : spans_(std::move(spans)) {}
  // Number of the span that `at` lies in; -1: in none. In the order of time.
  int At(Timestamp at) {
    while (next_ < spans_.size() && spans_[next_].ends_at < at) ++next_;
    const bool is_in = next_ < spans_.size() && spans_[next_].begins_at <= at;
    return is_in ? static_cast<int>(next_) : -1;
  }

 private:
  const std::vector<RestSpan> spans_;
  std::size_t next_ = 0;
};

class Integration {
 public:
  Integration(const RailSetup& setup,
              const RestSignature& rest,
              const Eigen::Quaterniond& world_from_imu,
              std::vector<RestSpan> quiet,
              const ImuSample& first)
      : setup_(setup),
        gyro_bias_rad_s_(rest.mean_gyro_rad_s),
        gravity_m_s2_(0.0, 0.0, -setup.gravity_m_s2),
        accel_bias_m_s2_(rest.mean_accel_m_s2 + world_from_imu.conjugate() * gravity_m_s2_),
        begin_(BeginOfRun(first)),
        quiet_(std::move(quiet)),
        growth_(setup),
        world_from_imu_(world_from_imu),
        rate_before_rad_s_(first.gyro_rad_s - gyro_bias_rad_s_),
        now_(begin_) {}

  void Feed(const ImuSample& sample) {
    const double span_s = SecondsBetween(now_, sample.ends_at);
    const double gap_s = GapBefore(setup_, now_, sample);
    now_ = sample.ends_at;
    const double t_s = SecondsBetween(begin_, now_);
    // Also a trolley that rested may have been moved while samples are missing.
    const bool at_start = t_s <= setup_.start.at_rest_s && gap_s <= 0.0;
    if (!at_start) Advance(sample, span_s, gap_s);
    rate_before_rad_s_ = sample.gyro_rad_s - gyro_bias_rad_s_;
    const bool rests = at_start || JudgeRest(gap_s);
    rows_.push_back({t_s, velocity_m_s_, growth_.Common(), growth_.SigmaPosition()});
    if (rests) CloseVelocities();
    RailPoint point{.at = now_, .world_from_imu = world_from_imu_};
    point.status = rests ? RailStatus::kFixed : RailStatus::kOpen;
    if (gap_s > 0.0) point.status = RailStatus::kGap;
    line_.points.push_back(point);
  }

  // Sums up position and distance: now all velocities are known. A wrong heading leads aside.
  RailLine Finish() {
    Eigen::Vector3d position_m = setup_.start.position_world_m;
    double distance_m = 0.0;
    const double heading_rad = setup_.start.heading_rad ? setup_.start.sigma_heading_rad
                                                        : setup_.camera->sigma_rotation_rad;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      RailPoint& point = line_.points[i];
      if (i > 0 && point.status != RailStatus::kFixed) {
        const Eigen::Vector3d step_m = 0.5 * (rows_[i].t_s - rows_[i - 1].t_s) *
                                       (rows_[i - 1].velocity_m_s + rows_[i].velocity_m_s);
        position_m += step_m;
        distance_m += step_m.norm();
      }
      point.position_world_m = position_m;
      point.distance_m = distance_m;
      const Eigen::Vector3d way_m = position_m - setup_.start.position_world_m;
      const Eigen::Vector3d aside_m(heading_rad * way_m.y(), heading_rad * way_m.x(), 0.0);
      const Eigen::Vector3d grown_m = Eigen::Vector3d::Constant(rows_[i].sigma_m);
      point.sigma_world_m = (grown_m.cwiseAbs2() + aside_m.cwiseAbs2()).cwiseSqrt();
    }
    return std::move(line_);
  }

 private:
  struct Row {
    double t_s = 0.0;
    Eigen::Vector3d velocity_m_s;
    Growth::Vector5 common;
    double sigma_m = 0.0;  // of the position
  };

  void Advance(const ImuSample& sample, double span_s, double gap_s) {
    const Eigen::Quaterniond before = world_from_imu_;
    world_from_imu_ =
        RungeKutta(before, rate_before_rad_s_, sample.gyro_rad_s - gyro_bias_rad_s_, span_s);
    const Eigen::Vector3d force = sample.accel_m_s2 - accel_bias_m_s2_;
    velocity_m_s_ += span_s * (0.5 * (before * force + world_from_imu_ * force) + gravity_m_s2_);
    fastest_m_s_ = std::max(fastest_m_s_, velocity_m_s_.norm());
    growth_.Advance(span_s, gap_s > 0.0 ? NoiseOfGap(setup_, gap_s) : setup_.imu.noise);
  }

  // Once for each quiet span, when it begins: an even motion is as quiet as rest.
  bool JudgeRest(double gap_s) {
    const int span = gap_s > 0.0 ? -1 : quiet_.At(now_);
    if (span >= 0 && span != judged_) {
      const double most_m_s =
          std::min(kSure * growth_.SigmaVelocity(), kMostLeft * fastest_m_s_) + kStill_m_s;
      judged_rest_ = velocity_m_s_.norm() <= most_m_s;
    }
    judged_ = span;
    return span >= 0 && judged_rest_;
  }

  // What the velocity should not have is taken off all since the rest before in equal parts.
  void CloseVelocities() {
    const double begin_s = rows_[last_rest_].t_s;
    const double span_s = rows_.back().t_s - begin_s;
    for (std::size_t i = last_rest_ + 1; i < rows_.size(); ++i) {
      Row& row = rows_[i];
      row.velocity_m_s -= velocity_m_s_ * (row.t_s - begin_s) / span_s;
      const double ago_s = rows_.back().t_s - row.t_s;
      row.sigma_m = std::sqrt(growth_.ClosedVariance(row.common, ago_s, span_s));
    }
    growth_.Rest(span_s);
    velocity_m_s_.setZero();
    fastest_m_s_ = 0.0;
    last_rest_ = rows_.size() - 1;
  }

  const RailSetup& setup_;
  const Eigen::Vector3d gyro_bias_rad_s_;
  const Eigen::Vector3d gravity_m_s2_;
  const Eigen::Vector3d accel_bias_m_s2_;
  const Timestamp begin_;
  QuietSpans quiet_;
  Growth growth_;
  Eigen::Quaterniond world_from_imu_;
  Eigen::Vector3d velocity_m_s_ = Eigen::Vector3d::Zero();
  double fastest_m_s_ = 0.0;  // since the last rest
  Eigen::Vector3d rate_before_rad_s_;
  Timestamp now_;
  int judged_ = -1;  // quiet span for which judged_rest_ holds
  bool judged_rest_ = false;
  std::size_t last_rest_ = 0;
  std::vector<Row> rows_;
  RailLine line_;
};

}  // namespace

Result<RailLine, RailStartFailure> SolveInertialLine(const RailSetup& setup,
                                                     const RailRecording& recording) {
  const auto rest = FindRestSignature(setup, recording);
  if (!rest) return Failure{rest.error()};
  const auto attitude = FindStartAttitude(setup, recording, *rest);
  if (!attitude) return Failure{attitude.error()};
  if (const auto too_fast = FindTurnsTooFast(setup, recording, *rest)) return Failure{*too_fast};
  Integration integration(
      setup, *rest, *attitude, FindQuietSpans(setup, recording, *rest), recording.imu.front());
  for (const ImuSample& sample : recording.imu) integration.Feed(sample);
  return integration.Finish();
}

}  // namespace tbm
