// The proof that the numbers the operator steers by are worth what they say: 300 m through line,
// clothoid and curve, with the errors of real instruments.
#include "tests/support/drive.h"

#include <array>
#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>

namespace tbm::test {
namespace {

constexpr double kFrom_m = 2060.0;
constexpr double kTo_m = 2360.0;

struct Statistics {
  int epochs = 0;
  int without = 0;   // no valid number
  int right_in = 0;  // truth inside the published 95 % band
  int up_in = 0;
  double right2 = 0.0;  // sums of squared errors, and of squared sigmas
  double up2 = 0.0;
  double right_sigma2 = 0.0;
  double up_sigma2 = 0.0;
  double chainage_ratio2 = 0.0;
  double mahalanobis = 0.0;  // of (right, up)

  double Rms(double sum) const { return std::sqrt(sum / (epochs - without)); }
};

Statistics DriveOnce(const GuidedMachine& machine,
                     std::optional<ErrorSource> only,
                     const char* stream,
                     int epochs) {
  Drive drive(machine, {}, stream);
  drive.Only(only);
  Statistics s;
  for (int i = 0; i < epochs; ++i) {
    const Drive::Epoch epoch = drive.Measure(kFrom_m + (kTo_m - kFrom_m) * i / epochs);
    const PointState& point = epoch.snapshot.points[machine.machine.steer_by];
    ++s.epochs;
    if (point.worth != Worth::kValid || !point.deviation.up_m) {
      ++s.without;
      continue;
    }
    const Deviation& said = point.deviation;
    const double right = said.right_m - epoch.right_m;
    const double up = *said.up_m - epoch.up_m;
    s.right_in += std::abs(right) < 1.96 * said.right_sigma_m;
    s.up_in += std::abs(up) < 1.96 * said.up_sigma_m;
    s.right2 += right * right;
    s.up2 += up * up;
    s.right_sigma2 += said.right_sigma_m * said.right_sigma_m;
    s.up_sigma2 += said.up_sigma_m * said.up_sigma_m;
    const double along = (said.chainage.m - epoch.chainage_m) / said.along_sigma_m;
    s.chainage_ratio2 += along * along;
    Eigen::Matrix2d covariance;
    const double mixed = said.right_up_correlation * said.right_sigma_m * said.up_sigma_m;
    covariance << said.right_sigma_m * said.right_sigma_m, mixed, mixed,
        said.up_sigma_m * said.up_sigma_m;
    const Eigen::Vector2d error(right, up);
    s.mahalanobis += error.dot(covariance.inverse() * error);
  }
  return s;
}

TEST(Drive, TruthIsInsideTheBandAsOftenAsItSays) {
  constexpr int kEpochs = 1500;
  const GuidedMachine machine = ExampleMachine();
  const Statistics s = DriveOnce(machine, {}, "drive of 300 m", kEpochs);
  const double used = s.epochs - s.without;
  // The gates refuse one round in a thousand each, and leave out a prism in as many.
  EXPECT_LE(s.without, kEpochs / 100);
  EXPECT_GT(s.right_in / used, 0.93);
  EXPECT_LT(s.right_in / used, 0.97);
  EXPECT_GT(s.up_in / used, 0.93);
  EXPECT_LT(s.up_in / used, 0.97);
  EXPECT_NEAR(std::sqrt(s.right2 / s.right_sigma2), 1.0, 0.1);
  EXPECT_NEAR(std::sqrt(s.up2 / s.up_sigma2), 1.0, 0.1);
  EXPECT_NEAR(s.mahalanobis / used, 2.0, 0.2);
  std::printf(
      "%d epochs, %d without a valid number\n"
      "right: inside the 95 %% band %.1f %%, RMS %.2f mm, said %.2f mm\n"
      "up:    inside the 95 %% band %.1f %%, RMS %.2f mm, said %.2f mm\n"
      "squared standardised distance, two directions: %.3f\n",
      s.epochs,
      s.without,
      100.0 * s.right_in / used,
      1e3 * s.Rms(s.right2),
      1e3 * s.Rms(s.right_sigma2),
      100.0 * s.up_in / used,
      1e3 * s.Rms(s.up2),
      1e3 * s.Rms(s.up_sigma2),
      s.mahalanobis / used);
}

// What each source costs at the cutter face; the table of the README is what this prints.
TEST(Drive, ErrorsOfTheSourcesAddUpToTheWhole) {
  constexpr int kEpochs = 2000;
  const GuidedMachine machine = ExampleMachine();
  double right2 = 0.0;
  double up2 = 0.0;
  std::printf("| source | right, mm | up, mm |\n| --- | --- | --- |\n");
  for (int i = 0; i < kErrorSources; ++i) {
    const auto source = static_cast<ErrorSource>(i);
    const Statistics s = DriveOnce(machine, source, "budget", kEpochs);
    const double right = s.Rms(s.right2);
    const double up = s.Rms(s.up2);
    EXPECT_EQ(s.without, 0);
    EXPECT_GT(right + up, 1e-6) << WordsOf(source);
    std::printf(
        "| %s | %.2f | %.2f |\n", std::string(WordsOf(source)).c_str(), 1e3 * right, 1e3 * up);
    right2 += right * right;
    up2 += up * up;
  }
  const Statistics all = DriveOnce(machine, {}, "budget, all", 2 * kEpochs);
  std::printf(
      "| root of the sum of squares | %.2f | %.2f |\n| all together | %.2f | %.2f |\n"
      "| published sigma | %.2f | %.2f |\n",
      1e3 * std::sqrt(right2),
      1e3 * std::sqrt(up2),
      1e3 * all.Rms(all.right2),
      1e3 * all.Rms(all.up2),
      1e3 * all.Rms(all.right_sigma2),
      1e3 * all.Rms(all.up_sigma2));
  EXPECT_NEAR(std::sqrt(right2) / all.Rms(all.right2), 1.0, 0.1);
  EXPECT_NEAR(std::sqrt(up2) / all.Rms(all.up2), 1.0, 0.1);
}

}  // namespace
}  // namespace tbm::test
