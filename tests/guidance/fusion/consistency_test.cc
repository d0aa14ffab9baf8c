// Noise, biases and mountings drawn as declared: the error's square over its covariance is what
// chi-squared says (NEES), of all states together, along the run, before and after the smoother.
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "guidance/fusion/fusion_smoother.h"
#include "guidance/fusion/rest_update.h"
#include "guidance/fusion/target_pixels.h"
#include "guidance/fusion/tilt_update.h"
#include "pose/geometry/rigid3.h"
#include "tests/guidance/rail/rail_generator.h"

namespace tbm {
namespace {

using test::GeneratedRun;
using test::GenerateRail;
using test::RailScene;

constexpr int kSeeds = 60;
constexpr double kStartAttitude_rad = 2e-3;
constexpr double kLateSigma_s = 2e-3;
// The simulated trolley does not stir.
constexpr RestNoise kStill = {1e-5, 1e-9, 1e-8};

// The mean of `count` values that are chi-squared with `dof` lies in here in 95 of 100 cases.
struct Bounds {
  double low = 0.0;
  double high = 0.0;
};
Bounds NinetyFive(double dof, double count) {
  const double spread = 1.96 * std::sqrt(2.0 / (dof * count));
  return {1.0 - spread, 1.0 + spread};
}

struct Consistency {
  double nees = 0.0;  // sums over the runs, over the size of the state
  double smoothed = 0.0;
};

class Consistent : public testing::Test {
 protected:
  // One run; its NEES at `places` equally spaced epochs is added up.
  void Add(std::uint64_t seed, std::vector<Consistency>* places) {
    std::mt19937_64 random(7'000 + seed);
    std::normal_distribution<double> normal;
    const auto draw3 = [&](double sigma) {
      return Eigen::Vector3d(
          sigma * normal(random), sigma * normal(random), sigma * normal(random));
    };
    RailScene scene;
    scene.seed = seed;
    scene.turns_deg = 3.0;
    scene.target_sigma_m = 0.0;
    scene.image_late_s = kLateSigma_s * normal(random);
    const GeneratedRun run = GenerateRail(scene);
    const RailCamera& camera = *run.setup.camera;
    const FusionLayout layout(
        {FusionOption::kTimeOffset, FusionOption::kCameraRotation, FusionOption::kCameraPosition});

    FusionState start;
    start.motion.position_world_m = run.setup.start.position_world_m;
    start.motion.world_from_imu =
        run.truth.front().world_from_imu * ExpRotation(draw3(kStartAttitude_rad));
    start.camera_from_imu = camera.camera_from_imu;
    start.camera_in_imu_m = camera.in_imu_m;
    FusionVector sigma(layout.size());
    sigma.segment<3>(FusionLayout::kPosition).setConstant(run.setup.start.sigma_position_m);
    sigma.segment<3>(FusionLayout::kVelocity).setConstant(1e-5);
    sigma.segment<3>(FusionLayout::kAttitude).setConstant(kStartAttitude_rad);
    sigma.segment<3>(FusionLayout::kGyroBias).setConstant(run.setup.imu.gyro_bias_sigma_rad_s);
    sigma.segment<3>(FusionLayout::kAccelBias).setConstant(run.setup.imu.accel_bias_sigma_m_s2);
    sigma[layout.At(FusionOption::kTimeOffset)] = kLateSigma_s;
    sigma.segment<3>(layout.At(FusionOption::kCameraRotation))
        .setConstant(camera.sigma_rotation_rad);
    sigma.segment<3>(layout.At(FusionOption::kCameraPosition)).setConstant(camera.sigma_position_m);
    const FusionMatrix prior = sigma.cwiseAbs2().asDiagonal();
    const Timestamp begin = run.recording.imu.front().ends_at - std::chrono::milliseconds(5);
    FusionFilter filter(layout, start, prior, run.setup.imu.noise, run.setup.gravity_m_s2, begin);
    FusionSmoother smoother(layout);
    std::vector<FusionState> truth;  // at each epoch
    const auto end_epoch = [&](std::size_t sample, bool rests) {
      filter.BringForward();
      smoother.Before(filter);
      bool held = false;
      if (rests) held = UpdateByRest(filter, kStill).accepted;
      for (; tilt_ < run.recording.tilts.size() &&
             run.recording.tilts[tilt_].sensed_at <= filter.now();
           ++tilt_) {
        const auto verdict =
            UpdateByTilt(filter, *run.setup.tilt, run.recording.tilts[tilt_].angles, held);
        tilt_nis_ += verdict.nis;
        tilt_dof_ += verdict.dof;
      }
      for (; image_ < run.recording.images.size() &&
             run.recording.images[image_].stamped_at <= filter.now();
           ++image_) {
        if (run.recording.images[image_].stamped_at < filter.now()) continue;
        const auto outcome = UpdateByTargets(filter,
                                             camera.model,
                                             camera.residual_px,
                                             run.recording.targets,
                                             run.recording.images[image_].pixels);
        target_nis_ += outcome.verdict.nis;
        target_dof_ += outcome.verdict.dof;
      }
      smoother.After(filter);
      truth.push_back(TruthAt(run, scene, sample));
    };
    tilt_ = image_ = 0;
    for (std::size_t i = 0; i < run.recording.imu.size(); ++i) {
      const ImuSample& sample = run.recording.imu[i];
      const bool rests = SecondsBetween(begin, sample.ends_at) <= run.setup.start.at_rest_s;
      rests ? filter.Hold(sample) : filter.Feed(sample);
      if (i % 10 == 0 || (i + 1) % 10 == 0) end_epoch(i, rests);
    }

    std::vector<FusionEpoch> smoothed(smoother.size());
    smoother.Smooth([&](std::size_t i, const FusionEpoch& epoch) { smoothed[i] = epoch; });
    for (std::size_t place = 0; place < places->size(); ++place) {
      const std::size_t i = (place + 1) * (smoother.size() - 1) / places->size();
      (*places)[place].nees += Nees(smoother.Filtered(i), truth[i], layout);
      (*places)[place].smoothed += Nees(smoothed[i], truth[i], layout);
    }
  }

  static FusionState TruthAt(const GeneratedRun& run, const RailScene& scene, std::size_t sample) {
    FusionState state;
    const auto& here = run.truth[sample];
    state.motion.position_world_m = here.position_world_m;
    state.motion.world_from_imu = here.world_from_imu;
    const std::size_t before = sample > 0 ? sample - 1 : sample;
    const std::size_t after = std::min(sample + 1, run.truth.size() - 1);
    state.motion.velocity_world_m_s =
        (run.truth[after].position_world_m - run.truth[before].position_world_m) /
        SecondsBetween(run.truth[before].at, run.truth[after].at);
    state.gyro_bias_rad_s = run.gyro_bias_rad_s;
    state.accel_bias_m_s2 = run.accel_bias_m_s2;
    state.time_offset_s = -scene.image_late_s;
    state.camera_from_imu = run.camera_from_imu;
    state.camera_in_imu_m = run.camera_in_imu_m;
    return state;
  }

  // Over its size. A trolley that rests has no velocity at all, which no draw can be: left out
  // then.
  static double Nees(const FusionEpoch& epoch,
                     const FusionState& truth,
                     const FusionLayout& layout) {
    const FusionVector error = ErrorFrom(epoch.state, truth, layout);
    std::vector<int> rows;
    for (int i = 0; i < layout.size(); ++i) {
      const bool is_velocity = i >= FusionLayout::kVelocity && i < FusionLayout::kVelocity + 3;
      if (!is_velocity || truth.motion.velocity_world_m_s.norm() > 1e-3) rows.push_back(i);
    }
    const Eigen::MatrixXd covariance = epoch.covariance(rows, rows);
    const Eigen::VectorXd taken = error(rows);
    return taken.dot(covariance.llt().solve(taken)) / static_cast<double>(rows.size());
  }

  std::size_t tilt_ = 0;
  std::size_t image_ = 0;
  double tilt_nis_ = 0.0;
  double tilt_dof_ = 0.0;
  double target_nis_ = 0.0;
  double target_dof_ = 0.0;
};

TEST_F(Consistent, ErrorsAreAsLargeAsTheCovarianceSays) {
  std::vector<Consistency> places(5);
  for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(kSeeds); ++seed)
    Add(seed, &places);
  const Bounds bounds = NinetyFive(19.0, kSeeds);
  for (std::size_t place = 0; place < places.size(); ++place) {
    std::printf("NEES over its size at %zu of 5: filter %.3f, smoother %.3f (95 %%: %.3f..%.3f)\n",
                place + 1,
                places[place].nees / kSeeds,
                places[place].smoothed / kSeeds,
                bounds.low,
                bounds.high);
    EXPECT_GT(places[place].nees / kSeeds, bounds.low) << place;
    EXPECT_LT(places[place].nees / kSeeds, bounds.high) << place;
    EXPECT_GT(places[place].smoothed / kSeeds, bounds.low) << place;
    EXPECT_LT(places[place].smoothed / kSeeds, bounds.high) << place;
  }
  std::printf("NIS over dof: tilt %.4f of %.0f, targets %.4f of %.0f\n",
              tilt_nis_ / tilt_dof_,
              tilt_dof_,
              target_nis_ / target_dof_,
              target_dof_);
  const Bounds tilt = NinetyFive(tilt_dof_, 1.0);
  const Bounds targets = NinetyFive(target_dof_, 1.0);
  EXPECT_GT(tilt_nis_ / tilt_dof_, tilt.low);
  EXPECT_LT(tilt_nis_ / tilt_dof_, tilt.high);
  EXPECT_GT(target_nis_ / target_dof_, targets.low);
  EXPECT_LT(target_nis_ / target_dof_, targets.high);
}

}  // namespace
}  // namespace tbm
