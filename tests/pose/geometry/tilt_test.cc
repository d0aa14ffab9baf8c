#include "pose/geometry/tilt.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "pose/base/angle.h"
#include "tests/support/random.h"

namespace tbm::test {
namespace {

TEST(Tilt, LoweredXAxisReadsPositiveBeta) {
  // The housing pitched so that its x axis points 3 degrees below the horizon: up leans towards -x.
  const auto up = UpInTilt({DegToRad(3.0), 0.0});
  ASSERT_TRUE(up);
  EXPECT_NEAR(up->x(), -std::sin(DegToRad(3.0)), 1e-15);
  EXPECT_EQ(up->y(), 0.0);
}

TEST(Tilt, RaisedYAxisReadsPositiveGamma) {
  const auto up = UpInTilt({0.0, DegToRad(3.0)});
  ASSERT_TRUE(up);
  EXPECT_NEAR(up->y(), std::sin(DegToRad(3.0)), 1e-15);
}

// The paper's Eqs. 8 to 13 written out: omega = asin(sin gamma / cos beta), phi = beta, up is the
// third row of R_phi R_omega.
TEST(Tilt, AgreesWithThePapersAngles) {
  Random random("tilt paper");
  for (int i = 0; i < 1000; ++i) {
    const Inclination reading{DegToRad(random.Uniform(-40, 40)), DegToRad(random.Uniform(-40, 40))};
    const double omega = std::asin(std::sin(reading.gamma_rad) / std::cos(reading.beta_rad));
    const double phi = reading.beta_rad;
    const Eigen::Vector3d row(
        -std::sin(phi), std::sin(omega) * std::cos(phi), std::cos(omega) * std::cos(phi));
    const auto up = UpInTilt(reading);
    ASSERT_TRUE(up);
    EXPECT_LT((*up - row).norm(), 1e-15);
    EXPECT_NEAR(up->norm(), 1.0, 1e-15);
  }
}

TEST(Tilt, ThereAndBackIsTheSameReading) {
  Random random("tilt round trip");
  for (int i = 0; i < 1000; ++i) {
    const Inclination reading{DegToRad(random.Uniform(-50, 50)), DegToRad(random.Uniform(-35, 35))};
    const auto up = UpInTilt(reading);
    ASSERT_TRUE(up);
    const Inclination again = InclinationFromUp(*up);
    EXPECT_NEAR(again.beta_rad, reading.beta_rad, 1e-15);
    EXPECT_NEAR(again.gamma_rad, reading.gamma_rad, 1e-15);
  }
}

TEST(Tilt, DerivativeAgreesWithCentralDifferences) {
  Random random("tilt jacobian");
  constexpr double kStep = 1e-6;
  for (int i = 0; i < 300; ++i) {
    const Inclination at{DegToRad(random.Uniform(-40, 40)), DegToRad(random.Uniform(-40, 40))};
    const Eigen::Matrix<double, 3, 2> derivative = UpByInclination(at);
    const auto up = [](double beta_rad, double gamma_rad) {
      return UpInTilt({beta_rad, gamma_rad}).value();
    };
    const Eigen::Vector3d by_beta =
        (up(at.beta_rad + kStep, at.gamma_rad) - up(at.beta_rad - kStep, at.gamma_rad)) /
        (2.0 * kStep);
    const Eigen::Vector3d by_gamma =
        (up(at.beta_rad, at.gamma_rad + kStep) - up(at.beta_rad, at.gamma_rad - kStep)) /
        (2.0 * kStep);
    EXPECT_LT((derivative.col(0) - by_beta).norm(), 1e-8);
    EXPECT_LT((derivative.col(1) - by_gamma).norm(), 1e-8);
  }
}

TEST(Tilt, RefusesReadingsNoPlateCanHave) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  for (const Inclination& reading : {Inclination{nan, 0.0}, Inclination{0.0, inf}}) {
    const auto up = UpInTilt(reading);
    ASSERT_FALSE(up);
    EXPECT_EQ(up.error(), TiltFailure::kNotFinite);
  }
  // Past the vertical; and two elevations that no unit vector has together.
  for (const Inclination& reading : {Inclination{DegToRad(90.0), 0.0},
                                     Inclination{0.0, DegToRad(-120.0)},
                                     Inclination{DegToRad(60.0), DegToRad(40.0)}}) {
    const auto up = UpInTilt(reading);
    ASSERT_FALSE(up);
    EXPECT_EQ(up.error(), TiltFailure::kOutOfRange);
  }
}

}  // namespace
}  // namespace tbm::test
