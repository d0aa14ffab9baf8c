#include "devices/sim/world.h"

#include <cmath>

#include <gtest/gtest.h>

#include "pose/base/angle.h"
#include "tests/support/random.h"
#include "tests/support/scene.h"

namespace tbm::sim {
namespace {

constexpr Timestamp kBegin{1'790'000'000'000'000'000};

Timestamp At(double seconds) { return {kBegin.ns + std::llround(seconds * 1e9)}; }

World Plain(const Motion& motion = {}, Faults faults = {}, double speed = 1.0) {
  return World(test::FieldRig(), motion, std::move(faults), kBegin, speed);
}

TEST(World, IsAFunctionOfTimeAlone) {
  const World one = Plain();
  const World other = Plain();
  for (const double t : {50.0, 3.0, 900.0, 3.0}) {
    const WorldState a = one.At(At(t));
    const WorldState b = other.At(At(t));
    EXPECT_EQ(a.camera_from_target.translation, b.camera_from_target.translation);
    EXPECT_EQ(a.up_in_camera, b.up_in_camera);
    EXPECT_EQ(one.TiltReading(TiltSensor::kTarget, At(t)).beta_rad,
              other.TiltReading(TiltSensor::kTarget, At(t)).beta_rad);
  }
}

TEST(World, AnotherSeedIsAnotherWorld) {
  Motion motion;
  motion.seed = 2;
  EXPECT_NE(Plain().At(At(5.0)).camera_from_target.translation,
            Plain(motion).At(At(5.0)).camera_from_target.translation);
}

TEST(World, EveryLedStaysInTheImageThroughAWholeStroke) {
  const World world = Plain();
  for (double t = 0.0; t < 1500.0; t += 0.77) {
    const Rigid3 camera_from_target = world.At(At(t)).camera_from_target;
    for (const Led& led : world.rig().leds) {
      const Eigen::Vector2d pixel =
          test::ExactPixel(world.rig().camera, camera_from_target * led.p_led_in_target);
      ASSERT_GT(pixel.x(), 20.0) << t;
      ASSERT_GT(pixel.y(), 20.0) << t;
      ASSERT_LT(pixel.x(), world.rig().camera.image_width_px - 20.0) << t;
      ASSERT_LT(pixel.y(), world.rig().camera.image_height_px - 20.0) << t;
    }
  }
}

TEST(World, AdvancesAtItsRateAndMovesWithoutJumps) {
  Motion motion;
  motion.vibration_m = 0.0;
  motion.vibration_rad = 0.0;
  const World world = Plain(motion);
  const auto distance_m = [&](double t) {
    return world.At(At(t)).camera_from_target.translation.z();
  };
  EXPECT_NEAR(distance_m(300.0) - distance_m(0.0), 0.3, 1e-9);
  for (double t = 0.0; t < 1400.0; t += 0.1) {
    ASSERT_LT(std::abs(distance_m(t + 0.1) - distance_m(t)), 0.0012) << t;
  }
}

TEST(World, ItsSpeedStretchesTime) {
  EXPECT_LT((Plain({}, {}, 10.0).At(At(3.0)).camera_from_target.translation -
             Plain().At(At(30.0)).camera_from_target.translation)
                .norm(),
            1e-12);
}

TEST(World, BothPlatesShowTheUpOfOneWorldInTheInstrumentsOwnSigns) {
  Motion motion;
  motion.tilt_noise_factor = 0.0;
  Rig rig = test::FieldRig();
  rig.target_tilt.sign = {-1.0, 1.0};
  rig.camera_tilt.sign = {1.0, -1.0};
  const World world(rig, motion, {}, kBegin);
  const WorldState state = world.At(At(77.0));
  const Eigen::Vector3d up_in_target =
      state.camera_from_target.rotation.toRotationMatrix().transpose() * state.up_in_camera;
  const Inclination target = test::ExactInclination(rig.target_tilt, up_in_target);
  const Inclination camera = test::ExactInclination(rig.camera_tilt, state.up_in_camera);
  const Inclination target_reading = world.TiltReading(TiltSensor::kTarget, At(77.0));
  const Inclination camera_reading = world.TiltReading(TiltSensor::kCamera, At(77.0));
  EXPECT_NEAR(target_reading.beta_rad, -target.beta_rad, 1e-12);
  EXPECT_NEAR(target_reading.gamma_rad, target.gamma_rad, 1e-12);
  EXPECT_NEAR(camera_reading.beta_rad, camera.beta_rad, 1e-12);
  EXPECT_NEAR(camera_reading.gamma_rad, -camera.gamma_rad, 1e-12);
}

TEST(World, TiltNoiseHasTheRigsSigmaAndIsWhite) {
  Motion quiet;
  quiet.tilt_noise_factor = 0.0;
  const World noisy = Plain();
  const World exact = Plain(quiet);
  const double sigma_rad = noisy.rig().target_tilt.sigma_rad;
  double sum_squares = 0.0;
  double sum_products = 0.0;
  double last = 0.0;
  constexpr int kSamples = 4000;
  for (int i = 0; i < kSamples; ++i) {
    const double error = noisy.TiltReading(TiltSensor::kTarget, At(0.05 * i)).beta_rad -
                         exact.TiltReading(TiltSensor::kTarget, At(0.05 * i)).beta_rad;
    sum_squares += error * error;
    sum_products += error * last;
    last = error;
  }
  EXPECT_NEAR(std::sqrt(sum_squares / kSamples) / sigma_rad, 1.0, 0.05);
  EXPECT_NEAR(sum_products / sum_squares, 0.0, 0.06);
}

TEST(World, FaultsHoldWithinTheirWindowOnly) {
  Faults faults;
  faults.hidden.push_back({2, {10.0, 20.0}});
  faults.tilts.push_back({TiltSensor::kCamera, {DegToRad(4.0), 0.0}, {30.0, 40.0}});
  const World broken = Plain({}, faults);
  const World whole = Plain();
  EXPECT_FALSE(broken.IsHidden(2, At(9.99)));
  EXPECT_TRUE(broken.IsHidden(2, At(10.0)));
  EXPECT_FALSE(broken.IsHidden(1, At(15.0)));
  EXPECT_FALSE(broken.IsHidden(2, At(20.0)));
  const auto offset_deg = [&](TiltSensor sensor, double t) {
    return RadToDeg(broken.TiltReading(sensor, At(t)).beta_rad -
                    whole.TiltReading(sensor, At(t)).beta_rad);
  };
  EXPECT_NEAR(offset_deg(TiltSensor::kCamera, 35.0), 4.0, 1e-9);
  EXPECT_NEAR(offset_deg(TiltSensor::kCamera, 45.0), 0.0, 1e-12);
  EXPECT_NEAR(offset_deg(TiltSensor::kTarget, 35.0), 0.0, 1e-12);
}

}  // namespace
}  // namespace tbm::sim
