#include "guidance/rail/inertial_line.h"

#include <algorithm>
#include <cmath>

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

bool IsIn(const std::vector<RestSpan>& spans, Timestamp at) {
  return std::any_of(spans.begin(), spans.end(), [&](const RestSpan& span) {
    return span.begins_at <= at && at <= span.ends_at;
  });
}

struct Row {
  double t_s = 0.0;
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  bool rests = false;
};

// Velocities with what they should not have at the next rest taken off in equal parts.
void CloseAtRests(std::vector<Row>* rows) {
  std::size_t last = 0;  // of the rest before
  for (std::size_t i = 1; i < rows->size(); ++i) {
    if (!(*rows)[i].rests) continue;
    const Eigen::Vector3d off = (*rows)[i].velocity_m_s;
    const double span_s = (*rows)[i].t_s - (*rows)[last].t_s;
    for (std::size_t k = last + 1; k < i; ++k) {
      (*rows)[k].velocity_m_s -= off * ((*rows)[k].t_s - (*rows)[last].t_s) / span_s;
    }
    for (std::size_t k = i; k < rows->size(); ++k) (*rows)[k].velocity_m_s -= off;
    last = i;
  }
}

}  // namespace

Result<RailLine, RailStartFailure> SolveInertialLine(const RailSetup& setup,
                                                     const RailRecording& recording) {
  const auto rest = FindRestSignature(setup, recording);
  if (!rest) return Failure{rest.error()};
  const auto attitude = FindStartAttitude(setup, recording, *rest);
  if (!attitude) return Failure{attitude.error()};
  const Eigen::Vector3d gravity_m_s2(0.0, 0.0, -setup.gravity_m_s2);
  const Eigen::Vector3d accel_bias_m_s2 =
      rest->mean_accel_m_s2 + attitude->conjugate() * gravity_m_s2;
  const std::vector<RestSpan> rests = FindQuietSpans(setup, recording, *rest);
  const ImuSample& first = recording.imu.front();
  const Timestamp begin = first.ends_at - Duration(std::llround(first.interval_s * 1e9));

  RailLine line;
  std::vector<Row> rows;
  Eigen::Quaterniond q = *attitude;
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d rate_before = first.gyro_rad_s - rest->mean_gyro_rad_s;
  for (const ImuSample& sample : recording.imu) {
    const double t_s = SecondsBetween(begin, sample.ends_at);
    const bool at_start = t_s <= setup.start.at_rest_s;
    const Eigen::Vector3d rate = sample.gyro_rad_s - rest->mean_gyro_rad_s;
    if (!at_start) {
      const Eigen::Quaterniond before = q;
      q = RungeKutta(q, rate_before, rate, sample.interval_s);
      const Eigen::Vector3d force = sample.accel_m_s2 - accel_bias_m_s2;
      velocity_m_s += sample.interval_s * (0.5 * (before * force + q * force) + gravity_m_s2);
    }
    rate_before = rate;
    rows.push_back({t_s, velocity_m_s, at_start || IsIn(rests, sample.ends_at)});
    line.points.push_back({.at = sample.ends_at, .world_from_imu = q});
  }
  CloseAtRests(&rows);

  Eigen::Vector3d position_m = setup.start.position_world_m;
  double distance_m = 0.0;
  double open_s = 0.0;  // since the last rest
  // What the rest could tell of the biases: its noise over its length. An error of the gyros' leans
  // gravity, and so does their noise.
  const double velocity_walk = setup.imu.noise.velocity_random_walk_m_s;
  const double rest_s = setup.start.at_rest_s;
  const double bias_m_s2 = velocity_walk / std::sqrt(rest_s);
  const double lean_m_s3 = setup.gravity_m_s2 * setup.imu.noise.angle_random_walk_rad;
  double held_m = setup.start.sigma_position_m;
  for (std::size_t i = 0; i < line.points.size(); ++i) {
    RailPoint& point = line.points[i];
    const double span_s = recording.imu[i].interval_s;
    if (rows[i].rests) {
      held_m = i > 0 ? line.points[i - 1].sigma_world_m.maxCoeff() : held_m;
      open_s = 0.0;
    } else {
      const Eigen::Vector3d before = i > 0 ? rows[i - 1].velocity_m_s : Eigen::Vector3d::Zero();
      const Eigen::Vector3d step_m = 0.5 * span_s * (before + rows[i].velocity_m_s);
      position_m += step_m;
      distance_m += step_m.norm();
      open_s += span_s;
    }
    point.position_world_m = position_m;
    point.distance_m = distance_m;
    const double noise_m = velocity_walk * std::sqrt(open_s * open_s * open_s / 3.0);
    const double drift_m = 0.5 * bias_m_s2 * open_s * open_s;
    const double lean_m = lean_m_s3 * std::sqrt(std::pow(open_s, 5) / 20.0);
    const double turn_m = lean_m_s3 / std::sqrt(rest_s) * std::pow(open_s, 3) / 6.0;
    point.sigma_world_m.setConstant(
        std::hypot(std::hypot(held_m, noise_m), std::hypot(drift_m, lean_m, turn_m)));
    point.status = rows[i].rests ? RailStatus::kFixed : RailStatus::kOpen;
  }
  return line;
}

}  // namespace tbm
