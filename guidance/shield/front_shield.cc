#include "guidance/shield/front_shield.h"

#include <array>
#include <cmath>

#include <Eigen/LU>

#include "pose/solve/rows.h"

namespace tbm {
namespace {

using Matrix62 = Eigen::Matrix<double, 6, 2>;

// Derivative of a product's error by the error of one factor, with everything before it and what
// follows: a turn is seen from the outermost frame, and swings all that follows.
PoseCovariance ByFactor(const Eigen::Matrix3d& before,
                        const Rigid3& factor,
                        const Eigen::Vector3d& translation_after) {
  PoseCovariance by = PoseCovariance::Zero();
  by.block<3, 3>(0, 0) = by.block<3, 3>(3, 3) = before;
  by.block<3, 3>(3, 0) = -before * Skew(factor.rotation * translation_after);
  return by;
}

// (turn, shift) of the relative pose by an error of the camera's up vector along the basis B: the
// maximum likelihood's answer to its two tilt rows, covariance * rows^T * weight.
Matrix62 RelativeByUp(const PoseCovariance& covariance, const TiltConstraint::Rows& rows) {
  return covariance.leftCols<3>() * rows.by_turn.transpose() * rows.covariance.inverse();
}

}  // namespace

std::optional<UpFix> UpOfRearShield(const Rig& rig,
                                    const MachineGeometry& geometry,
                                    const Inclination& camera_tilt,
                                    double sigma_rad) {
  const auto up_in_tilt = UpInTilt(camera_tilt);
  if (!up_in_tilt) return {};
  const UncertainRigid3& mounted = geometry.rear_shield_from_camera;
  const double mounting_rad = rig.camera_tilt.mounting_sigma_rad;
  const double place_rad2 = mounted.covariance.topLeftCorner<3, 3>().trace() / 3.0;
  return UpFix{
      mounted.b_from_a.rotation * (rig.camera_tilt.tilt_from_body.transpose() * *up_in_tilt),
      std::sqrt(sigma_rad * sigma_rad + mounting_rad * mounting_rad + place_rad2)};
}

UncertainRigid3 FrontShieldInSite(const RearShieldFix& rear,
                                  const Rig& rig,
                                  const MachineGeometry& geometry,
                                  const RelativeFix& relative) {
  const Rigid3& site_from_rear = rear.site_from_rear_shield;
  const Rigid3& rear_from_camera = geometry.rear_shield_from_camera.b_from_a;
  const Rigid3& camera_from_target = relative.camera_from_target.b_from_a;
  const UncertainRigid3 target_from_front = Inverse(geometry.front_shield_from_target);
  const Rigid3 camera_from_front = camera_from_target * target_from_front.b_from_a;
  const Rigid3 rear_from_front = rear_from_camera * camera_from_front;

  const Eigen::Matrix3d in_rear = site_from_rear.rotation.toRotationMatrix();
  const Eigen::Matrix3d in_camera = in_rear * rear_from_camera.rotation.toRotationMatrix();
  const Eigen::Matrix3d in_target = in_camera * camera_from_target.rotation.toRotationMatrix();
  const PoseCovariance by_rear =
      ByFactor(Eigen::Matrix3d::Identity(), site_from_rear, rear_from_front.translation);
  const PoseCovariance by_mounted =
      ByFactor(in_rear, rear_from_camera, camera_from_front.translation);
  const PoseCovariance by_relative =
      ByFactor(in_camera, camera_from_target, target_from_front.b_from_a.translation);
  const PoseCovariance by_board =
      ByFactor(in_target, target_from_front.b_from_a, Eigen::Vector3d::Zero());

  const PoseCovariance& mounted_covariance = geometry.rear_shield_from_camera.covariance;
  UncertainRigid3 front{site_from_rear * rear_from_front, PoseCovariance::Zero()};
  front.covariance =
      by_rear * rear.covariance * by_rear.transpose() +
      by_mounted * mounted_covariance * by_mounted.transpose() +
      by_relative * relative.camera_from_target.covariance * by_relative.transpose() +
      by_board * target_from_front.covariance * by_board.transpose();
  const auto add_both_ways = [&front](const PoseCovariance& mixed) {
    front.covariance += mixed + mixed.transpose();
  };

  // The camera's turn w in the rear shield: the up vector that was believed is -w x up off.
  const Eigen::Vector3d up_in_rear = in_rear.row(2).transpose();
  Eigen::Matrix<double, 2, 6> up_by_mounted = Eigen::Matrix<double, 2, 6>::Zero();
  up_by_mounted.leftCols<3>() = (in_rear * Skew(up_in_rear)).topRows<2>();
  // `by_up` is how the estimate moves, the covariance is about truth minus estimate: a minus.
  add_both_ways(-by_rear * rear.by_up * up_by_mounted * mounted_covariance *
                by_mounted.transpose());

  if (relative.target_tilt && relative.camera_tilt) {
    PoseProblem tilts_alone;
    tilts_alone.rig = &rig;
    tilts_alone.target_tilt = relative.target_tilt;
    tilts_alone.camera_tilt = relative.camera_tilt;
    const auto constraint = TiltConstraint::From(tilts_alone);
    if (constraint) {
      const TiltConstraint::Rows rows =
          constraint->At(camera_from_target.rotation.toRotationMatrix());
      const Matrix62 relative_by_up = RelativeByUp(relative.camera_from_target.covariance, rows);
      const Eigen::Matrix2d up_by_basis = (in_camera * constraint->basis).topRows<2>();
      // The reading's own noise is another one at another time; the mounting is always the same.
      const double mounting_rad = rig.camera_tilt.mounting_sigma_rad;
      add_both_ways(mounting_rad * mounting_rad * by_rear * rear.by_up * up_by_basis *
                    relative_by_up.transpose() * by_relative.transpose());
    }
  }
  return front;
}

}  // namespace tbm
