#include "guidance/shield/rear_shield.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "guidance/shield/uncertain.h"
#include "guidance/station/polar.h"
#include "pose/base/angle.h"
#include "tests/support/random.h"

namespace tbm {
namespace {

using test::Random;

constexpr double kArcSecond = std::numbers::pi / 180.0 / 3600.0;

// A drive to the south-east, nose down, rolled to the right; the station 70 m behind on the wall.
struct Truth {
  Rigid3 site_from_shield;
  double speed_m_per_s = 0.0008;
  Station station{{-48.0, 54.0, 3.0}, 0.7};
};

Truth DefaultTruth() {
  Truth truth;
  // x forward, y left, z up: heading 135 degrees is 45 degrees clockwise from east.
  const Eigen::Quaterniond heading = ExpRotation({0.0, 0.0, DegToRad(-45.0)});
  const Eigen::Quaterniond pitch = ExpRotation({0.0, DegToRad(1.5), 0.0});
  const Eigen::Quaterniond roll = ExpRotation({DegToRad(2.0), 0.0, 0.0});
  truth.site_from_shield = {heading * pitch * roll, {2.0, 3.0, 1.0}};
  return truth;
}

struct Noise {
  PolarSigma reading{1.5 * kArcSecond, 1.5 * kArcSecond, 0.0015};
  Eigen::Vector4d station{0.002, 0.002, 0.002, 5e-6};  // sigmas
  double prism_m = 0.0005;
  double up_rad = DegToRad(0.01);
  double heading_rad = DegToRad(0.02);
  double scale = 1.0;  // 0: readings are exact, the sigmas stand
};

const std::vector<Eigen::Vector3d> kPlaces = {
    {0.5, 1.8, 1.2}, {0.7, -1.9, 1.0}, {-2.5, 0.3, 2.2}, {-2.2, -1.2, -0.4}, {1.6, 0.9, 2.0}};

// Each prism 8 s after the one before; the pose is wanted for the moment of the last.
RearShieldProblem Observe(const Truth& truth, int prisms, const Noise& noise, Random& random) {
  RearShieldProblem problem;
  const Timestamp begin{1'700'000'000'000'000'000};
  problem.at = begin + std::chrono::seconds(8 * (prisms - 1));
  problem.speed_sigma_m_per_s = 0.001;
  Station believed = truth.station;
  for (int k = 0; k < 3; ++k)
    believed.p_axes_in_site[k] += noise.scale * random.Normal(noise.station[k]);
  believed.circle_zero_bearing_rad += noise.scale * random.Normal(noise.station[3]);
  problem.station_covariance = noise.station.cwiseAbs2().asDiagonal();
  for (int i = 0; i < prisms; ++i) {
    const Eigen::Vector3d place = kPlaces[static_cast<std::size_t>(i)];
    problem.prisms.push_back({place + noise.scale * random.Normal3(noise.prism_m), noise.prism_m});
    PrismFix fix;
    fix.prism = i;
    fix.sensed_at = begin + std::chrono::seconds(8 * i);
    const double gone_m = truth.speed_m_per_s * SecondsBetween(problem.at, fix.sensed_at);
    const Eigen::Vector3d p = truth.site_from_shield * (place + Eigen::Vector3d(gone_m, 0.0, 0.0));
    PolarReading reading = *Sight(truth.station, p, {});
    reading.circle_rad += noise.scale * random.Normal(noise.reading.circle_rad);
    reading.zenith_rad += noise.scale * random.Normal(noise.reading.zenith_rad);
    *reading.slope_m += noise.scale * random.Normal(noise.reading.slope_m);
    fix.p_in_site = *PointSighted(believed, reading, {});
    const SightedCovariance parts = CovarianceSighted(believed, fix.p_in_site, {}, noise.reading);
    fix.covariance = parts.of_reading;
    fix.by_station = parts.by_station;
    problem.fixes.push_back(fix);
  }
  return problem;
}

UpFix ObserveUp(const Truth& truth, const Noise& noise, Random& random) {
  const Eigen::Vector3d up = truth.site_from_shield.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d turn(
      noise.scale * random.Normal(noise.up_rad), noise.scale * random.Normal(noise.up_rad), 0.0);
  return {ExpRotation(turn) * up, noise.up_rad};
}

HeadingFix ObserveHeading(const Truth& truth, const Noise& noise, Random& random) {
  const Eigen::Vector3d ahead = truth.site_from_shield.rotation * Eigen::Vector3d::UnitX();
  return {std::atan2(ahead.x(), ahead.y()) + noise.scale * random.Normal(noise.heading_rad),
          noise.heading_rad};
}

double ErrorSquared(const RearShieldFix& fix, const Truth& truth) {
  const PoseError error = ErrorBetween(fix.site_from_rear_shield, truth.site_from_shield);
  return error.dot(fix.covariance.ldlt().solve(error));
}

TEST(RearShield, HeadingIsClockwiseFromNorth) {
  EXPECT_NEAR(RadToDeg(HeadingOf(DefaultTruth().site_from_shield)), 135.0, 0.1);
  EXPECT_NEAR(HeadingOf({}), std::numbers::pi / 2, 1e-12);  // x axis to the east
}

TEST(RearShield, EveryCombinationIsExactWithoutNoise) {
  Noise exact;
  exact.scale = 0.0;
  const Truth truth = DefaultTruth();
  for (int prisms = 1; prisms <= 5; ++prisms) {
    for (const bool with_up : {false, true}) {
      for (const bool with_heading : {false, true}) {
        Random random("rear_exact");
        RearShieldProblem problem = Observe(truth, prisms, exact, random);
        problem.speed_m_per_s = truth.speed_m_per_s;
        if (with_up) problem.up = ObserveUp(truth, exact, random);
        if (with_heading) problem.heading = ObserveHeading(truth, exact, random);
        const bool enough =
            prisms >= 3 || (prisms == 2 && with_up) || (prisms == 1 && with_up && with_heading);
        const auto fix = FixRearShield(problem, {});
        ASSERT_EQ(fix.has_value(), enough) << prisms << with_up << with_heading;
        if (!fix) continue;
        const PoseError error = ErrorBetween(fix->site_from_rear_shield, truth.site_from_shield);
        EXPECT_LT(error.head<3>().norm(), 1e-9);
        EXPECT_LT(error.tail<3>().norm(), 1e-8);
      }
    }
  }
}

// Five prisms over 32 s at 0.8 mm/s: 26 mm on the way. Without the speed as an unknown the last
// position would be 10 mm off.
TEST(RearShield, FindsTheSpeedWhilePrismsAreMeasured) {
  Noise exact;
  exact.scale = 0.0;
  Random random("rear_speed");
  const Truth truth = DefaultTruth();
  RearShieldProblem problem = Observe(truth, 5, exact, random);
  problem.speed_sigma_m_per_s = 0.1;
  const auto fix = FixRearShield(problem, {});
  ASSERT_TRUE(fix);
  EXPECT_NEAR(fix->speed_m_per_s, truth.speed_m_per_s, 1e-5);
  EXPECT_LT((fix->site_from_rear_shield.translation - truth.site_from_shield.translation).norm(),
            3e-4);
}

struct Case {
  const char* name;
  int prisms;
  bool up, heading;
};

// Normalised error squared of six unknowns: 6 +- 0.2 is more than two sigmas of the mean of 1500.
TEST(RearShield, CovarianceIsHonest) {
  for (const Case& c : {Case{"three", 3, false, false},
                        Case{"three_up", 3, true, false},
                        Case{"two_up", 2, true, false},
                        Case{"one_up_heading", 1, true, true},
                        Case{"five_up", 5, true, false}}) {
    Random random(std::string("rear_nees_") + c.name);
    double nees = 0.0;
    int solved = 0;
    int refused = 0;
    for (int i = 0; i < 1500; ++i) {
      const Noise noise;
      Truth truth = DefaultTruth();
      RearShieldProblem problem = Observe(truth, c.prisms, noise, random);
      problem.speed_m_per_s = truth.speed_m_per_s + random.Normal(problem.speed_sigma_m_per_s);
      if (c.up) problem.up = ObserveUp(truth, noise, random);
      if (c.heading) problem.heading = ObserveHeading(truth, noise, random);
      const auto fix = FixRearShield(problem, {});
      if (!fix || fix->left_out || fix->exchanged) {
        ++refused;
        continue;
      }
      ++solved;
      nees += ErrorSquared(*fix, truth);
    }
    EXPECT_NEAR(nees / solved, 6.0, 0.25) << c.name;
    EXPECT_LE(refused, 8) << c.name;  // 1.5 expected of a gate at 1e-3
  }
}

TEST(RearShield, PrismsTakenForEachOtherArePutRight) {
  int right = 0;
  Random random("rear_exchanged");
  for (int i = 0; i < 200; ++i) {
    const Truth truth = DefaultTruth();
    RearShieldProblem problem = Observe(truth, 4, {}, random);
    problem.up = ObserveUp(truth, {}, random);
    const int a = random.Index(3);
    const int b = a + 1;
    std::swap(problem.fixes[static_cast<std::size_t>(a)].prism,
              problem.fixes[static_cast<std::size_t>(b)].prism);
    const auto fix = FixRearShield(problem, {});
    if (!fix) {
      EXPECT_EQ(fix.error(), RearShieldFailure::kInconsistent);
      continue;
    }
    ASSERT_TRUE(fix->exchanged);
    right += (*fix->exchanged == std::array{a, b});
    EXPECT_LT(ErrorSquared(*fix, truth), 40.0);
  }
  EXPECT_GE(right, 198);
}

// A reflector of someone else's, a hand's breadth away.
TEST(RearShield, AWrongPrismIsNamed) {
  int named = 0;
  Random random("rear_wrong");
  for (int i = 0; i < 300; ++i) {
    const Truth truth = DefaultTruth();
    RearShieldProblem problem = Observe(truth, 4, {}, random);
    problem.up = ObserveUp(truth, {}, random);
    const int bad = random.Index(4);
    problem.fixes[static_cast<std::size_t>(bad)].p_in_site += 0.1 * random.Normal3().normalized();
    const auto fix = FixRearShield(problem, {});
    if (!fix) {
      EXPECT_EQ(fix.error(), RearShieldFailure::kInconsistent);
      continue;
    }
    ASSERT_TRUE(fix->left_out) << "a wrong prism was believed";
    named += fix->left_out == bad;
  }
  EXPECT_GE(named, 290);
}

// Two prisms and the tilt leave only the distance between the prisms to check: enough to refuse,
// not to name.
TEST(RearShield, TwoPrismsThatDisagreeAreRefused) {
  Random random("rear_two_wrong");
  const Truth truth = DefaultTruth();
  RearShieldProblem problem = Observe(truth, 2, {}, random);
  problem.up = ObserveUp(truth, {}, random);
  const Eigen::Vector3d apart = problem.fixes[1].p_in_site - problem.fixes[0].p_in_site;
  problem.fixes[1].p_in_site += 0.05 * apart.normalized();
  EXPECT_EQ(FixRearShield(problem, {}).error(), RearShieldFailure::kInconsistent);
}

TEST(RearShield, RefusesWhatCannotBeSeen) {
  Random random("rear_refusals");
  const Truth truth = DefaultTruth();
  RearShieldProblem two = Observe(truth, 2, {}, random);
  EXPECT_FALSE(FixRearShield(two, {}));
  RearShieldProblem one = Observe(truth, 1, {}, random);
  one.up = ObserveUp(truth, {}, random);
  EXPECT_FALSE(FixRearShield(one, {}));
  EXPECT_EQ(FixRearShield({}, {}).error(), RearShieldFailure::kTooFewFixes);
  // Three prisms on a line along the machine: its roll is open.
  RearShieldProblem line = Observe(truth, 3, {}, random);
  for (std::size_t i = 0; i < 3; ++i) {
    const Eigen::Vector3d place(static_cast<double>(i) - 1.0, 0.4, 1.0);
    line.prisms[i].p_in_rear_shield = place;
    line.fixes[i].p_in_site = truth.site_from_shield * place;
  }
  EXPECT_FALSE(FixRearShield(line, {}));
  RearShieldProblem nan = Observe(truth, 3, {}, random);
  nan.fixes[1].p_in_site.x() = std::nan("");
  EXPECT_EQ(FixRearShield(nan, {}).error(), RearShieldFailure::kNotFinite);
}

// --- products of uncertain transforms ---

UncertainRigid3 RandomUncertain(Random& random) {
  UncertainRigid3 made{{random.Rotation(), random.Normal3(4.0)}, PoseCovariance::Zero()};
  PoseCovariance root;
  for (int i = 0; i < 36; ++i) root(i / 6, i % 6) = random.Normal(1e-4);
  made.covariance = root * root.transpose();
  return made;
}

Rigid3 Sample(const UncertainRigid3& of, Random& random) {
  PoseError unit;
  for (int i = 0; i < 6; ++i) unit[i] = random.Normal();
  return Moved(of.b_from_a, of.covariance.llt().matrixL() * unit);
}

TEST(Uncertain, ChainsAndInversesCarryTheErrorsThatAreSeen) {
  Random random("uncertain_chain");
  const UncertainRigid3 c_from_b = RandomUncertain(random);
  const UncertainRigid3 b_from_a = RandomUncertain(random);
  const UncertainRigid3 c_from_a = c_from_b * b_from_a;
  const UncertainRigid3 a_from_c = Inverse(c_from_a);
  const UncertainPoint p_in_a{{1.0, -2.0, 5.0}, 1e-8 * Eigen::Matrix3d::Identity()};
  const UncertainPoint p_in_c = c_from_a * p_in_a;
  PoseCovariance chain = PoseCovariance::Zero();
  PoseCovariance inverse = PoseCovariance::Zero();
  Eigen::Matrix3d point = Eigen::Matrix3d::Zero();
  constexpr int kDraws = 20000;
  for (int i = 0; i < kDraws; ++i) {
    const Rigid3 drawn = Sample(c_from_b, random) * Sample(b_from_a, random);
    const PoseError e = ErrorBetween(c_from_a.b_from_a, drawn);
    chain += e * e.transpose() / kDraws;
    const PoseError back = ErrorBetween(a_from_c.b_from_a, Inverse(drawn));
    inverse += back * back.transpose() / kDraws;
    const Eigen::Vector3d p = drawn * (p_in_a.p + random.Normal3(1e-4)) - p_in_c.p;
    point += p * p.transpose() / kDraws;
  }
  EXPECT_LT((chain - c_from_a.covariance).norm() / chain.norm(), 0.03);
  EXPECT_LT((inverse - a_from_c.covariance).norm() / inverse.norm(), 0.03);
  EXPECT_LT((point - p_in_c.covariance).norm() / point.norm(), 0.03);
}

}  // namespace
}  // namespace tbm
