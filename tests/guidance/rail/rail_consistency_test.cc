// What the product runs, RailFilter from MakeRailPrior with its own noise of rest, against truth:
// the error's square over its covariance (NEES) of position, velocity and attitude, along the run,
// before and after the smoother. Survey, biases that wander, a wheel and a ground camera are drawn
// as they are declared.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "guidance/fusion/fusion_smoother.h"
#include "guidance/fusion/target_modes.h"
#include "guidance/rail/rail_filter.h"
#include "guidance/rail/rail_line.h"
#include "pose/base/angle.h"
#include "tests/guidance/rail/rail_generator.h"
#include "tests/support/random.h"

namespace tbm {
namespace {

using test::GenerateRail;
using test::Random;

constexpr int kRuns = 60;
constexpr double kScaleSigma = 0.005;

// Biases that wander on top of what the scene has drawn.
void Wander(GeneratedRun* run, Random* random) {
  ImuNoise& noise = run->setup.imu.noise;
  noise.gyro_bias_walk_rad_s = 2e-6;
  noise.accel_bias_walk_m_s2 = 2e-5;
  const double root = std::sqrt(1.0 / run->setup.imu.rate_hz);
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();
  for (ImuSample& sample : run->recording.imu) {
    gyro += random->Normal3(noise.gyro_bias_walk_rad_s * root);
    accel += random->Normal3(noise.accel_bias_walk_m_s2 * root);
    sample.gyro_rad_s += gyro;
    sample.accel_m_s2 += accel;
  }
}

// The way along the unit's x. Each reading stands in two speeds, which the filter does not know.
void AddWheel(GeneratedRun* run, Random* random) {
  RailOdometer wheel;
  wheel.sigma_m = 2e-4;
  wheel.sigma_scale = kScaleSigma;
  wheel.mounting.sigma_side_m_s = 0.1;
  const double scale = random->Normal(wheel.sigma_scale);
  double way_m = 0.0;
  for (std::size_t i = 1; i < run->truth.size(); ++i) {
    const RailTruth& from = run->truth[i - 1];
    const RailTruth& to = run->truth[i];
    way_m += (from.world_from_imu.conjugate() * (to.position_world_m - from.position_world_m)).x();
    if (i % 20 != 0) continue;
    run->recording.odometer.push_back(
        {to.at, way_m / (1.0 + scale) + random->Normal(wheel.sigma_m)});
  }
  run->setup.odometer = wheel;
}

void AddGround(GeneratedRun* run, Random* random) {
  RailGroundCamera camera;
  camera.camera_from_imu = ExpRotation({std::numbers::pi, 0.0, 0.0});
  camera.height_m = 0.5;
  camera.sigma_height_m = kScaleSigma * camera.height_m;
  run->setup.ground = camera;
  const double scale = random->Normal(kScaleSigma);
  const Eigen::Quaterniond vehicle_from_imu = GroundVehicle(camera);
  constexpr double kSigma_m = 1e-4;
  constexpr std::size_t kEvery = 30;
  for (std::size_t i = kEvery; i < run->truth.size(); i += kEvery) {
    const RailTruth& from = run->truth[i - kEvery];
    const RailTruth& to = run->truth[i];
    const Eigen::Vector3d way_m =
        vehicle_from_imu *
        (from.world_from_imu.conjugate() * (to.position_world_m - from.position_world_m));
    run->recording.grounds.push_back(
        {from.at, to.at, way_m.head<2>() / (1.0 + scale) + random->Normal2(kSigma_m), kSigma_m});
  }
}

GeneratedRun RunOf(std::uint64_t seed) {
  Random random("rail_consistency", seed);
  RailScene scene;
  scene.seed = 300 + seed;
  scene.turns_deg = 3.0;
  scene.image_late_s = random.Normal(0.005);
  GeneratedRun run = GenerateRail(scene);
  Wander(&run, &random);
  AddWheel(&run, &random);
  AddGround(&run, &random);
  return run;
}

std::size_t TruthAt(const GeneratedRun& run, Timestamp at) {
  const auto found = std::lower_bound(
      run.truth.begin(), run.truth.end(), at, [](const RailTruth& row, Timestamp when) {
        return row.at < when;
      });
  return static_cast<std::size_t>(
      std::min(found - run.truth.begin(), static_cast<std::ptrdiff_t>(run.truth.size() - 2)));
}

// As they are, and not as a first run finds them.
std::vector<TargetView> ViewsOf(const GeneratedRun& run) {
  std::vector<TargetView> views;
  for (const TargetImage& image : run.recording.images) {
    const RailTruth& here = run.truth[TruthAt(run, image.stamped_at)];
    const Rigid3 camera_from_imu{run.camera_from_imu, run.camera_from_imu * -run.camera_in_imu_m};
    TargetView view{camera_from_imu * Inverse({here.world_from_imu, here.position_world_m}), {}};
    for (const TargetPixel& pixel : image.pixels) view.targets.push_back(pixel.target);
    views.push_back(std::move(view));
  }
  return views;
}

enum Block { kPosition, kVelocity, kAttitude, kBlocks };
constexpr std::array<const char*, kBlocks> kNames = {"position", "velocity", "attitude"};
using Nees = std::array<double, kBlocks>;  // over three, sums over the runs

void AddNees(const GeneratedRun& run,
             const FusionEpoch& epoch,
             const Eigen::Vector3d& left_out_m,
             Nees* nees) {
  const std::size_t i = std::max<std::size_t>(TruthAt(run, epoch.at), 1);
  ASSERT_EQ(run.truth[i].at, epoch.at);
  const Motion& motion = epoch.state.motion;
  const Eigen::Vector3d velocity_m_s =
      (run.truth[i + 1].position_world_m - run.truth[i - 1].position_world_m) /
      SecondsBetween(run.truth[i - 1].at, run.truth[i + 1].at);
  const std::array<Eigen::Vector3d, kBlocks> errors = {
      run.truth[i].position_world_m - motion.position_world_m,
      velocity_m_s - motion.velocity_world_m_s,
      LogRotation(motion.world_from_imu.conjugate() * run.truth[i].world_from_imu)};
  constexpr std::array<int, kBlocks> kAt = {
      FusionLayout::kPosition, FusionLayout::kVelocity, FusionLayout::kAttitude};
  for (std::size_t block = 0; block < kBlocks; ++block) {
    Eigen::Matrix3d covariance = epoch.covariance.block<3, 3>(kAt[block], kAt[block]);
    if (block == kPosition) covariance.diagonal() += left_out_m.cwiseAbs2();
    (*nees)[block] += errors[block].dot(covariance.llt().solve(errors[block])) / 3.0;
  }
}

constexpr std::array<double, 5> kPlaces_s = {9.0, 11.0, 13.0, 15.0, 17.5};
struct Consistency {
  Nees filter{};
  Nees smoothed{};
};

void AddRun(std::uint64_t seed, std::array<Consistency, kPlaces_s.size()>* places) {
  const GeneratedRun run = RunOf(seed);
  const auto rest = FindRestSignature(run.setup, run.recording);
  ASSERT_TRUE(rest);
  const auto attitude = FindStartAttitude(run.setup, run.recording, *rest);
  ASSERT_TRUE(attitude);
  const std::vector<RestSpan> rests = FindQuietSpans(run.setup, run.recording, *rest);
  std::vector<SurveyedTarget> targets = run.recording.targets;
  const RailCamera& camera = *run.setup.camera;
  const TargetModes modes = FindTargetModes(
      ViewsOf(run), camera.model, camera.residual_px, FusionLayout::kMostModes, &targets);
  const RailPrior prior = MakeRailPrior(run.setup, *attitude, modes.count);
  FusionSmoother smoother(prior.layout);
  const Timestamp begin = BeginOfRun(run.recording.imu.front());
  RailFilter filter(run.setup, targets, rests, prior, begin, &smoother);
  for (const TrolleyTilt& tilt : run.recording.tilts) filter.Add(tilt);
  for (const TargetImage& image : run.recording.images) filter.Add(image);
  for (std::size_t i = 1; i < run.recording.odometer.size(); ++i) {
    filter.Add(OdometerSpan{run.recording.odometer[i - 1], run.recording.odometer[i]});
  }
  for (const GroundDisplacement& ground : run.recording.grounds) filter.Add(ground);
  for (const ImuSample& sample : run.recording.imu) filter.Feed(sample);
  filter.Finish();

  std::array<std::size_t, kPlaces_s.size()> at{};
  for (std::size_t i = 0; i < smoother.size(); ++i) {
    for (std::size_t place = 0; place < at.size(); ++place) {
      const bool is_sample =
          SecondsBetween(begin, smoother.Filtered(i).at) <= kPlaces_s[place] + 1e-9 &&
          run.truth[TruthAt(run, smoother.Filtered(i).at)].at == smoother.Filtered(i).at;
      if (is_sample) at[place] = i;
    }
  }
  for (std::size_t place = 0; place < at.size(); ++place) {
    AddNees(run, smoother.Filtered(at[place]), modes.left_out_m, &(*places)[place].filter);
  }
  smoother.Smooth([&](std::size_t i, const FusionEpoch& epoch) {
    for (std::size_t place = 0; place < at.size(); ++place) {
      if (at[place] == i) AddNees(run, epoch, modes.left_out_m, &(*places)[place].smoothed);
    }
  });
}

TEST(RailFilter, ErrorsAreAsLargeAsItsCovarianceSays) {
  std::array<Consistency, kPlaces_s.size()> places;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) AddRun(seed, &places);
  // One number of two thousand lies beyond by chance, and there are thirty.
  const double spread = 3.5 * std::sqrt(2.0 / (3.0 * kRuns));
  for (std::size_t place = 0; place < places.size(); ++place) {
    for (std::size_t block = 0; block < kBlocks; ++block) {
      const double filter = places[place].filter[block] / kRuns;
      const double smoothed = places[place].smoothed[block] / kRuns;
      std::printf("%4.1f s, NEES over 3 of %s: filter %.2f, smoother %.2f (%.2f..%.2f)\n",
                  kPlaces_s[place],
                  kNames[block],
                  filter,
                  smoothed,
                  1.0 - spread,
                  1.0 + spread);
      EXPECT_LT(filter, 1.0 + spread) << kNames[block] << " at " << kPlaces_s[place];
      EXPECT_LT(smoothed, 1.0 + spread) << kNames[block] << " at " << kPlaces_s[place];
      // A trolley that rests has no velocity at all, which no noise of rest can be.
      const bool rests = place == 0 || place + 1 == places.size();
      if (rests && block == kVelocity) continue;
      EXPECT_GT(filter, 1.0 - spread) << kNames[block] << " at " << kPlaces_s[place];
      EXPECT_GT(smoothed, 1.0 - spread) << kNames[block] << " at " << kPlaces_s[place];
    }
  }
}

}  // namespace
}  // namespace tbm
