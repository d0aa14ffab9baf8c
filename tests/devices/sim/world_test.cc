#include "devices/sim/world.h"

#include <algorithm>
#include <array>
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

// Recordings and other tests rest on this world: figures of the first version of it.
TEST(World, WithoutATunnelItIsTheSameToTheBit) {
  struct Known {
    double t_s;
    std::array<double, 8> numbers;
  };
  const Known known[] = {
      {3,
       {0x1.982b34b5b6f87p-7,
        -0x1.1d2ade1dcb64ep-7,
        0x1.9ac078867b8c3p+1,
        0x1.0932ac5664269p-12,
        0x1.8f82e50095abep-10,
        0x1.fad4a88d582ebp-12,
        0x1.1894fae518522p-5,
        -0x1.d5a7ddd7e0acbp-5}},
      {401.5,
       {0x1.114f599ba6ab5p-6,
        -0x1.19ae308634a06p-7,
        0x1.16b8b0e07f022p+2,
        0x1.51a5ca0a53134p-10,
        0x1.0682ccf32c0bep-9,
        0x1.d225825d8c49p-11,
        0x1.1e5935cdf4242p-5,
        -0x1.ea82ffc0be581p-5}},
      {439.9,
       {-0x1.d7a8e2c4715fbp-8,
        0x1.76243ea8c00dap-6,
        0x1.99fb896a35d2ap+1,
        -0x1.0f5fce092217cp-10,
        -0x1.79edfc9fc4297p-10,
        -0x1.3a552caa4774dp-8,
        0x1.1305763afc94fp-4,
        -0x1.c3f55ffccad04p-6}},
      {9000.1,
       {-0x1.8cba48fb718b1p-7,
        0x1.0866bb7d66156p-6,
        0x1.e66f90fc0b9fbp+1,
        -0x1.a6ed7bc377b78p-11,
        -0x1.5305ace155c7cp-9,
        -0x1.470b2225c945bp-8,
        0x1.177ad3f2cb461p-4,
        -0x1.7bb9b87872fe7p-6}},
  };
  const World world = Plain({}, {}, 3.0);
  for (const Known& one : known) {
    const WorldState state = world.At(At(one.t_s));
    const Rigid3& pose = state.camera_from_target;
    const Inclination reading = world.TiltReading(TiltSensor::kTarget, At(one.t_s));
    const std::array<double, 8> numbers = {pose.translation.x(),
                                           pose.translation.y(),
                                           pose.translation.z(),
                                           pose.rotation.w(),
                                           pose.rotation.z(),
                                           state.up_in_camera.x(),
                                           reading.beta_rad,
                                           reading.gamma_rad};
    EXPECT_EQ(numbers, one.numbers) << one.t_s;
  }
  EXPECT_FALSE(world.has_tunnel());
}

// A curve to the right of 400 m, climbing by 3 %; a camera 1.5 m behind the rear shield's datum and
// a board 4.2 m behind the front shield's.
class TunnelWorld : public ::testing::Test {
 protected:
  static constexpr double kRadius_m = 400.0;
  static constexpr double kGradient = 0.03;

  static Rigid3 SiteFromAxis(double chainage_m) {
    const double turned_rad = chainage_m / kRadius_m;
    const Eigen::AngleAxisd turn(-turned_rad, Eigen::Vector3d::UnitZ());
    const Eigen::AngleAxisd climb(-std::atan(kGradient), Eigen::Vector3d::UnitY());
    return {Eigen::Quaterniond(turn) * Eigen::Quaterniond(climb),
            {kRadius_m * std::sin(turned_rad),
             -kRadius_m * (1.0 - std::cos(turned_rad)),
             kGradient * chainage_m}};
  }

  static Tunnel CurvedTunnel() {
    Tunnel tunnel;
    tunnel.site_from_axis = SiteFromAxis;
    Eigen::Matrix3d looks_forward;
    looks_forward << 0, 0, 1, -1, 0, 0, 0, -1, 0;
    tunnel.rear_shield_from_camera = {Eigen::Quaterniond(looks_forward), {-1.5, 1.1, 1.6}};
    Eigen::Matrix3d looks_back;
    looks_back << 0, 0, -1, -1, 0, 0, 0, 1, 0;
    tunnel.front_shield_from_target = {Eigen::Quaterniond(looks_back), {-4.2, 1.1, 1.6}};
    tunnel.start_chainage_m = 100.0;
    tunnel.closed_joint_m = 5.9;
    return tunnel;
  }

  static World Driven(double vibration_m = 0.0, double speed = 1.0) {
    Motion motion;
    motion.vibration_m = vibration_m;
    motion.vibration_rad = vibration_m;
    motion.tilt_noise_factor = 0.0;
    return World(test::FieldRig(), motion, {}, kBegin, speed, CurvedTunnel());
  }

  static constexpr double kPush_s = 1200.0;
  static constexpr double kCycle_s = 1320.0;
};

TEST_F(TunnelWorld, RearShieldStandsWhileTheFrontBoresAndIsPulledAfterIt) {
  const World world = Driven();
  const auto way_m = [&](auto shield, double from_s, double to_s) {
    return ((world.*shield)(At(to_s)).translation - (world.*shield)(At(from_s)).translation).norm();
  };
  constexpr auto kRear = &World::SiteFromRearShield;
  constexpr auto kFront = &World::SiteFromFrontShield;
  const double along = std::hypot(1.0, kGradient);  // the chainage counts plan length
  EXPECT_EQ(way_m(kRear, 0.0, kPush_s - 1.0), 0.0);
  EXPECT_EQ(way_m(kRear, kCycle_s + 1.0, kCycle_s + kPush_s - 1.0), 0.0);
  EXPECT_NEAR(way_m(kFront, 0.0, 600.0), 0.6 * along, 1e-3);
  EXPECT_EQ(way_m(kFront, kPush_s + 1.0, kCycle_s - 1.0), 0.0);
  EXPECT_NEAR(way_m(kRear, kPush_s, kCycle_s), 1.2 * along, 1e-3);
  EXPECT_NEAR(way_m(kRear, 0.0, 5.0 * kCycle_s), 6.0 * along, 5e-3);
  EXPECT_NEAR(way_m(kFront, 0.0, 5.0 * kCycle_s), 6.0 * along, 5e-3);
}

TEST_F(TunnelWorld, FrontStaysNearTheDesignAndTheRearComesAlongTheSameRoute) {
  const World world = Driven();
  double most_m = 0.0;
  for (double chainage_m = 106.0; chainage_m < 170.0; chainage_m += 0.3) {
    // Strokes of 1.2 m: when the front's datum, then the rear's, was there.
    const auto when = [&](double driven_m, bool is_rear) {
      const double strokes = std::floor(driven_m / 1.2);
      const double rest_m = driven_m - 1.2 * strokes;
      return strokes * kCycle_s + (is_rear ? kPush_s + rest_m / 0.01 : rest_m / 0.001);
    };
    const Rigid3 front = world.SiteFromFrontShield(At(when(chainage_m - 105.9, false)));
    const Rigid3 rear = world.SiteFromRearShield(At(when(chainage_m - 100.0, true)));
    EXPECT_LT((front.translation - rear.translation).norm(), 1e-6) << chainage_m;
    const Eigen::Vector3d off = Inverse(SiteFromAxis(chainage_m)) * front.translation;
    EXPECT_NEAR(off.x(), 0.0, 1e-9) << chainage_m;
    most_m = std::max({most_m, std::abs(off.y()), std::abs(off.z())});
  }
  EXPECT_GT(most_m, 0.012);
  EXPECT_LE(most_m, 0.025);
}

TEST_F(TunnelWorld, ShieldsPointAlongTheirWayButForACrab) {
  const World world = Driven();
  for (double t = 1.0; t < kPush_s; t += 97.0) {
    const Rigid3 front = world.SiteFromFrontShield(At(t));
    const Eigen::Vector3d way =
        world.SiteFromFrontShield(At(t + 1.0)).translation - front.translation;
    EXPECT_LT((front.rotation * Eigen::Vector3d::UnitX()).cross(way.normalized()).norm(), 0.0013);
    EXPECT_GT((front.rotation * Eigen::Vector3d::UnitX()).cross(way.normalized()).norm(), 1e-6);
    const double left_goes_up = (front.rotation * Eigen::Vector3d::UnitY()).z();
    EXPECT_LT(std::abs(left_goes_up), 0.0045) << "roll";
  }
}

TEST_F(TunnelWorld, CameraAndPlatesSeeWhatFollowsFromThePlacesOfTheShields) {
  const World world = Driven(5e-5);
  const Tunnel tunnel = CurvedTunnel();
  for (const double t : {3.0, 700.0, 1250.0, 4000.0}) {
    const Eigen::Vector3d p_in_target(0.1, -0.2, 0.05);
    const Eigen::Vector3d p_in_site =
        world.SiteFromFrontShield(At(t)) * (tunnel.front_shield_from_target * p_in_target);
    const WorldState state = world.At(At(t));
    const Eigen::Vector3d p_in_camera = state.camera_from_target * p_in_target;
    EXPECT_LT((world.SiteFromRearShield(At(t)) * (tunnel.rear_shield_from_camera * p_in_camera) -
               p_in_site)
                  .norm(),
              1e-12);
    EXPECT_GT(state.camera_from_target.translation.z(), 3.15);
    EXPECT_LT(state.camera_from_target.translation.z(), 4.45);
    EXPECT_LT((world.SiteFromRearShield(At(t)).rotation *
                   (tunnel.rear_shield_from_camera.rotation * state.up_in_camera) -
               Eigen::Vector3d::UnitZ())
                  .norm(),
              1e-12);
    const Inclination plate = test::ExactInclination(world.rig().camera_tilt, state.up_in_camera);
    EXPECT_NEAR(world.TiltReading(TiltSensor::kCamera, At(t)).beta_rad,
                world.rig().camera_tilt.sign[0] * plate.beta_rad,
                1e-12);
  }
}

TEST_F(TunnelWorld, EveryLedStaysInTheImageThroughTheCurve) {
  const World world = Driven(5e-5, 10.0);
  for (double t = 0.0; t < 2000.0; t += 7.7) {
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

TEST_F(TunnelWorld, TheFrontShakesTheRearDoesNotAndSpeedStretchesTime) {
  const World still = Driven();
  const World shaken = Driven(5e-5);
  double sum = 0.0;
  for (int i = 0; i < 500; ++i) {
    const Timestamp at = At(0.0137 * i);
    EXPECT_EQ(still.SiteFromRearShield(at).translation, shaken.SiteFromRearShield(at).translation);
    sum += (still.SiteFromFrontShield(at).translation - shaken.SiteFromFrontShield(at).translation)
               .squaredNorm();
  }
  EXPECT_NEAR(std::sqrt(sum / 1500.0), 5e-5, 5e-6) << "rms of each axis";
  EXPECT_LT((Driven(0.0, 10.0).SiteFromFrontShield(At(30.0)).translation -
             still.SiteFromFrontShield(At(300.0)).translation)
                .norm(),
            1e-12);
}

}  // namespace
}  // namespace tbm::sim
