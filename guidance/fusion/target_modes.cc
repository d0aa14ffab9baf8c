#include "guidance/fusion/target_modes.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "pose/base/angle.h"

namespace tbm {
namespace {

constexpr std::size_t kMostViews = 14;
constexpr std::size_t kLeastTargets = 4;
// What gyros and inclinometer know of the attitude between images, at worst and at best: where they
// know much, other combinations matter than where the targets alone tell it.
const std::array<double, 2> kAttitudeSigmas_rad = {DegToRad(0.05), DegToRad(0.001)};
// An attitude error is worth what it does to a target at this distance.
constexpr double kReach_m = 2.5;
// Combinations that move the camera by less are left out.
constexpr double kLeastEffect_m = 2e-6;

// How the camera's place (3 rows, m) and attitude (3 rows, times kReach_m) answer to the
// coordinates of all targets, each in units of its sigma.
Eigen::MatrixXd Answer(const TargetView& view,
                       const CameraModel& camera,
                       double residual_px,
                       double attitude_sigma_rad,
                       const std::vector<SurveyedTarget>& targets) {
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::MatrixXd pull = Eigen::MatrixXd::Zero(6, static_cast<Eigen::Index>(3 * targets.size()));
  const double weight = 1.0 / (residual_px * residual_px);
  for (const int target : view.targets) {
    const SurveyedTarget& one = targets[static_cast<std::size_t>(target)];
    const Eigen::Vector3d in_camera = view.camera_from_world * one.in_world_m;
    const auto projection = Project(camera, in_camera);
    if (!projection) continue;
    Eigen::Matrix<double, 2, 6> by_pose;
    by_pose.leftCols<3>() = projection->by_point_px_per_m;
    by_pose.rightCols<3>() = -projection->by_point_px_per_m * Skew(in_camera) / kReach_m;
    const Eigen::Matrix<double, 2, 3> by_target =
        projection->by_point_px_per_m * view.camera_from_world.rotation.toRotationMatrix();
    information += weight * by_pose.transpose() * by_pose;
    pull.middleCols<3>(3 * target) = weight * by_pose.transpose() * by_target * one.sigma_m;
  }
  const double attitude = attitude_sigma_rad * kReach_m;
  information.bottomRightCorner<3, 3>() += Eigen::Matrix3d::Identity() / (attitude * attitude);
  return information.ldlt().solve(pull);
}

}  // namespace

TargetModes FindTargetModes(std::span<const TargetView> views,
                            const CameraModel& camera,
                            double residual_px,
                            int most,
                            std::vector<SurveyedTarget>* targets) {
  std::vector<const TargetView*> rich;
  for (const TargetView& view : views) {
    if (view.targets.size() >= kLeastTargets) rich.push_back(&view);
  }
  for (SurveyedTarget& target : *targets) target.by_mode.resize(3, 0);
  if (rich.empty()) return {};

  const std::size_t count = std::min(rich.size(), kMostViews);
  const auto kEach = static_cast<Eigen::Index>(6 * kAttitudeSigmas_rad.size());
  Eigen::MatrixXd answers(kEach * static_cast<Eigen::Index>(count),
                          static_cast<Eigen::Index>(3 * targets->size()));
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t pick = count == 1 ? 0 : i * (rich.size() - 1) / (count - 1);
    for (std::size_t k = 0; k < kAttitudeSigmas_rad.size(); ++k) {
      answers.middleRows<6>(kEach * static_cast<Eigen::Index>(i) +
                            6 * static_cast<Eigen::Index>(k)) =
          Answer(*rich[pick], camera, residual_px, kAttitudeSigmas_rad[k], *targets);
    }
  }
  // Principal axes of what the views see: largest last.
  const Eigen::MatrixXd gram = answers * answers.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(gram);
  const Eigen::Index rows = gram.rows();
  const double per_view = 1.0 / static_cast<double>(count);
  TargetModes modes;
  double left = 0.0;
  for (Eigen::Index i = 0; i < rows; ++i) {
    const double squared = std::max(axes.eigenvalues()[rows - 1 - i], 0.0);
    if (modes.count == i && i < most && squared * per_view > kLeastEffect_m * kLeastEffect_m) {
      ++modes.count;
    } else {
      left += squared * per_view;
    }
  }
  modes.left_out_m = std::sqrt(left);
  for (std::size_t t = 0; t < targets->size(); ++t) {
    SurveyedTarget& target = (*targets)[t];
    target.by_mode.resize(3, modes.count);
    for (int k = 0; k < modes.count; ++k) {
      const Eigen::Index axis = rows - 1 - k;
      const double size = std::sqrt(axes.eigenvalues()[axis]);
      const Eigen::VectorXd direction =
          answers.middleCols<3>(static_cast<Eigen::Index>(3 * t)).transpose() *
          axes.eigenvectors().col(axis) / size;
      target.by_mode.col(k) = target.sigma_m * direction;
    }
  }
  return modes;
}

}  // namespace tbm
