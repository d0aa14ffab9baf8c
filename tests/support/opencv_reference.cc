#include "tests/support/opencv_reference.h"

#include <cmath>
#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

namespace tbm::test {
namespace {

struct CvProblem {
  std::vector<cv::Point3d> object_m;
  std::vector<cv::Point2d> image_px;
  cv::Matx33d camera;
  cv::Vec<double, 5> distortion;
};

CvProblem ToCv(const PoseProblem& problem) {
  const CameraModel& c = problem.rig->camera;
  CvProblem out;
  out.camera = {c.fx_px, 0.0, c.cx_px, 0.0, c.fy_px, c.cy_px, 0.0, 0.0, 1.0};
  out.distortion = {c.k1, c.k2, c.p1, c.p2, c.k3};
  for (const LedObservation& led : problem.leds) {
    const Eigen::Vector3d& p =
        problem.rig->leds[static_cast<std::size_t>(led.led_index)].p_led_in_target;
    out.object_m.emplace_back(p.x(), p.y(), p.z());
    out.image_px.emplace_back(led.pixel_px.x(), led.pixel_px.y());
  }
  return out;
}

Rigid3 ToRigid3(const cv::Vec3d& turn, const cv::Vec3d& shift) {
  cv::Matx33d r;
  cv::Rodrigues(turn, r);
  Eigen::Matrix3d rotation;
  rotation << r(0, 0), r(0, 1), r(0, 2), r(1, 0), r(1, 1), r(1, 2), r(2, 0), r(2, 1), r(2, 2);
  return {Eigen::Quaterniond(rotation).normalized(), {shift[0], shift[1], shift[2]}};
}

cv::Vec3d UpInBody(const TiltMount& mount, const Inclination& tilt) {
  const double x = -std::sin(tilt.beta_rad);
  const double y = std::sin(tilt.gamma_rad);
  const Eigen::Vector3d up =
      mount.tilt_from_body.transpose() * Eigen::Vector3d(x, y, std::sqrt(1.0 - x * x - y * y));
  return {up.x(), up.y(), up.z()};
}

// R u_T - u_C along two directions across u_C.
cv::Vec2d TiltResidual(const cv::Vec3d& turn,
                       const cv::Vec3d& up_target,
                       const cv::Vec3d& up_camera) {
  cv::Matx33d r;
  cv::Rodrigues(turn, r);
  const cv::Vec3d across = cv::normalize(up_camera.cross(cv::Vec3d(0.0, 0.0, 1.0)));
  const cv::Vec3d along = up_camera.cross(across);
  const cv::Vec3d difference = r * up_target - up_camera;
  return {across.dot(difference), along.dot(difference)};
}

}  // namespace

std::optional<Rigid3> OpenCvPose(const PoseProblem& problem) {
  const CvProblem cv_problem = ToCv(problem);
  cv::Vec3d turn;
  cv::Vec3d shift;
  if (!cv::solvePnP(cv_problem.object_m,
                    cv_problem.image_px,
                    cv_problem.camera,
                    cv_problem.distortion,
                    turn,
                    shift,
                    false,
                    cv::SOLVEPNP_SQPNP)) {
    return std::nullopt;
  }
  if (!cv::solvePnP(cv_problem.object_m,
                    cv_problem.image_px,
                    cv_problem.camera,
                    cv_problem.distortion,
                    turn,
                    shift,
                    true,
                    cv::SOLVEPNP_ITERATIVE)) {
    return std::nullopt;
  }
  return ToRigid3(turn, shift);
}

std::optional<Rigid3> OpenCvWeightedPose(const PoseProblem& problem) {
  const CvProblem cv_problem = ToCv(problem);
  const Rig& rig = *problem.rig;
  cv::Vec3d turn;
  cv::Vec3d shift;
  if (problem.leds.size() < 4 || !problem.target_tilt || !problem.camera_tilt ||
      !cv::solvePnP(cv_problem.object_m,
                    cv_problem.image_px,
                    cv_problem.camera,
                    cv_problem.distortion,
                    turn,
                    shift,
                    false,
                    cv::SOLVEPNP_SQPNP)) {
    return std::nullopt;
  }
  const cv::Vec3d up_target = UpInBody(rig.target_tilt, problem.target_tilt->inclination);
  const cv::Vec3d up_camera = UpInBody(rig.camera_tilt, problem.camera_tilt->inclination);
  const double tilt_sigma = std::sqrt(std::pow(problem.target_tilt->sigma_rad, 2) +
                                      std::pow(problem.camera_tilt->sigma_rad, 2) +
                                      std::pow(rig.target_tilt.mounting_sigma_rad, 2) +
                                      std::pow(rig.camera_tilt.mounting_sigma_rad, 2));
  const int led_rows = static_cast<int>(2 * problem.leds.size());
  for (int iteration = 0; iteration < 20; ++iteration) {
    std::vector<cv::Point2d> projected;
    cv::Mat by_all;
    cv::projectPoints(cv_problem.object_m,
                      turn,
                      shift,
                      cv_problem.camera,
                      cv_problem.distortion,
                      projected,
                      by_all);
    cv::Mat jacobian(led_rows + 2, 6, CV_64F);
    cv::Mat residual(led_rows + 2, 1, CV_64F);
    for (int row = 0; row < led_rows; ++row) {
      const auto i = static_cast<std::size_t>(row / 2);
      const LedObservation& led = problem.leds[i];
      const double led_sigma_px =
          rig.camera.fx_px / shift[2] * rig.leds[static_cast<std::size_t>(led.led_index)].sigma_m;
      const double sigma = std::sqrt(led.sigma_px * led.sigma_px + led_sigma_px * led_sigma_px +
                                     rig.calibration_residual_px * rig.calibration_residual_px);
      const double difference = row % 2 == 0 ? cv_problem.image_px[i].x - projected[i].x
                                             : cv_problem.image_px[i].y - projected[i].y;
      residual.at<double>(row) = difference / sigma;
      for (int k = 0; k < 6; ++k) jacobian.at<double>(row, k) = by_all.at<double>(row, k) / sigma;
    }
    const cv::Vec2d tilt = TiltResidual(turn, up_target, up_camera);
    for (int k = 0; k < 6; ++k) {
      cv::Vec2d slope(0.0, 0.0);
      if (k < 3) {
        cv::Vec3d ahead = turn;
        cv::Vec3d behind = turn;
        ahead[k] += 1e-6;
        behind[k] -= 1e-6;
        slope = (TiltResidual(ahead, up_target, up_camera) -
                 TiltResidual(behind, up_target, up_camera)) *
                (1.0 / 2e-6);
      }
      jacobian.at<double>(led_rows, k) = slope[0] / tilt_sigma;
      jacobian.at<double>(led_rows + 1, k) = slope[1] / tilt_sigma;
    }
    residual.at<double>(led_rows) = -tilt[0] / tilt_sigma;
    residual.at<double>(led_rows + 1) = -tilt[1] / tilt_sigma;
    cv::Mat step;
    if (!cv::solve(jacobian, residual, step, cv::DECOMP_QR)) return std::nullopt;
    for (int k = 0; k < 3; ++k) {
      turn[k] += step.at<double>(k);
      shift[k] += step.at<double>(3 + k);
    }
    if (cv::norm(step) < 1e-12) break;
  }
  return ToRigid3(turn, shift);
}

}  // namespace tbm::test
