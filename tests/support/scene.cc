#include "tests/support/scene.h"

#include <cmath>

#include "pose/base/angle.h"

namespace tbm::test {
namespace {

Eigen::Matrix3d Turn(double x_deg, double y_deg, double z_deg) {
  return (Eigen::AngleAxisd(DegToRad(z_deg), Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(DegToRad(y_deg), Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(DegToRad(x_deg), Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

}  // namespace

Rig PublishedRig() {
  Rig rig;
  rig.name = "published";
  rig.camera.image_width_px = 1280;
  rig.camera.image_height_px = 1024;
  rig.camera.fx_px = rig.camera.fy_px = 16.0 / 0.0053;
  rig.camera.cx_px = 639.5;
  rig.camera.cy_px = 511.5;
  const Eigen::Vector3d p_in_target_mm[5] = {
      {-250, 0, 100}, {250, 0, 100}, {0, 250, 0}, {0, -250, 0}, {80, 80, 250}};
  for (int i = 0; i < 5; ++i) {
    rig.leds.push_back({"P" + std::to_string(i + 1), 1e-3 * p_in_target_mm[i], 0.0});
  }
  rig.target_tilt.tilt_from_body << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  rig.camera_tilt.tilt_from_body << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  rig.target_tilt.sigma_rad = rig.camera_tilt.sigma_rad = DegToRad(0.005);
  rig.points.push_back({"shield_head", {0.0, 0.0, -1.6}, 0.0});
  return rig;
}

Rig FieldRig() {
  Rig rig = PublishedRig();
  rig.name = "field";
  rig.camera.fx_px = 3021.3;
  rig.camera.fy_px = 3018.9;
  rig.camera.cx_px = 644.7;
  rig.camera.cy_px = 506.2;
  rig.camera.k1 = -0.093;
  rig.camera.k2 = 0.141;
  rig.camera.p1 = 2.1e-4;
  rig.camera.p2 = -1.6e-4;
  rig.target_tilt.tilt_from_body = Turn(2.0, -3.0, 5.0) * rig.target_tilt.tilt_from_body;
  rig.camera_tilt.tilt_from_body = Turn(-4.0, 1.5, -2.5) * rig.camera_tilt.tilt_from_body;
  return rig;
}

Truth DrawTruth(Random& random, const TruthRange& range) {
  const auto angle = [&](double limit_rad) { return random.Uniform(-limit_rad, limit_rad); };
  Truth truth;
  const double a = range.relative_angle_rad;
  // The target faces the camera: its z axis points back, its y axis up, hence half a turn about x.
  const Eigen::Quaterniond facing(0.0, 1.0, 0.0, 0.0);
  truth.camera_from_target.rotation =
      (Eigen::AngleAxisd(angle(a), Eigen::Vector3d::UnitZ()) *
       Eigen::AngleAxisd(angle(a), Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(angle(a), Eigen::Vector3d::UnitX()) * facing)
          .normalized();
  truth.camera_from_target.translation = {
      random.Uniform(-range.lateral_m, range.lateral_m),
      random.Uniform(-range.lateral_m, range.lateral_m),
      random.Uniform(range.distance_min_m, range.distance_max_m)};
  truth.up_in_camera = Eigen::AngleAxisd(angle(range.camera_tilt_rad), Eigen::Vector3d::UnitZ()) *
                       Eigen::AngleAxisd(angle(range.camera_tilt_rad), Eigen::Vector3d::UnitX()) *
                       -Eigen::Vector3d::UnitY();
  return truth;
}

Eigen::Vector2d ExactPixel(const CameraModel& c, const Eigen::Vector3d& p) {
  const double x = p.x() / p.z();
  const double y = p.y() / p.z();
  const double r2 = x * x + y * y;
  const double radial = 1.0 + c.k1 * r2 + c.k2 * r2 * r2 + c.k3 * r2 * r2 * r2;
  return {c.fx_px * (x * radial + 2.0 * c.p1 * x * y + c.p2 * (r2 + 2.0 * x * x)) + c.cx_px,
          c.fy_px * (y * radial + c.p1 * (r2 + 2.0 * y * y) + 2.0 * c.p2 * x * y) + c.cy_px};
}

Inclination ExactInclination(const TiltMount& mount, const Eigen::Vector3d& up_in_body) {
  const Eigen::Vector3d up = mount.tilt_from_body * up_in_body;
  return {std::asin(-up.x()), std::asin(up.y())};
}

PoseProblem ExactProblem(const Rig& rig, const Truth& truth) {
  PoseProblem problem;
  problem.rig = &rig;
  for (std::size_t i = 0; i < rig.leds.size(); ++i) {
    const Eigen::Vector3d p_in_camera =
        truth.camera_from_target.rotation.toRotationMatrix() * rig.leds[i].p_led_in_target +
        truth.camera_from_target.translation;
    problem.leds.push_back({static_cast<int>(i), ExactPixel(rig.camera, p_in_camera), 0.0});
  }
  const Eigen::Vector3d up_in_target =
      truth.camera_from_target.rotation.toRotationMatrix().transpose() * truth.up_in_camera;
  problem.target_tilt = TiltObservation{ExactInclination(rig.target_tilt, up_in_target), 0.0};
  problem.camera_tilt = TiltObservation{ExactInclination(rig.camera_tilt, truth.up_in_camera), 0.0};
  return problem;
}

PoseProblem NoisyProblem(const Rig& rig,
                         const Truth& truth,
                         double centre_sigma_px,
                         double tilt_sigma_rad,
                         Random& random) {
  PoseProblem problem = ExactProblem(rig, truth);
  for (LedObservation& led : problem.leds) {
    led.pixel_px += random.Normal2(centre_sigma_px);
    led.sigma_px = centre_sigma_px;
  }
  for (auto* tilt : {&problem.target_tilt, &problem.camera_tilt}) {
    (*tilt)->inclination.beta_rad += random.Normal(tilt_sigma_rad);
    (*tilt)->inclination.gamma_rad += random.Normal(tilt_sigma_rad);
    (*tilt)->sigma_rad = tilt_sigma_rad;
  }
  return problem;
}

}  // namespace tbm::test
