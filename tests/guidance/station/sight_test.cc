#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "guidance/station/polar.h"
#include "guidance/station/reduce.h"
#include "pose/base/angle.h"
#include "tests/support/random.h"

namespace tbm {
namespace {

using test::Random;

constexpr double kPi = std::numbers::pi;

TEST(Sight, BearingsGoClockwiseFromNorth) {
  const Station station{{100.0, 200.0, 50.0}, 0.0};
  EXPECT_NEAR(Sight(station, {100.0, 210.0, 50.0}, {})->circle_rad, 0.0, 1e-12);
  EXPECT_NEAR(Sight(station, {110.0, 200.0, 50.0}, {})->circle_rad, kPi / 2, 1e-12);
  EXPECT_NEAR(Sight(station, {90.0, 200.0, 50.0}, {})->circle_rad, 3 * kPi / 2, 1e-12);
  // The circle's zero turned to the east: a prism in the east is read at zero.
  EXPECT_NEAR(
      Sight({station.p_axes_in_site, kPi / 2}, {110.0, 200.0, 50.0}, {})->circle_rad, 0.0, 1e-12);
}

TEST(Sight, HigherPrismsAreReadAtSmallerZeniths) {
  const Station station;
  EXPECT_LT(Sight(station, {0.0, 10.0, 1.0}, {})->zenith_rad, kPi / 2);
  EXPECT_GT(Sight(station, {0.0, 10.0, -1.0}, {})->zenith_rad, kPi / 2);
}

// 500 m along the level: the earth falls away by 19.62 mm, the ray follows 0.13 of it.
TEST(Sight, CurvatureAndRefractionLowerADistantPrism) {
  const auto reading = Sight({}, {0.0, 500.0, 0.0}, {});
  EXPECT_NEAR(500.0 / std::tan(reading->zenith_rad), -0.017070, 1e-6);
  SightModel straight;
  straight.refraction_k = 1.0;
  EXPECT_NEAR(Sight({}, {0.0, 500.0, 0.0}, straight)->zenith_rad, kPi / 2, 1e-12);
}

TEST(Sight, GridScaleShortensThePlanOnly) {
  SightModel model;
  model.grid_scale = 0.9996;
  model.refraction_k = 1.0;
  const auto p = PointSighted({}, {kPi / 2, kPi / 3, 100.0}, model);
  EXPECT_NEAR(p->x(), 100.0 * std::sin(kPi / 3) * 0.9996, 1e-10);
  EXPECT_NEAR(p->z(), 50.0, 1e-10);
}

TEST(Sight, PointAndReadingAreEachOthersInverse) {
  Random random("sight_inverse");
  for (int i = 0; i < 1000; ++i) {
    const Station station{
        {random.Uniform(4e6, 4.1e6), random.Uniform(5e5, 6e5), random.Uniform(-50, 900)},
        random.Uniform(0.0, 2 * kPi)};
    const Eigen::Vector3d p = station.p_axes_in_site + random.Normal3(80.0);
    SightModel model;
    model.grid_scale = random.Uniform(0.9995, 1.0005);
    const auto reading = Sight(station, p, model);
    ASSERT_TRUE(reading);
    EXPECT_GE(reading->circle_rad, 0.0);
    EXPECT_LT(reading->circle_rad, 2 * kPi);
    EXPECT_LT((*PointSighted(station, *reading, model) - p).norm(), 3e-9);
  }
}

// Central differences over 1 mm and 1e-5 rad: their own error is below 1e-7 of the derivative here.
TEST(Sight, JacobiansAreTheDerivatives) {
  Random random("sight_jacobian");
  for (int i = 0; i < 100; ++i) {
    const Station station{random.Normal3(10.0), random.Uniform(0.0, 6.0)};
    const Eigen::Vector3d p =
        station.p_axes_in_site +
        Eigen::Vector3d(random.Uniform(20, 90), random.Uniform(20, 90), random.Normal(5.0));
    SightModel model;
    model.grid_scale = 0.9997;
    const auto read = [&](const Eigen::Vector4d& d, const Eigen::Vector3d& dp) {
      const auto r =
          Sight({station.p_axes_in_site + d.head<3>(), station.circle_zero_bearing_rad + d[3]},
                p + dp,
                model);
      return Eigen::Vector3d(r->circle_rad, r->zenith_rad, *r->slope_m);
    };
    const SightJacobian by = SightBy(station, p, model);
    for (int k = 0; k < 4; ++k) {
      const double step = k < 3 ? 1e-3 : 1e-5;
      Eigen::Vector4d d = Eigen::Vector4d::Zero();
      d[k] = step;
      Eigen::Vector3d difference =
          read(d, Eigen::Vector3d::Zero()) - read(-d, Eigen::Vector3d::Zero());
      difference[0] = HalfTurn(difference[0]);
      const Eigen::Vector3d by_station = difference / (2 * step);
      EXPECT_LT((by_station - by.by_station.col(k)).norm(), 1e-7) << k;
      if (k == 3) continue;
      const Eigen::Vector3d dp = Eigen::Vector3d::Unit(k) * step;
      difference = read(Eigen::Vector4d::Zero(), dp) - read(Eigen::Vector4d::Zero(), -dp);
      difference[0] = HalfTurn(difference[0]);
      EXPECT_LT((difference / (2 * step) - by.by_point.col(k)).norm(), 1e-7) << k;
    }
  }
}

// Monte Carlo over reading and station: the covariance in its two parts is what is seen.
TEST(Sight, CovarianceOfASightedPointIsWhatIsSeen) {
  Random random("sight_covariance");
  const Station truth{{10.0, 20.0, 5.0}, 1.0};
  const Eigen::Vector3d p(70.0, 95.0, 9.0);
  const PolarSigma sigma{5e-6, 7e-6, 0.001};
  const Eigen::Vector4d station_sigma(0.002, 0.001, 0.0015, 1e-5);
  const PolarReading exact = *Sight(truth, p, {});
  Eigen::Matrix3d seen = Eigen::Matrix3d::Zero();
  constexpr int kDraws = 40000;
  for (int i = 0; i < kDraws; ++i) {
    Station station = truth;
    station.p_axes_in_site += Eigen::Vector3d(random.Normal(station_sigma[0]),
                                              random.Normal(station_sigma[1]),
                                              random.Normal(station_sigma[2]));
    station.circle_zero_bearing_rad += random.Normal(station_sigma[3]);
    const PolarReading reading{exact.circle_rad + random.Normal(sigma.circle_rad),
                               exact.zenith_rad + random.Normal(sigma.zenith_rad),
                               *exact.slope_m + random.Normal(sigma.slope_m)};
    const Eigen::Vector3d error = *PointSighted(station, reading, {}) - p;
    seen += error * error.transpose() / kDraws;
  }
  const SightedCovariance parts = CovarianceSighted(truth, p, {}, sigma);
  const Eigen::Matrix3d said = parts.of_reading + parts.by_station *
                                                      station_sigma.cwiseAbs2().asDiagonal() *
                                                      parts.by_station.transpose();
  EXPECT_LT((seen - said).norm() / said.norm(), 0.03);
}

TEST(Sight, RefusesWhatGivesNoPoint) {
  EXPECT_EQ(Sight({}, {0.0, 0.0, 5.0}, {}).error(), SightFailure::kAlongTheAxis);
  EXPECT_EQ(PointSighted({}, {0.0, 1.0, {}}, {}).error(), SightFailure::kNoDistance);
  EXPECT_EQ(PointSighted({}, {std::nan(""), 1.0, 5.0}, {}).error(), SightFailure::kNotFinite);
  EXPECT_EQ(PointSighted({}, {0.0, 0.0, 5.0}, {}).error(), SightFailure::kAlongTheAxis);
}

// The instruments' manual: the displayed distance is true at 12 degrees, 1013.25 hPa and 60 %; one
// degree costs 1 ppm, 3.5 hPa as much.
TEST(Reduce, AirCorrectionIsTheInstrumentsOwn) {
  const DistanceMeter meter;
  EXPECT_NEAR(AirCorrection_ppm({12.0, 1013.25, 60.0}, meter), 0.0, 0.02);
  EXPECT_NEAR(AirCorrection_ppm({13.0, 1013.25, 60.0}, meter) -
                  AirCorrection_ppm({12.0, 1013.25, 60.0}, meter),
              1.0,
              0.05);
  EXPECT_NEAR(AirCorrection_ppm({12.0, 1013.25 - 3.5, 60.0}, meter), 1.0, 0.05);
  // Its formula with printed coefficients at a warm and a high place: 286.34 - 0.29525 p / (1 + t /
  // 273.15) + ...
  const double t = 28.0;
  const double p = 870.0;
  const double alpha = 1.0 / 273.15;
  const double x = 7.5 * t / (237.3 + t) + 0.7857;
  const double manual = 286.34 - (0.29525 * p / (1 + alpha * t) -
                                  4.126e-4 * 85.0 / (1 + alpha * t) * std::pow(10.0, x));
  EXPECT_NEAR(AirCorrection_ppm({t, p, 85.0}, meter), manual, 0.15);
}

RawReading Shown(const PolarReading& truth, Face face, const AxisErrors& errors) {
  RawReading raw;
  raw.face = face;
  raw.slope_m = truth.slope_m;
  const double c = errors.collimation_rad / std::sin(truth.zenith_rad);
  if (face == Face::kOne) {
    raw.circle_rad = truth.circle_rad + c;
    raw.zenith_rad = truth.zenith_rad + errors.index_rad;
  } else {
    raw.circle_rad = Turn(truth.circle_rad + kPi - c);
    raw.zenith_rad = 2 * kPi - (truth.zenith_rad - errors.index_rad);
  }
  return raw;
}

TEST(Reduce, MeanOfFacesIsFreeOfAxisErrorsAndFindsThem) {
  const AxisErrors errors{3e-5, -4e-5};
  for (const double circle : {0.00001, 1.0, kPi, 6.28318}) {
    const PolarReading truth{circle, 1.2, 80.0};
    const RawReading one = Shown(truth, Face::kOne, errors);
    const RawReading two = Shown(truth, Face::kTwo, errors);
    const auto mean = MeanOfFaces(two, one, {}, 1e-4);
    ASSERT_TRUE(mean);
    EXPECT_NEAR(HalfTurn(mean->mean.circle_rad - circle), 0.0, 1e-12);
    EXPECT_NEAR(mean->mean.zenith_rad, 1.2, 1e-12);
    EXPECT_NEAR(mean->axis_errors.collimation_rad, errors.collimation_rad, 1e-12);
    EXPECT_NEAR(mean->axis_errors.index_rad, errors.index_rad, 1e-12);
    // Either face alone, with these errors taken out, is the same.
    for (const RawReading& raw : {one, two}) {
      const PolarReading reduced = Reduced(raw, {errors, 0.0, 0.0});
      EXPECT_NEAR(HalfTurn(reduced.circle_rad - circle), 0.0, 1e-9);
      EXPECT_NEAR(reduced.zenith_rad, 1.2, 1e-12);
    }
  }
}

TEST(Reduce, FacesOfTwoTargetsAreRefused) {
  const RawReading one = Shown({1.0, 1.2, 80.0}, Face::kOne, {});
  const RawReading two = Shown({1.01, 1.2, 80.0}, Face::kTwo, {});
  EXPECT_EQ(MeanOfFaces(one, two, {}, 1e-4).error(), FacesFailure::kNotOnePoint);
  EXPECT_EQ(MeanOfFaces(one, one, {}, 1e-4).error(), FacesFailure::kSameFace);
}

TEST(Reduce, DistanceGetsAirAndPrism) {
  const PolarReading reduced = Reduced({1.0, 1.5, 200.0, Face::kOne}, {{}, -0.0344, 5.0});
  EXPECT_NEAR(*reduced.slope_m, 200.0 * 1.000005 - 0.0344, 1e-12);
  EXPECT_FALSE(Reduced({1.0, 1.5, {}, Face::kOne}, {{}, -0.0344, 5.0}).slope_m);
}

}  // namespace
}  // namespace tbm
