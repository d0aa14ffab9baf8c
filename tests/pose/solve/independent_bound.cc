#include "tests/pose/solve/independent_bound.h"

#include <vector>

#include <Eigen/Dense>

namespace tbm::test {
namespace {

Eigen::Matrix3d Rotated(const Eigen::Vector3d& turn) {
  const double angle = turn.norm();
  if (angle == 0.0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
}

// Everything that the sensors see, as a function of everything that may be off.
class World {
 public:
  World(const Rig& rig, const Truth& truth) : rig_(rig), truth_(truth) {}

  // 6 pose, 2 absolute tilt, 4 intrinsics, 3 + 3 mountings, 3 per LED.
  Eigen::Index Unknowns() const { return kLeds + 3 * static_cast<Eigen::Index>(rig_.leds.size()); }

  Eigen::VectorXd PriorSigma() const {
    Eigen::VectorXd sigma(Unknowns());
    sigma.head(kIntrinsics).setConstant(-1.0);  // free
    sigma.segment<4>(kIntrinsics) = rig_.intrinsics_sigma_px;
    sigma.segment<3>(kTargetMount).setConstant(rig_.target_tilt.mounting_sigma_rad);
    sigma.segment<3>(kCameraMount).setConstant(rig_.camera_tilt.mounting_sigma_rad);
    for (std::size_t i = 0; i < rig_.leds.size(); ++i) {
      sigma.segment<3>(kLeds + 3 * static_cast<Eigen::Index>(i)).setConstant(rig_.leds[i].sigma_m);
    }
    return sigma;
  }

  Eigen::VectorXd Seen(const Eigen::VectorXd& off) const {
    Rig rig = rig_;
    rig.camera.fx_px += off[kIntrinsics];
    rig.camera.fy_px += off[kIntrinsics + 1];
    rig.camera.cx_px += off[kIntrinsics + 2];
    rig.camera.cy_px += off[kIntrinsics + 3];
    rig.target_tilt.tilt_from_body *= Rotated(off.segment<3>(kTargetMount));
    rig.camera_tilt.tilt_from_body *= Rotated(off.segment<3>(kCameraMount));
    const Rigid3 pose = Displaced(truth_.camera_from_target, off.head<6>());
    const Eigen::Vector3d sideways = truth_.up_in_camera.unitOrthogonal();
    const Eigen::Vector3d up_in_camera =
        Rotated(off[6] * sideways + off[7] * truth_.up_in_camera.cross(sideways)) *
        truth_.up_in_camera;
    const Eigen::Matrix3d rotation = pose.rotation.toRotationMatrix();

    const Eigen::Index leds = static_cast<Eigen::Index>(rig.leds.size());
    Eigen::VectorXd seen(2 * leds + 4);
    for (Eigen::Index i = 0; i < leds; ++i) {
      const Eigen::Vector3d p_led_in_target =
          rig.leds[static_cast<std::size_t>(i)].p_led_in_target + off.segment<3>(kLeds + 3 * i);
      seen.segment<2>(2 * i) =
          ExactPixel(rig.camera, rotation * p_led_in_target + pose.translation);
    }
    const Inclination target =
        ExactInclination(rig.target_tilt, rotation.transpose() * up_in_camera);
    const Inclination camera = ExactInclination(rig.camera_tilt, up_in_camera);
    seen.tail<4>() << target.beta_rad, target.gamma_rad, camera.beta_rad, camera.gamma_rad;
    return seen;
  }

 private:
  static constexpr Eigen::Index kIntrinsics = 8;
  static constexpr Eigen::Index kTargetMount = 12;
  static constexpr Eigen::Index kCameraMount = 15;
  static constexpr Eigen::Index kLeds = 18;

  const Rig& rig_;
  const Truth& truth_;
};

}  // namespace

Rigid3 Displaced(const Rigid3& pose, const PoseError& error) {
  return {Eigen::Quaterniond(Rotated(error.head<3>())) * pose.rotation,
          pose.translation + error.tail<3>()};
}

std::optional<PoseCovariance> IndependentBound(const Rig& rig,
                                               const Truth& truth,
                                               double centre_sigma_px,
                                               double tilt_sigma_rad,
                                               bool with_tilts) {
  const World world(rig, truth);
  const Eigen::VectorXd prior = world.PriorSigma();
  // Unknowns with a prior sigma of zero are known; without tilts the absolute tilt is unseen.
  std::vector<Eigen::Index> active;
  for (Eigen::Index i = 0; i < world.Unknowns(); ++i) {
    const bool is_tilt = i == 6 || i == 7 || (i >= 12 && i < 18);
    if (prior[i] != 0.0 && (with_tilts || !is_tilt)) active.push_back(i);
  }
  const auto unknowns = static_cast<Eigen::Index>(active.size());
  const auto leds = static_cast<Eigen::Index>(rig.leds.size());
  const Eigen::Index rows = 2 * leds + (with_tilts ? 4 : 0);
  Eigen::VectorXd weight(rows);
  weight.head(2 * leds).setConstant(1.0 /
                                    (centre_sigma_px * centre_sigma_px +
                                     rig.calibration_residual_px * rig.calibration_residual_px));
  if (with_tilts) weight.tail<4>().setConstant(1.0 / (tilt_sigma_rad * tilt_sigma_rad));

  Eigen::MatrixXd by_unknown(rows, unknowns);
  Eigen::VectorXd prior_information = Eigen::VectorXd::Zero(unknowns);
  for (Eigen::Index column = 0; column < unknowns; ++column) {
    const Eigen::Index unknown = active[static_cast<std::size_t>(column)];
    const bool is_pixel = unknown >= 8 && unknown < 12;
    const double step = is_pixel ? 1e-2 : 1e-6;
    Eigen::VectorXd off = Eigen::VectorXd::Zero(world.Unknowns());
    off[unknown] = step;
    by_unknown.col(column) = (world.Seen(off) - world.Seen(-off)).head(rows) / (2.0 * step);
    if (prior[unknown] > 0.0) prior_information[column] = 1.0 / (prior[unknown] * prior[unknown]);
  }
  Eigen::MatrixXd information = by_unknown.transpose() * weight.asDiagonal() * by_unknown;
  information.diagonal() += prior_information;
  // Scaled to a unit diagonal: metres, radians and pixels have no common size.
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  const Eigen::FullPivLU<Eigen::MatrixXd> lu(scaled);
  if (!lu.isInvertible()) return std::nullopt;
  const Eigen::MatrixXd covariance = scale.asDiagonal() * lu.inverse() * scale.asDiagonal();
  return PoseCovariance(covariance.topLeftCorner<6, 6>());
}

}  // namespace tbm::test
