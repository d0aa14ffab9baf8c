#include "guidance/rail_vision/ground_search.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "pose/geometry/rigid3.h"

namespace tbm {
namespace {

// The attitude comes from the same samples that the filter takes: what they know of a turn is not
// to be counted twice.
constexpr double kTurnTimes = 2.0;
constexpr double kLeastTurn_rad = 1e-6;

// Attitude of the unit between the line's points; nothing before the first and after the last.
std::optional<Eigen::Quaterniond> AttitudeAt(const RailLine& line, Timestamp at) {
  const auto after = std::lower_bound(
      line.points.begin(), line.points.end(), at, [](const RailPoint& point, Timestamp when) {
        return point.at < when;
      });
  if (after == line.points.end()) return {};
  if (after->at == at) return after->world_from_imu;
  if (after == line.points.begin()) return {};
  const auto before = after - 1;
  const double part = SecondsBetween(before->at, at) / SecondsBetween(before->at, after->at);
  return before->world_from_imu.slerp(part, after->world_from_imu);
}

struct Seen {
  GroundFeatures features;
  std::optional<Eigen::Quaterniond> world_from_imu;
  bool is_readable = false;
};

Seen Look(const RailGroundCamera& camera,
          const RailLine& line,
          const RailFrames& frames,
          std::size_t frame) {
  Seen seen;
  const ImageView image = frames.load(frame);
  seen.is_readable = image.pixels != nullptr && image.width_px == camera.model.image_width_px &&
                     image.height_px == camera.model.image_height_px;
  seen.world_from_imu = AttitudeAt(line, frames.stamped_at[frame]);
  if (seen.is_readable && seen.world_from_imu) {
    seen.features = FindGroundFeatures(image, camera.model);
  }
  return seen;
}

// The unit's displacement from that of the camera, which turns about it.
GroundDisplacement DisplacementOf(const RailGroundCamera& camera,
                                  const GroundMotion& motion,
                                  const Eigen::Quaterniond& first_from_second) {
  const Eigen::Matrix3d imu_from_camera = camera.camera_from_imu.conjugate().toRotationMatrix();
  const Eigen::Matrix3d vehicle_from_imu = GroundVehicle(camera).toRotationMatrix();
  const Eigen::Matrix3d vehicle_from_camera = vehicle_from_imu * imu_from_camera;
  const Eigen::Vector3d by_lever_m = first_from_second * camera.in_imu_m - camera.in_imu_m;
  GroundDisplacement displacement;
  displacement.told_m =
      (camera.height_m * (vehicle_from_camera * motion.moved) - vehicle_from_imu * by_lever_m)
          .head<2>();
  const Eigen::Matrix3d covariance =
      vehicle_from_camera * motion.covariance * vehicle_from_camera.transpose();
  // One number for both axes: that of the worst direction.
  const Eigen::Matrix2d across = covariance.topLeftCorner<2, 2>();
  const double largest = across.selfadjointView<Eigen::Lower>().eigenvalues().maxCoeff();
  displacement.sigma_m = std::hypot(camera.height_m * std::sqrt(largest), camera.sigma_m);
  return displacement;
}

}  // namespace

std::vector<GroundStep> SearchGround(const RailSetup& setup,
                                     const RailLine& line,
                                     const RailFrames& frames,
                                     const std::function<void(const GroundStep&)>& on_step) {
  std::vector<GroundStep> steps;
  if (!setup.ground || frames.stamped_at.empty()) return steps;
  const RailGroundCamera& camera = *setup.ground;
  Seen before = Look(camera, line, frames, 0);
  for (std::size_t i = 1; i < frames.stamped_at.size(); ++i) {
    Seen now = Look(camera, line, frames, i);
    GroundStep step{frames.stamped_at[i - 1], frames.stamped_at[i], {}, {}};
    const bool is_whole =
        before.is_readable && now.is_readable && before.world_from_imu && now.world_from_imu;
    if (is_whole) {
      const Eigen::Quaterniond imu_from_camera = camera.camera_from_imu.conjugate();
      const double turn_rad = kTurnTimes * setup.imu.noise.angle_random_walk_rad *
                              std::sqrt(SecondsBetween(step.from, step.to));
      const auto motion = MeasureGroundMotion(before.features,
                                              now.features,
                                              camera.model,
                                              {*before.world_from_imu * imu_from_camera,
                                               *now.world_from_imu * imu_from_camera,
                                               std::max(turn_rad, kLeastTurn_rad)});
      if (motion) {
        step.displacement = DisplacementOf(
            camera, *motion, before.world_from_imu->conjugate() * *now.world_from_imu);
        step.displacement->from = step.from;
        step.displacement->to = step.to;
      } else {
        step.why_not = motion.error();
      }
    }
    steps.push_back(step);
    if (on_step) on_step(step);
    before = std::move(now);
  }
  return steps;
}

}  // namespace tbm
