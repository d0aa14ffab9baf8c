#include "devices/inclinometer/sample_gate.h"

#include <limits>

#include <gtest/gtest.h>

#include "pose/base/angle.h"

namespace tbm {
namespace {

using namespace std::chrono_literals;

class Gate : public testing::Test {
 protected:
  // One reading every 100 ms, in degrees.
  std::optional<InclinometerFailure> Reads(double beta_deg, double gamma_deg) {
    now_ += 100ms;
    return gate_.Refuses({DegToRad(beta_deg), DegToRad(gamma_deg)}, now_);
  }

  SampleGate gate_{{DegToRad(30.0), DegToRad(2.0), 1s, 500ms}};
  SampleGate::SteadyTime now_{};
};

TEST_F(Gate, BelievesASlowMove) {
  for (int i = 0; i < 20; ++i) EXPECT_FALSE(Reads(1.9 * i - 20.0, -1.9 * i + 20.0)) << i;
}

TEST_F(Gate, RefusesNanAndInfinity) {
  EXPECT_EQ(Reads(std::numeric_limits<double>::quiet_NaN(), 0), InclinometerFailure::kNotFinite);
  EXPECT_EQ(Reads(0, std::numeric_limits<double>::infinity()), InclinometerFailure::kNotFinite);
}

TEST_F(Gate, RefusesWhatIsBeyondTheRange) {
  EXPECT_EQ(Reads(30.1, 0), InclinometerFailure::kOutOfRange);
  EXPECT_EQ(Reads(0, -30.1), InclinometerFailure::kOutOfRange);
  EXPECT_FALSE(Reads(29.9, -29.9));
}

TEST_F(Gate, RefusesOneOutlierAndGoesOnWithTheTruth) {
  EXPECT_FALSE(Reads(1.0, 1.0));
  EXPECT_EQ(Reads(5.0, 1.0), InclinometerFailure::kStep);
  EXPECT_FALSE(Reads(1.01, 1.0));
  EXPECT_EQ(Reads(1.0, -5.0), InclinometerFailure::kStep);
  EXPECT_FALSE(Reads(1.02, 1.0));
}

TEST_F(Gate, BelievesAStepThatTheNextReadingConfirms) {
  EXPECT_FALSE(Reads(1.0, 1.0));
  EXPECT_EQ(Reads(5.0, 1.0), InclinometerFailure::kStep);
  EXPECT_FALSE(Reads(5.1, 1.0));
  EXPECT_FALSE(Reads(5.2, 1.0));
  EXPECT_EQ(Reads(1.0, 1.0), InclinometerFailure::kStep);
}

TEST_F(Gate, TwoDifferentOutliersDoNotConfirmEachOther) {
  EXPECT_FALSE(Reads(1.0, 1.0));
  EXPECT_EQ(Reads(10.0, 1.0), InclinometerFailure::kStep);
  EXPECT_EQ(Reads(-10.0, 1.0), InclinometerFailure::kStep);
  EXPECT_FALSE(Reads(1.0, 1.1));
}

TEST_F(Gate, HasNoReferenceAfterALongSilence) {
  EXPECT_FALSE(Reads(1.0, 1.0));
  now_ += 10s;
  EXPECT_FALSE(Reads(9.0, 1.0));
}

TEST_F(Gate, CallsAnUnchangingReadingFrozen) {
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(Reads(1.0, 1.0)) << i;
  EXPECT_EQ(Reads(1.0, 1.0), InclinometerFailure::kFrozen);
  EXPECT_FALSE(Reads(1.0, 1.0001));
}

TEST(GateSwitchedOff, BelievesStepsAndUnchangingReadings) {
  SampleGate gate({DegToRad(90.0), 0.0, 0ns, 500ms});
  SampleGate::SteadyTime now{};
  for (int i = 0; i < 100; ++i) {
    now += 1s;
    EXPECT_FALSE(gate.Refuses({DegToRad(i < 50 ? 1.0 : -80.0), 0.0}, now));
  }
}

}  // namespace
}  // namespace tbm
