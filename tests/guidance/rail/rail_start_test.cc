#include "guidance/rail/rail_start.h"

#include <functional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/app/rail_start_words.h"
#include "guidance/rail/rail_line.h"
#include "tests/guidance/rail/straight_run.h"

namespace tbm {
namespace {

using test::GenerateStraight;
using ::testing::HasSubstr;

struct Spoilt {
  const char* name;
  std::function<void(GeneratedRun&)> spoil;
  RailStartFault fault;
  const char* says;
};

void EachTilt(GeneratedRun& run, const std::function<void(TiltAngles&)>& change) {
  for (TrolleyTilt& tilt : run.recording.tilts) change(tilt.angles);
}
void EachRate(GeneratedRun& run, double times) {
  for (ImuSample& sample : run.recording.imu) sample.gyro_rad_s *= times;
}

constexpr double kDegrees = 180.0 / std::numbers::pi;

// On a rail with a cant of a degree and a half, on which the trolley sways by one.
TEST(RailStart, UnitsAndSignsThatAreNotTheirsAreSaid) {
  const std::vector<Spoilt> cases = {
      {"tilt in radians",
       [](GeneratedRun& run) {
         EachTilt(run, [](TiltAngles& angles) {
           angles.beta_rad /= kDegrees;
           angles.gamma_rad /= kDegrees;
         });
       },
       RailStartFault::kTiltDisagrees,
       "tilt.csv: "},
      {"tilt of the other sign",
       [](GeneratedRun& run) {
         EachTilt(run, [](TiltAngles& angles) { angles.gamma_rad = -angles.gamma_rad; });
       },
       RailStartFault::kTiltDisagrees,
       "up.y = +sin(gamma)"},
      {"tilts exchanged",
       [](GeneratedRun& run) {
         EachTilt(run, [](TiltAngles& angles) { std::swap(angles.beta_rad, angles.gamma_rad); });
       },
       RailStartFault::kTiltDisagrees,
       "tilt.rotation"},
      {"degrees per second",
       [](GeneratedRun& run) { EachRate(run, kDegrees); },
       RailStartFault::kWrongRateUnit,
       "degrees per second"},
      {"radians of radians",
       [](GeneratedRun& run) { EachRate(run, 1.0 / kDegrees); },
       RailStartFault::kWrongRateUnit,
       "twice"},
      // Its noise and its bias are a tenth of what the data sheet allows.
      {"degrees per second, and a better unit",
       [](GeneratedRun& run) {
         run.setup.imu.noise.angle_random_walk_rad *= 10.0;
         run.setup.imu.gyro_bias_sigma_rad_s *= 30.0;
         EachRate(run, kDegrees);
       },
       RailStartFault::kTurnsTooFast,
       "degrees per second"},
  };
  for (const Spoilt& one : cases) {
    GeneratedRun run = GenerateStraight({.stream = "rail_start", .cant_deg = 1.5, .sway_deg = 1.0});
    ASSERT_TRUE(SolveRailLine(run.setup, run.recording, RailMethod::kFilter)) << one.name;
    one.spoil(run);
    const auto line = SolveRailLine(run.setup, run.recording, RailMethod::kFilter);
    ASSERT_FALSE(line) << one.name;
    EXPECT_EQ(line.error().fault, one.fault) << one.name;
    EXPECT_THAT(Explain(line.error(), run.setup), HasSubstr(one.says)) << one.name;
  }
}

// A unit that is five times better or worse than its data sheet, a run that hardly turns, and an
// inclinometer that is a twentieth of a degree off: nothing is wrong with them.
TEST(RailStart, WhatMayBeIsNotComplainedOf) {
  for (const double sheet : {0.2, 1.0, 5.0}) {
    for (const double sway_deg : {0.0, 0.02, 2.0}) {
      GeneratedRun run = GenerateStraight(
          {.stream = "rail_start_good", .even_s = 10.0, .cant_deg = 1.5, .sway_deg = sway_deg});
      run.setup.imu.noise.angle_random_walk_rad *= sheet;
      EachTilt(run, [](TiltAngles& angles) { angles.beta_rad += DegToRad(0.05); });
      const auto line = SolveRailLine(run.setup, run.recording, RailMethod::kFilter);
      EXPECT_TRUE(line) << sheet << ", " << sway_deg;
    }
  }
}

// One that is built in roughly, and says so, may lie further from the accelerometers.
TEST(RailStart, AnInclinometerIsHeldAgainstWhatItsMountingAllows) {
  for (const double sigma_deg : {0.0, 0.5}) {
    GeneratedRun run = GenerateStraight({.stream = "rail_start_rough", .even_s = 4.0});
    run.setup.tilt->sigma_rotation_rad = DegToRad(sigma_deg);
    EachTilt(run, [](TiltAngles& angles) { angles.beta_rad += DegToRad(1.0); });
    const auto line = SolveRailLine(run.setup, run.recording, RailMethod::kFilter);
    if (sigma_deg > 0.0) {
      EXPECT_TRUE(line);
    } else {
      ASSERT_FALSE(line);
      EXPECT_EQ(line.error().fault, RailStartFault::kTiltDisagrees);
    }
  }
}

}  // namespace
}  // namespace tbm
