#include "guidance/rail_study/rail_scene.h"

#include <cmath>
#include <numbers>
#include <random>
#include <string>

namespace tbm {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kGravity_m_s2 = 9.80665;
constexpr std::int64_t kBegin_ns = 1'790'000'000'000'000'000;

// Table 1 of the paper [mm]: X, Y, Z.
constexpr std::array<std::array<double, 3>, 11> kNodes{{{1000.0, 1200.0, -13450.0},
                                                        {977.7, 1260.0, -13270.0},
                                                        {971.2, 1302.0, -13160.0},
                                                        {972.0, 1337.0, -13080.0},
                                                        {978.1, 1369.0, -13030.0},
                                                        {1041.0, 1632.0, -12910.0},
                                                        {1062.0, 1757.0, -12850.0},
                                                        {1065.0, 1826.0, -12810.0},
                                                        {1058.0, 1885.0, -12760.0},
                                                        {1070.0, 1935.0, -12710.0},
                                                        {1160.0, 2037.0, -12580.0}}};

// Natural cubic spline of one coordinate over the chord.
class Spline {
 public:
  Spline(std::vector<double> at, std::vector<double> value)
      : at_(std::move(at)), value_(std::move(value)), bend_(at_.size(), 0.0) {
    const std::size_t n = at_.size();
    std::vector<double> diagonal(n, 1.0);
    std::vector<double> right(n, 0.0);
    for (std::size_t i = 1; i + 1 < n; ++i) {
      const double before = at_[i] - at_[i - 1];
      const double after = at_[i + 1] - at_[i];
      diagonal[i] = 2.0 * (before + after);
      right[i] = 6.0 * ((value_[i + 1] - value_[i]) / after - (value_[i] - value_[i - 1]) / before);
      if (i > 1) {
        const double factor = before / diagonal[i - 1];
        diagonal[i] -= factor * before;
        right[i] -= factor * right[i - 1];
      }
    }
    for (std::size_t i = n - 2; i >= 1; --i) {
      bend_[i] = (right[i] - (at_[i + 1] - at_[i]) * bend_[i + 1]) / diagonal[i];
    }
  }
  double At(double s) const {
    std::size_t i = 0;
    while (i + 2 < at_.size() && s > at_[i + 1]) ++i;
    const double h = at_[i + 1] - at_[i];
    const double a = (at_[i + 1] - s) / h;
    const double b = (s - at_[i]) / h;
    return a * value_[i] + b * value_[i + 1] +
           ((a * a * a - a) * bend_[i] + (b * b * b - b) * bend_[i + 1]) * h * h / 6.0;
  }

 private:
  std::vector<double> at_;
  std::vector<double> value_;
  std::vector<double> bend_;
};

class Path {
 public:
  explicit Path(const RailScene& scene) : scene_(scene) {
    std::vector<double> at{0.0};
    std::array<std::vector<double>, 3> values;
    for (std::size_t i = 0; i < kNodes.size(); ++i) {
      const Eigen::Vector3d node(kNodes[i][0], -kNodes[i][2], kNodes[i][1]);
      nodes_.push_back(node * 1e-3);
      if (i > 0) at.push_back(at.back() + (nodes_[i] - nodes_[i - 1]).norm());
      for (std::size_t k = 0; k < 3; ++k) {
        values[k].push_back(nodes_[i][static_cast<Eigen::Index>(k)]);
      }
    }
    length_m_ = at.back();
    for (const auto& value : values) splines_.emplace_back(at, value);
    ramp_s_ = 1.0;
    even_s_ = length_m_ / scene.speed_m_s - ramp_s_;
  }

  double whole_s() const { return scene_.rest_s + 2.0 * ramp_s_ + even_s_ + scene_.end_rest_s; }

  // Chord run [m]: speed goes up and down like a raised cosine.
  double ChordAt(double t) const {
    const double u = t - scene_.rest_s;
    const double v = scene_.speed_m_s;
    const auto ramp = [&](double x) {
      return v * (x / 2.0 - ramp_s_ / (2.0 * kPi) * std::sin(kPi * x / ramp_s_));
    };
    if (u <= 0.0) return 0.0;
    if (u < ramp_s_) return ramp(u);
    const double at_speed_m = v * ramp_s_ / 2.0;
    if (u < ramp_s_ + even_s_) return at_speed_m + v * (u - ramp_s_);
    const double left = 2.0 * ramp_s_ + even_s_ - u;
    if (left <= 0.0) return length_m_;
    return length_m_ - ramp(left);
  }

  Eigen::Vector3d PositionAt(double t) const {
    const double s = ChordAt(t);
    return {splines_[0].At(s), splines_[1].At(s), splines_[2].At(s)};
  }

  // Looks along -y; turns smoothly, and back, while it runs.
  Eigen::Quaterniond AttitudeAt(double t) const {
    const double way = ChordAt(t) / length_m_;
    const double turn = scene_.turns_deg * kPi / 180.0;
    const Eigen::Vector3d angles(turn * std::sin(2.0 * kPi * way),
                                 0.5 * turn * (1.0 - std::cos(2.0 * kPi * way)),
                                 turn * std::sin(kPi * way) * std::sin(kPi * way));
    return Eigen::AngleAxisd(-kPi / 2.0 + angles.z(), Eigen::Vector3d::UnitZ()) *
           Eigen::AngleAxisd(angles.y(), Eigen::Vector3d::UnitY()) *
           Eigen::AngleAxisd(angles.x(), Eigen::Vector3d::UnitX());
  }

 private:
  const RailScene& scene_;
  std::vector<Eigen::Vector3d> nodes_;
  std::vector<Spline> splines_;
  double length_m_ = 0.0;
  double ramp_s_ = 0.0;
  double even_s_ = 0.0;
};

class Draw {
 public:
  explicit Draw(std::uint64_t seed) : engine_(seed) {}
  double Normal(double sigma) { return sigma * normal_(engine_); }
  double Uniform(double low, double high) {
    return low + (high - low) * std::generate_canonical<double, 53>(engine_);
  }
  Eigen::Vector3d Normal3(double sigma) { return {Normal(sigma), Normal(sigma), Normal(sigma)}; }

 private:
  std::mt19937_64 engine_;
  std::normal_distribution<double> normal_;
};

Eigen::Quaterniond Turn(const Eigen::Vector3d& angles_rad) {
  const double angle = angles_rad.norm();
  if (angle < 1e-15) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, angles_rad / angle));
}

std::vector<Eigen::Vector3d> TargetPlaces(bool has_spread) {
  std::vector<Eigen::Vector3d> places;
  for (int row = 0; row < 7; ++row) {
    for (int column = 0; column < 9; ++column) {
      places.emplace_back(0.82 + 0.06 * column, 10.58, 1.457 + 0.06 * row);
    }
  }
  if (!has_spread) return places;
  for (const double z : {1.137, 2.137}) {
    for (const double x : {0.36, 1.76}) places.emplace_back(x, 11.38, z);
  }
  places.emplace_back(0.26, 9.78, 1.637);
  places.emplace_back(1.86, 9.78, 1.637);
  places.emplace_back(1.06, 9.78, 0.937);
  places.emplace_back(1.06, 9.78, 2.337);
  return places;
}

}  // namespace

GeneratedRun GenerateRail(const RailScene& scene) {
  const Path path(scene);
  Draw draw(scene.seed);
  const double deg = kPi / 180.0;
  const double dt = 1.0 / scene.rate_hz;
  GeneratedRun run;
  RailSetup& setup = run.setup;
  setup.imu.rate_hz = scene.rate_hz;
  setup.imu.noise.angle_random_walk_rad = 0.2 * deg / 60.0;
  setup.imu.noise.velocity_random_walk_m_s = 30e-6 * kGravity_m_s2;
  setup.imu.gyro_bias_sigma_rad_s = 30.0 * deg / 3600.0;
  setup.imu.accel_bias_sigma_m_s2 = 1e-3 * kGravity_m_s2;
  run.gyro_bias_rad_s = draw.Normal3(setup.imu.gyro_bias_sigma_rad_s);
  run.accel_bias_m_s2 = draw.Normal3(setup.imu.accel_bias_sigma_m_s2);

  // As built, and as calibrated.
  Eigen::Matrix3d looks_ahead;
  looks_ahead << 0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0;
  const Eigen::Quaterniond camera_from_imu =
      Turn(Eigen::Vector3d(0.5, 2.0, -0.5) * deg) * Eigen::Quaterniond(looks_ahead);
  const Eigen::Vector3d camera_in_imu_m(0.15, -0.05, 0.1);
  run.camera_from_imu = camera_from_imu;
  run.camera_in_imu_m = camera_in_imu_m;
  const Eigen::Quaterniond housing_from_imu = Turn(Eigen::Vector3d(0.4, -0.3, 0.2) * deg);
  setup.tilt = TiltMounting{housing_from_imu, 0.003 * deg};
  RailCamera camera;
  camera.model = {2592, 1944, 5455.0, 5455.0, 1295.5, 971.5};
  camera.sigma_rotation_rad = scene.extrinsics_sigma_deg * deg;
  camera.sigma_position_m = scene.extrinsics_sigma_m;
  camera.camera_from_imu = Turn(draw.Normal3(camera.sigma_rotation_rad)) * camera_from_imu;
  camera.in_imu_m = camera_in_imu_m + draw.Normal3(camera.sigma_position_m);
  camera.sigma_time_offset_s = 0.005;
  setup.start.sigma_position_m = 1e-4;
  setup.start.position_world_m = path.PositionAt(0.0) + draw.Normal3(1e-4);
  setup.start.at_rest_s = scene.rest_s - 0.5;

  const auto samples = static_cast<int>(path.whole_s() * scene.rate_hz);
  const Eigen::Vector3d up_m_s2(0.0, 0.0, kGravity_m_s2);
  constexpr int kParts = 4;
  for (int i = 0; i < samples; ++i) {
    // The mean over the interval, from its parts: turn by turn and velocity by velocity.
    Eigen::Vector3d turn = Eigen::Vector3d::Zero();
    Eigen::Vector3d force = Eigen::Vector3d::Zero();
    for (int part = 0; part < kParts; ++part) {
      const double span = dt / kParts;
      const double t = i * dt + part * span;
      const Eigen::Quaterniond step = path.AttitudeAt(t).conjugate() * path.AttitudeAt(t + span);
      const Eigen::AngleAxisd axis(step);
      const double angle = axis.angle() > kPi ? axis.angle() - 2.0 * kPi : axis.angle();
      turn += angle * axis.axis();
      const double h = span / 2.0;
      const double middle = t + h;
      const Eigen::Vector3d acceleration =
          (path.PositionAt(middle + h) - 2.0 * path.PositionAt(middle) +
           path.PositionAt(middle - h)) /
          (h * h);
      force += path.AttitudeAt(middle).conjugate() * (acceleration + up_m_s2) / kParts;
    }
    const double root = std::sqrt(dt);
    ImuSample sample;
    sample.ends_at = {kBegin_ns + std::llround((i + 1) * dt * 1e9)};
    sample.interval_s = dt;
    sample.gyro_rad_s = turn / dt + run.gyro_bias_rad_s +
                        draw.Normal3(setup.imu.noise.angle_random_walk_rad / root);
    sample.accel_m_s2 =
        force + run.accel_bias_m_s2 + draw.Normal3(setup.imu.noise.velocity_random_walk_m_s / root);
    run.recording.imu.push_back(sample);
    run.truth.push_back(
        {sample.ends_at, path.PositionAt((i + 1) * dt), path.AttitudeAt((i + 1) * dt)});
    if (i % static_cast<int>(scene.rate_hz / 20.0) == 0 && i > 0) {
      // Read over the same interval.
      const Eigen::Vector3d up = housing_from_imu * force.normalized();
      TrolleyTilt tilt;
      tilt.sensed_at = sample.ends_at;
      tilt.angles.beta_rad = -std::asin(up.x()) + draw.Normal(setup.tilt->sigma_rad);
      tilt.angles.gamma_rad = std::asin(up.y()) + draw.Normal(setup.tilt->sigma_rad);
      run.recording.tilts.push_back(tilt);
    }
  }
  if (!scene.has_targets) return run;

  const std::vector<Eigen::Vector3d> places = TargetPlaces(scene.has_spread_targets);
  for (std::size_t i = 0; i < places.size(); ++i) {
    run.recording.targets.push_back({.name = "T" + std::to_string(i),
                                     .in_world_m = places[i] + draw.Normal3(scene.target_sigma_m),
                                     .sigma_m = scene.target_sigma_m,
                                     .by_mode = {}});
  }
  for (double t = 0.0; t < path.whole_s() - 0.05; t += 0.1) {
    TargetImage image{{kBegin_ns + std::llround(t * 1e9)}, {}};
    const double exposed = t + scene.image_late_s;
    const Eigen::Quaterniond world_from_imu = path.AttitudeAt(exposed);
    for (std::size_t i = 0; i < places.size(); ++i) {
      const Eigen::Vector3d in_camera =
          camera_from_imu *
          (world_from_imu.conjugate() * (places[i] - path.PositionAt(exposed)) - camera_in_imu_m);
      if (in_camera.z() < 0.1) continue;
      Eigen::Vector2d pixel(5455.0 * in_camera.x() / in_camera.z() + 1295.5,
                            5455.0 * in_camera.y() / in_camera.z() + 971.5);
      if (pixel.x() < 0.0 || pixel.y() < 0.0 || pixel.x() > 2591.0 || pixel.y() > 1943.0) continue;
      pixel += Eigen::Vector2d(draw.Normal(0.1), draw.Normal(0.1));
      if (draw.Uniform(0.0, 1.0) < scene.wrong_matches) {
        pixel += Eigen::Vector2d(draw.Uniform(-60.0, 60.0), draw.Uniform(-60.0, 60.0));
      }
      image.pixels.push_back({static_cast<int>(i), pixel});
    }
    if (!image.pixels.empty()) run.recording.images.push_back(image);
  }
  setup.camera = camera;
  return run;
}

}  // namespace tbm
