#include "pose/calibrate/misfit.h"

#include <cmath>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pose/solve/tails.h"

namespace tbm {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

// One number, measured again and again with a sigma of 1: all is known in closed form.
AdjustWithout MeanOf(const std::vector<double>& values) {
  return [&values](const std::vector<bool>& is_out) {
    double sum = 0.0;
    double count = 0.0;
    for (std::size_t i = 0; i < values.size(); ++i) {
      sum += is_out[i] ? 0.0 : values[i];
      count += is_out[i] ? 0.0 : 1.0;
    }
    AdjustedFit fit;
    fit.dof = static_cast<int>(count) - 1;
    const Eigen::MatrixXd control = Eigen::MatrixXd::Constant(1, 1, 1.0 - 1.0 / count);
    for (std::size_t i = 0; i < values.size(); ++i) {
      const double off = values[i] - sum / count;
      fit.misfits.push_back(MisfitOf(control, Eigen::VectorXd::Constant(1, off)));
      fit.chi2 += is_out[i] ? 0.0 : off * off;
    }
    return fit;
  };
}

std::vector<std::size_t> Named(const std::vector<double>& values) {
  std::vector<std::size_t> named;
  for (const WrongMeasurement& one : FindWrong(values.size(), MeanOf(values))) {
    named.push_back(one.which);
  }
  return named;
}

TEST(Misfit, ItsBoundsAreWhatChanceExceedsOnceIn70000AndOnceInAThousand) {
  for (const int dof : {1, 2, 3}) {
    EXPECT_NEAR(ChiSquaredTail(MostMisfit(dof), dof), 1.0 / 70000.0, 0.1 / 70000.0) << dof;
    EXPECT_NEAR(ChiSquaredTail(DoubtfulMisfit(dof), dof), 1e-3, 2e-5) << dof;
  }
}

TEST(Misfit, IsWhatChi2LosesAndHowFarTheOthersAreAway) {
  const std::vector<double> values = {0.0, 1.0, -1.0, 6.0};
  const AdjustedFit all = MeanOf(values)({false, false, false, false});
  const AdjustedFit rest = MeanOf(values)({false, false, false, true});
  EXPECT_NEAR(all.misfits[3].chi2, all.chi2 - rest.chi2, 1e-12);
  EXPECT_NEAR(all.misfits[3].from_others_sigmas, 6.0, 1e-12);
  EXPECT_EQ(all.misfits[3].dof, 1);
  // Directions that nothing controls are not judged, however large the residual.
  Eigen::MatrixXd control = Eigen::Vector3d(0.5, 0.01, 1.0).asDiagonal();
  const Misfit flat = MisfitOf(control, Eigen::Vector3d(1.0, 100.0, 2.0));
  EXPECT_EQ(flat.dof, 2);
  EXPECT_NEAR(flat.chi2, 2.0 + 4.0, 1e-12);
  EXPECT_NEAR(flat.from_others_sigmas, std::sqrt(4.0 + 4.0), 1e-12);
}

TEST(Misfit, WrongMeasurementsDoNotHideOneAnother) {
  EXPECT_THAT(Named({0.1, -0.7, 0.9, -0.3, 0.4, 0.0, -0.5, 0.6, 0.2, -0.9}), IsEmpty());
  EXPECT_THAT(Named({0.1, -0.7, 0.9, -0.3, 8.0, 0.0, -0.5, 0.6, 0.2, -0.9}), ElementsAre(4u));
  for (const double off : {7.0, 20.0, 1e4}) {
    EXPECT_THAT(Named({0.1, off, 0.9, -0.3, off, 0.0, -0.5, off, 0.2, -0.9}),
                UnorderedElementsAre(1u, 4u, 7u))
        << off;
  }
  // Whose measurements are right when as many say one thing as another?
  EXPECT_THAT(Named({0.1, -0.7, 0.9, -0.3, 0.4, 50.0, 49.5, 50.6, 50.2, 49.1}), IsEmpty());
  // Of two nobody can tell which one.
  const std::vector<double> two = {0.0, 10.0};
  const auto either = FindWrong(2, MeanOf(two));
  ASSERT_EQ(either.size(), 1u);
  EXPECT_THAT(either[0].or_rather, ElementsAre(1u - either[0].which));
}

TEST(Misfit, WhereAllScatterAMisfitIsJudgedByThat) {
  EXPECT_THAT(Named({2.0, -5.0, 6.0, -3.0, 4.0, 0.0, -5.5, 6.5, 1.0, -7.0}), IsEmpty());
  EXPECT_THAT(Named({2.0, -5.0, 6.0, -3.0, 4.0, 90.0, -5.5, 6.5, 1.0, -7.0}), IsEmpty())
      << "beyond scatter without it, too";
  EXPECT_THAT(Named({1.0, -2.0, 3.0, -1.5, 2.0, 30.0, -2.5, 2.6, 1.0, -3.0}), ElementsAre(5u));
}

TEST(Misfit, ScatterCountsWhereItIsBeyondChance) {
  EXPECT_EQ(ScatterFactor(12.0, 10), 1.0);
  EXPECT_NEAR(ScatterFactor(40.0, 10), 2.0, 1e-12);
  EXPECT_EQ(ScatterFactor(5.0, 1), 1.0);
  EXPECT_EQ(ScatterFactor(100.0, 0), 1.0);
  EXPECT_FALSE(IsBeyondScatter(89.0, 10));
  EXPECT_TRUE(IsBeyondScatter(91.0, 10));
  EXPECT_FALSE(IsBeyondScatter(15.0, 1)) << "nine times as much, and still chance";
  EXPECT_FALSE(IsBeyondScatter(100.0, 0));
}

}  // namespace
}  // namespace tbm
