#include "pose/solve/published_study.h"

#include <cmath>

#include <gtest/gtest.h>

#include "pose/base/angle.h"

namespace tbm::test {
namespace {

TEST(PublishedStudy, DoesNotDependOnHowTheDrawsAreSplit) {
  const StudyCase study{0.3, 7};
  StudySums whole;
  for (const std::int64_t first : {0, 40, 80, 120}) {
    Merge(RunPublishedStudy(study, first, first + 40), whole);
  }
  StudySums again;
  const StudySums late = RunPublishedStudy(study, 120, 160);
  const StudySums third = RunPublishedStudy(study, 80, 120);
  for (const std::int64_t first : {0, 40})
    Merge(RunPublishedStudy(study, first, first + 40), again);
  Merge(third, again);
  Merge(late, again);
  for (std::size_t m = 0; m < 2; ++m) {
    EXPECT_EQ(whole.methods[m].solved, 160);
    EXPECT_EQ(whole.methods[m].squared, again.methods[m].squared);
    EXPECT_EQ(whole.methods[m].error, again.methods[m].error);
  }
  const StudySums straight = RunPublishedStudy(study, 0, 160);
  for (std::size_t axis = 0; axis < kStudyAxes; ++axis) {
    EXPECT_NEAR(straight.methods[0].squared[axis] / whole.methods[0].squared[axis], 1.0, 1e-12);
  }
}

TEST(PublishedStudy, DrawsDifferBetweenSeedsAndNoises) {
  const auto first_square = [](const StudyCase& study) {
    return RunPublishedStudy(study, 0, 1).methods[0].squared[0] /
           (study.centre_sigma_px * study.centre_sigma_px);
  };
  const double one = first_square({0.3, 1});
  EXPECT_NE(one, first_square({0.3, 2}));
  EXPECT_GT(std::abs(one / first_square({0.2, 1}) - 1.0), 1e-3);
}

// The paper's Fig. 3 and its text: pitch and roll gain clearly, yaw and most of the translation
// hardly. 3000 draws: an RMSE has a sigma of 1.3 %.
TEST(PublishedStudy, RepeatsWhatThePaperConcludes) {
  for (const double noise_px : {0.1, 0.5, 1.0}) {
    const StudySums sums = RunPublishedStudy({noise_px, 3}, 0, 3000);
    const StudyRow vision = Summarise(sums, StudyMethod::kVision);
    const StudyRow fused = Summarise(sums, StudyMethod::kFused);
    EXPECT_EQ(fused.solved, 3000);
    EXPECT_EQ(fused.refused, 0);
    EXPECT_GT(vision.rmse[0], 4.0 * fused.rmse[0]);  // pitch
    EXPECT_GT(vision.rmse[2], 2.0 * fused.rmse[2]);  // roll
    EXPECT_NEAR(fused.rmse[1] / vision.rmse[1], 1.0, 0.1);
    for (std::size_t axis = 0; axis < kStudyAxes; ++axis) {
      EXPECT_NEAR(vision.rmse[axis] / vision.bound[axis], 1.0, 0.06) << noise_px << " " << axis;
      EXPECT_NEAR(fused.rmse[axis] / fused.bound[axis], 1.0, 0.06) << noise_px << " " << axis;
      EXPECT_LT(std::abs(fused.mean[axis]), 0.1 * fused.rmse[axis]);
      // 0.80 for one normal distribution, less for a mixture of near and far from the image's
      // middle.
      EXPECT_NEAR(fused.mean_absolute[axis] / fused.rmse[axis], 0.75, 0.08);
    }
  }
}

TEST(PublishedStudy, RunsThePublishedEstimatorWhenAsked) {
  StudyCase study{0.1, 5};
  study.with_published = true;
  const StudySums sums = RunPublishedStudy(study, 0, 300);
  const StudyRow published = Summarise(sums, StudyMethod::kPublished);
  EXPECT_EQ(published.solved, 300);
  // At 0.1 px the hard constraint costs little; yaw is as good as the bound.
  EXPECT_NEAR(published.rmse[1] / published.bound[1], 1.0, 0.15);
}

}  // namespace
}  // namespace tbm::test
