#include "guidance/rail_study/paper_line.h"

#include <cmath>

#include "guidance/fusion/fusion_filter.h"

namespace tbm {
namespace {

constexpr double kStartAttitude_rad = 2e-3;
constexpr double kStartHeading_rad = 5e-3;
constexpr double kStartVelocity_m_s = 1e-3;
constexpr double kLeastSigma = 1e-9;

FusionMatrix StartCovariance(const RailSetup& setup) {
  FusionVector sigma = FusionVector::Zero(FusionLayout::kCore);
  const RailImu& imu = setup.imu;
  sigma.segment<3>(FusionLayout::kPosition).setConstant(setup.start.sigma_position_m);
  sigma.segment<3>(FusionLayout::kVelocity).setConstant(kStartVelocity_m_s);
  sigma.segment<3>(FusionLayout::kAttitude) << kStartAttitude_rad, kStartAttitude_rad,
      kStartHeading_rad;
  // The mean over the rest at the start.
  sigma.segment<3>(FusionLayout::kGyroBias)
      .setConstant(imu.noise.angle_random_walk_rad / std::sqrt(setup.start.at_rest_s));
  sigma.segment<3>(FusionLayout::kAccelBias).setConstant(imu.accel_bias_sigma_m_s2);
  return sigma.cwiseMax(kLeastSigma).cwiseAbs2().asDiagonal();
}

RailPoint PointOf(const FusionFilter& filter, double distance_m) {
  return {.at = filter.now(),
          .distance_m = distance_m,
          .position_world_m = filter.state().motion.position_world_m,
          .world_from_imu = filter.state().motion.world_from_imu,
          .sigma_world_m =
              filter.covariance().diagonal().segment<3>(FusionLayout::kPosition).cwiseSqrt(),
          .status = RailStatus::kOpen};
}

}  // namespace

Result<RailLine, RailStartFailure> SolvePaperLine(const RailSetup& setup,
                                                  const RailRecording& recording) {
  const auto rest = FindRestSignature(setup, recording);
  if (!rest) return Failure{rest.error()};
  const auto attitude = FindStartAttitude(setup, recording, *rest);
  if (!attitude) return Failure{attitude.error()};

  FusionState state;
  state.motion.position_world_m = setup.start.position_world_m;
  state.motion.world_from_imu = *attitude;
  state.gyro_bias_rad_s = rest->mean_gyro_rad_s;
  if (setup.camera) {
    state.camera_from_imu = setup.camera->camera_from_imu;
    state.camera_in_imu_m = setup.camera->in_imu_m;
    state.time_offset_s = setup.camera->time_offset_s;
  }
  std::vector<SurveyedTarget> exact = recording.targets;
  for (SurveyedTarget& target : exact) target.sigma_m = 0.0;

  const ImuSample& first = recording.imu.front();
  FusionFilter filter(FusionLayout{},
                      state,
                      StartCovariance(setup),
                      setup.imu.noise,
                      setup.gravity_m_s2,
                      first.ends_at - Duration(std::llround(first.interval_s * 1e9)));
  RailLine line;
  std::size_t image = 0;
  double distance_m = 0.0;
  Eigen::Vector3d before_m = state.motion.position_world_m;
  const auto advance = [&](const ImuSample& sample, Timestamp to) {
    if (to <= filter.now()) return;
    ImuSample part = sample;
    part.interval_s = SecondsBetween(filter.now(), to);
    part.ends_at = to;
    filter.Feed(part);
  };
  for (const ImuSample& sample : recording.imu) {
    for (; image < recording.images.size(); ++image) {
      const TargetImage& seen = recording.images[image];
      if (seen.stamped_at > sample.ends_at) break;
      if (!setup.camera || seen.stamped_at < filter.now()) continue;
      advance(sample, seen.stamped_at);
      filter.BringForward();
      UpdateByTargets(filter, setup.camera->model, setup.camera->residual_px, exact, seen.pixels);
    }
    advance(sample, sample.ends_at);
    filter.BringForward();
    const Eigen::Vector3d now_m = filter.state().motion.position_world_m;
    distance_m += (now_m - before_m).norm();
    before_m = now_m;
    line.points.push_back(PointOf(filter, distance_m));
  }
  return line;
}

}  // namespace tbm
