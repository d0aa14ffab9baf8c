// An hour of a trolley's inertial unit at 500 Hz, filtered and smoothed: rest, tilt at 20 Hz, four
// targets at 10 Hz. The rival is the filter of the textbook, which brings the whole covariance
// forward with each sample.
//
//   rail_bench [minutes]
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include <sys/resource.h>

#include "guidance/fusion/fusion_smoother.h"
#include "guidance/fusion/rest_update.h"
#include "guidance/fusion/target_pixels.h"
#include "guidance/fusion/tilt_update.h"
#include "pose/geometry/rigid3.h"

namespace tbm {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kRate_hz = 500.0;
constexpr double kGravity_m_s2 = 9.80665;
constexpr ImuNoise kNoise{6e-5, 3e-4, 1e-8, 1e-6};
constexpr int kSamplesAnEpoch = 25;  // 20 Hz
constexpr int kEpochsAnImage = 2;    // 10 Hz

double Since_s(Clock::time_point began) {
  return std::chrono::duration<double>(Clock::now() - began).count();
}

double Percentile(std::vector<double> values, double share) {
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

// Runs along x at half a metre a second and sways.
ImuSample SampleAt(int i) {
  const double t = i / kRate_hz;
  return {{std::llround((i + 1) * 1e9 / kRate_hz)},
          1.0 / kRate_hz,
          {0.01 * std::cos(0.3 * t), 0.0, 0.02 * std::sin(0.1 * t)},
          {0.0, 0.05 * std::sin(0.5 * t), kGravity_m_s2}};
}

FusionFilter MakeFilter(const FusionLayout& layout) {
  FusionState state;
  state.motion.velocity_world_m_s = {0.5, 0.0, 0.0};
  FusionMatrix covariance = FusionMatrix::Identity(layout.size(), layout.size());
  covariance *= 1e-6;
  return FusionFilter(layout, state, covariance, kNoise, kGravity_m_s2, {0});
}

// Each step of the covariance as a full product: what a filter does that does not save them up.
double Textbook_us() {
  constexpr int kSteps = 200'000;
  using Matrix15 = Eigen::Matrix<double, 15, 15>;
  Matrix15 p = 1e-6 * Matrix15::Identity();
  Matrix15 phi = Matrix15::Identity();
  Motion motion;
  Strapdown strapdown;
  const Clock::time_point began = Clock::now();
  for (int i = 0; i < kSteps; ++i) {
    const ImuSample sample = SampleAt(i);
    const Increments step = strapdown.Next(sample.gyro_rad_s, sample.accel_m_s2, sample.interval_s);
    const Eigen::Matrix3d r = motion.world_from_imu.toRotationMatrix();
    phi.block<3, 3>(0, 3).diagonal().setConstant(sample.interval_s);
    phi.block<3, 3>(3, 6) = -r * Skew(step.velocity_m_s);
    phi.block<3, 3>(3, 12) = -sample.interval_s * r;
    phi.block<3, 3>(6, 6) = ExpRotation(-step.turn_rad).toRotationMatrix();
    phi.block<3, 3>(6, 9).diagonal().setConstant(-sample.interval_s);
    p = (phi * p * phi.transpose()).eval();
    p.diagonal().array() += 1e-12;
    motion = Advanced(motion, step, sample.interval_s, {0.0, 0.0, -kGravity_m_s2});
  }
  const double us = 1e6 * Since_s(began) / kSteps;
  return p.trace() > 0.0 ? us : 0.0;
}

int Main(int minutes) {
  const FusionLayout layout;
  FusionFilter filter = MakeFilter(layout);
  FusionSmoother smoother(layout);
  const TiltMounting mounting{Eigen::Quaterniond::Identity(), 5e-5};
  const CameraModel lens{2592, 1944, 5455.0, 5455.0, 1295.5, 971.5};
  const int samples = static_cast<int>(minutes * 60 * kRate_hz);
  std::vector<double> steps_us;
  steps_us.reserve(static_cast<std::size_t>(samples));
  std::size_t taken = 0;
  const Clock::time_point began = Clock::now();
  for (int i = 0; i < samples; ++i) {
    const Clock::time_point step_began = Clock::now();
    filter.Feed(SampleAt(i));
    if ((i + 1) % kSamplesAnEpoch == 0) {
      filter.BringForward();
      smoother.Before(filter);
      const Eigen::Vector3d force = filter.force_m_s2().normalized();
      UpdateByTilt(filter, mounting, {-std::asin(force.x()), std::asin(force.y())}, false);
      if ((i + 1) % (kSamplesAnEpoch * kEpochsAnImage) == 0) {
        // Four targets ahead, seen where the state has them: the work is that of real ones.
        std::vector<SurveyedTarget> targets(4);
        std::vector<TargetPixel> pixels;
        for (int t = 0; t < 4; ++t) {
          SurveyedTarget& target = targets[static_cast<std::size_t>(t)];
          const Rigid3 world_from_imu{filter.state().motion.world_from_imu,
                                      filter.state().motion.position_world_m};
          target.in_world_m =
              world_from_imu * Eigen::Vector3d(0.3 * (t % 2), 0.2 * (t / 2), 3.0 + 0.2 * t);
          target.sigma_m = 1e-4;
          const auto prediction = PredictPixel(filter, lens, target);
          if (prediction) pixels.push_back({t, prediction->pixel_px});
        }
        taken +=
            static_cast<std::size_t>(UpdateByTargets(filter, lens, 0.1, targets, pixels).taken);
      }
      smoother.After(filter);
    }
    steps_us.push_back(1e6 * Since_s(step_began));
  }
  const double filtered_s = Since_s(began);
  const Clock::time_point smooth_began = Clock::now();
  double sum = 0.0;
  smoother.Smooth([&](std::size_t, const FusionEpoch& epoch) { sum += epoch.covariance(0, 0); });
  const double smoothed_s = Since_s(smooth_began);
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const double rival_s = Textbook_us() * 1e-6 * samples;
  std::printf("%d min at %.0f Hz: filter %.2f s, smoother %.2f s, %.0f MB at most\n",
              minutes,
              kRate_hz,
              filtered_s,
              smoothed_s,
              static_cast<double>(usage.ru_maxrss) / 1024.0);
  std::printf("step: median %.2f us, p99 %.2f us; %zu targets taken, %.3g\n",
              Percentile(steps_us, 0.5),
              Percentile(steps_us, 0.99),
              taken,
              sum);
  std::printf(
      "bench rail_line: %.2fx a textbook filter alone (%.2f s, no measurements, no "
      "smoother)\n",
      (filtered_s + smoothed_s) / rival_s,
      rival_s);
  return 0;
}

}  // namespace
}  // namespace tbm

int main(int argc, char** argv) { return tbm::Main(argc > 1 ? std::atoi(argv[1]) : 60); }
