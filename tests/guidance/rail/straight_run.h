#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <string_view>
#include <vector>

#include "guidance/rail_study/rail_scene.h"
#include "pose/base/angle.h"
#include "pose/geometry/rigid3.h"
#include "tests/support/random.h"

namespace tbm::test {

// A trolley on a straight level rail along the world's x: rest, a smooth start, an even run, a
// smooth stop, rest. It looks ahead at targets that stand on the walls, left and right in turn.
struct StraightScene {
  std::string_view stream;
  std::uint64_t draw = 0;
  double rest_s = 6.0;
  double speed_m_s = 1.0;
  double even_s = 20.0;
  double end_rest_s = 3.0;
  bool is_push_even = false;      // starts and stops with one force: as quiet as rest
  double cant_deg = 0.0;          // of the rail, all along
  double sway_deg = 0.0;          // how far it yaws, nods and rolls on its way
  double target_spacing_m = 0.0;  // 0: no targets, and the heading is given
  std::size_t most_seen = 3;      // the nearest, in one image
  double target_sigma_m = 5e-4;
};

class StraightPath {
 public:
  explicit StraightPath(const StraightScene& scene) : scene_(scene) {}

  double whole_s() const {
    return scene_.rest_s + 2.0 * kRamp_s + scene_.even_s + scene_.end_rest_s;
  }
  double length_m() const { return scene_.speed_m_s * (kRamp_s + scene_.even_s); }

  double WayAt(double t) const {
    const double u = t - scene_.rest_s;
    const double even_m = 0.5 * scene_.speed_m_s * kRamp_s;
    if (u <= kRamp_s) return Ramp(std::max(u, 0.0));
    if (u <= kRamp_s + scene_.even_s) return even_m + scene_.speed_m_s * (u - kRamp_s);
    return length_m() - Ramp(std::max(2.0 * kRamp_s + scene_.even_s - u, 0.0));
  }
  double SpeedAt(double t) const {
    const double u = t - scene_.rest_s;
    const double end_s = 2.0 * kRamp_s + scene_.even_s;
    const double into_s = std::clamp(std::min(u, end_s - u), 0.0, kRamp_s);
    if (scene_.is_push_even) return scene_.speed_m_s * into_s / kRamp_s;
    return 0.5 * scene_.speed_m_s * (1.0 - std::cos(std::numbers::pi * into_s / kRamp_s));
  }
  Eigen::Vector3d PositionAt(double t) const { return {WayAt(t), 0.0, 0.0}; }
  Eigen::Quaterniond AttitudeAt(double t) const {
    const double sway = DegToRad(scene_.sway_deg);
    const double phase = 2.0 * std::numbers::pi * WayAt(t) / 4.0;
    return ExpRotation({0.0, 0.0, sway * std::sin(phase)}) *
           ExpRotation({0.0, sway * std::sin(0.7 * phase), 0.0}) *
           ExpRotation({DegToRad(scene_.cant_deg) + sway * std::sin(1.3 * phase), 0.0, 0.0});
  }

 private:
  static constexpr double kRamp_s = 2.0;

  double Ramp(double u) const {
    const double pi = std::numbers::pi;
    if (scene_.is_push_even) return 0.5 * scene_.speed_m_s * u * u / kRamp_s;
    return 0.5 * scene_.speed_m_s * (u - kRamp_s / pi * std::sin(pi * u / kRamp_s));
  }

  const StraightScene& scene_;
};

inline constexpr double kStraightRate_hz = 100.0;
inline constexpr std::int64_t kStraightBegin_ns = 1'790'000'000'000'000'000;

inline RailSetup StraightSetup(const StraightScene& scene) {
  RailSetup setup;
  setup.imu.rate_hz = kStraightRate_hz;
  setup.imu.noise.angle_random_walk_rad = DegToRad(0.2) / 60.0;
  setup.imu.noise.velocity_random_walk_m_s = 30e-6 * setup.gravity_m_s2;
  setup.imu.gyro_bias_sigma_rad_s = DegToRad(30.0) / 3600.0;
  setup.imu.accel_bias_sigma_m_s2 = 1e-3 * setup.gravity_m_s2;
  setup.tilt = TiltMounting{ExpRotation({0.007, -0.005, 0.003}), DegToRad(0.003)};
  setup.start.sigma_position_m = 1e-4;
  setup.start.at_rest_s = scene.rest_s - 0.5;
  setup.start.heading_rad = 0.0;
  setup.start.sigma_heading_rad = DegToRad(0.05);
  if (scene.target_spacing_m <= 0.0) return setup;
  Eigen::Matrix3d looks_ahead;
  looks_ahead << 0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0;
  RailCamera camera;
  camera.model = {2592, 1944, 2000.0, 2000.0, 1295.5, 971.5};
  camera.camera_from_imu = Eigen::Quaterniond(looks_ahead);
  camera.in_imu_m = {0.15, -0.05, 0.1};
  camera.sigma_rotation_rad = DegToRad(0.005);
  camera.sigma_position_m = 1e-4;
  camera.sigma_time_offset_s = 1e-3;
  setup.camera = camera;
  return setup;
}

inline void AddStraightSamples(const StraightPath& path, Random* random, GeneratedRun* run) {
  const RailSetup& setup = run->setup;
  const double dt = 1.0 / kStraightRate_hz;
  const double root = std::sqrt(dt);
  const Eigen::Vector3d up_m_s2(0.0, 0.0, setup.gravity_m_s2);
  const int samples = static_cast<int>(path.whole_s() * kStraightRate_hz);
  for (int i = 0; i < samples; ++i) {
    const double t = i * dt;
    const Eigen::Vector3d accel_m_s2((path.SpeedAt(t + dt) - path.SpeedAt(t)) / dt, 0.0, 0.0);
    const Eigen::Vector3d turn_rad =
        LogRotation(path.AttitudeAt(t).conjugate() * path.AttitudeAt(t + dt));
    const Eigen::Vector3d force_m_s2 =
        path.AttitudeAt(t + 0.5 * dt).conjugate() * (accel_m_s2 + up_m_s2);
    const Timestamp ends_at{kStraightBegin_ns + std::llround((i + 1) * dt * 1e9)};
    run->recording.imu.push_back(
        {ends_at,
         dt,
         turn_rad / dt + run->gyro_bias_rad_s +
             random->Normal3(setup.imu.noise.angle_random_walk_rad / root),
         force_m_s2 + run->accel_bias_m_s2 +
             random->Normal3(setup.imu.noise.velocity_random_walk_m_s / root)});
    run->truth.push_back({ends_at, path.PositionAt(t + dt), path.AttitudeAt(t + dt)});
    if (i % 10 != 0) continue;
    const Eigen::Vector3d up = setup.tilt->housing_from_imu * force_m_s2.normalized();
    run->recording.tilts.push_back({ends_at,
                                    {-std::asin(up.x()) + random->Normal(setup.tilt->sigma_rad),
                                     std::asin(up.y()) + random->Normal(setup.tilt->sigma_rad)}});
  }
}

inline void AddStraightImages(const StraightScene& scene,
                              const StraightPath& path,
                              Random* random,
                              GeneratedRun* run) {
  constexpr double kReach_m = 15.0;
  const RailCamera& camera = *run->setup.camera;
  std::vector<Eigen::Vector3d> places;
  for (double x = 6.0; x < path.length_m() + kReach_m; x += scene.target_spacing_m) {
    const int number = static_cast<int>(places.size());
    places.emplace_back(x, number % 2 == 0 ? 1.8 : -1.8, 0.4 + 0.5 * (number % 3));
    run->recording.targets.push_back(
        {.name = "W" + std::to_string(number),
         .in_world_m = places.back() + random->Normal3(scene.target_sigma_m),
         .sigma_m = scene.target_sigma_m,
         .by_mode = {}});
  }
  const double offset_s = random->Normal(camera.sigma_time_offset_s);
  for (double t = 0.1; t < path.whole_s() - 0.1; t += 0.2) {
    TargetImage image{{kStraightBegin_ns + std::llround(t * 1e9)}, {}};
    const double exposed = t - offset_s;
    for (std::size_t i = 0; i < places.size() && image.pixels.size() < scene.most_seen; ++i) {
      const Eigen::Vector3d in_camera_m =
          run->camera_from_imu *
          (path.AttitudeAt(exposed).conjugate() * (places[i] - path.PositionAt(exposed)) -
           run->camera_in_imu_m);
      if (in_camera_m.z() < 1.0 || in_camera_m.z() > kReach_m) continue;
      const Eigen::Vector2d pixel_px = Project(camera.model, in_camera_m)->pixel_px;
      if (pixel_px.x() < 0.0 || pixel_px.y() < 0.0 || pixel_px.x() > 2591.0 ||
          pixel_px.y() > 1943.0) {
        continue;
      }
      image.pixels.push_back({static_cast<int>(i), pixel_px + random->Normal2(0.1)});
    }
    if (!image.pixels.empty()) run->recording.images.push_back(image);
  }
}

inline GeneratedRun GenerateStraight(const StraightScene& scene) {
  Random random(scene.stream, scene.draw);
  const StraightPath path(scene);
  GeneratedRun run;
  run.setup = StraightSetup(scene);
  RailSetup& setup = run.setup;
  run.gyro_bias_rad_s = random.Normal3(setup.imu.gyro_bias_sigma_rad_s);
  run.accel_bias_m_s2 = random.Normal3(setup.imu.accel_bias_sigma_m_s2);
  setup.start.position_world_m = path.PositionAt(0.0) + random.Normal3(1e-4);
  setup.start.heading_rad = random.Normal(setup.start.sigma_heading_rad);
  AddStraightSamples(path, &random, &run);
  if (!setup.camera) return run;
  RailCamera& camera = *setup.camera;
  run.camera_from_imu =
      ExpRotation(random.Normal3(camera.sigma_rotation_rad)) * camera.camera_from_imu;
  run.camera_in_imu_m = camera.in_imu_m + random.Normal3(camera.sigma_position_m);
  AddStraightImages(scene, path, &random, &run);
  return run;
}

}  // namespace tbm::test
