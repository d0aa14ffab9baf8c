// How often assignments are right, ambiguous or wrong, over thousands of draws a case.

#include <string>

#include <gtest/gtest.h>

#include "tests/pose/centres/assign_draws.h"

namespace tbm::test {
namespace {

// One way to draw false spots, on one rig.
struct Case {
  const char* name;
  bool field_rig;
  FalseSpots kind;
};
class FourOrFiveLeds : public testing::TestWithParam<Case> {};

TEST_P(FourOrFiveLeds, AreRightAmongTenFalseSpots) {
  const Case& c = GetParam();
  const Rig rig = c.field_rig ? FieldRig() : PublishedRig();
  const Tally tally = AssignDraws(rig, rig, Visible(4, 5, c.kind, 10), 4000, c.name);
  Print(c.name, tally);
  EXPECT_GE(tally.RightShare(), 0.995);
  EXPECT_LE(tally.WrongShare(), 0.001);
  EXPECT_LE(tally.leds_missed, 4);
}

INSTANTIATE_TEST_SUITE_P(AssignLeds,
                         FourOrFiveLeds,
                         testing::Values(Case{"PublishedUniform", false, FalseSpots::kUniform},
                                         Case{"PublishedClustered", false, FalseSpots::kClustered},
                                         Case{"PublishedMirrored", false, FalseSpots::kMirrored},
                                         Case{"PublishedGhosts", false, FalseSpots::kGhosts},
                                         Case{"FieldUniform", true, FalseSpots::kUniform},
                                         Case{"FieldClustered", true, FalseSpots::kClustered},
                                         Case{"FieldMirrored", true, FalseSpots::kMirrored},
                                         Case{"FieldGhosts", true, FalseSpots::kGhosts}),
                         [](const auto& tested) { return std::string(tested.param.name); });

TEST(AssignLeds, TwoOrThreeLedsAloneAreRightOrAmbiguous) {
  for (const FalseSpots kind : {FalseSpots::kUniform, FalseSpots::kClustered}) {
    for (const int visible : {2, 3}) {
      Tally all;
      for (const int false_spots : {0, 1, 2, 5, 10}) {
        const std::string name = "few_" + std::to_string(static_cast<int>(kind)) + "_" +
                                 std::to_string(visible) + "_" + std::to_string(false_spots);
        const Tally tally = AssignDraws(
            FieldRig(), FieldRig(), Visible(visible, visible, kind, false_spots), 2000, name);
        Print(name, tally);
        all.draws += tally.draws;
        all.wrong += tally.wrong;
        if (visible == 3 && false_spots == 0) {
          EXPECT_GE(tally.RightShare(), 0.9);
        }
      }
      EXPECT_LE(all.WrongShare(), 0.001);
    }
  }
}

TEST(AssignLeds, APriorNamesTwoOrThreeLeds) {
  for (const FalseSpots kind : {FalseSpots::kUniform, FalseSpots::kClustered}) {
    for (const int visible : {2, 3}) {
      Tally all;
      for (const int false_spots : {0, 2, 5, 10}) {
        const std::string name = "prior_" + std::to_string(static_cast<int>(kind)) + "_" +
                                 std::to_string(visible) + "_" + std::to_string(false_spots);
        const Tally tally = AssignDraws(FieldRig(),
                                        FieldRig(),
                                        WithPrior(Visible(visible, visible, kind, false_spots)),
                                        2000,
                                        name);
        Print(name, tally);
        all.draws += tally.draws;
        all.wrong += tally.wrong;
        EXPECT_GE(tally.RightShare(), 0.995);
      }
      EXPECT_LE(all.WrongShare(), 0.001);
    }
  }
}

}  // namespace
}  // namespace tbm::test
