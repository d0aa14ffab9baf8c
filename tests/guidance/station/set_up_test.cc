#include "guidance/station/set_up.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "guidance/station/reference_check.h"
#include "tests/support/random.h"

namespace tbm {
namespace {

using test::Random;

// A station on a bracket at the tunnel's wall; references on both walls behind and before it.
constexpr double kArcSecond = std::numbers::pi / 180.0 / 3600.0;
const PolarSigma kSigma{1.0 * kArcSecond, 1.0 * kArcSecond, 0.001};
const Station kTruth{{500012.3, 4100078.9, 101.5}, 2.1};

std::vector<Reference> Wall(int count, double sigma_m = 0.002) {
  const std::vector<Eigen::Vector3d> places = {{-2.9, -62.0, 0.4},
                                               {3.0, -38.0, 1.1},
                                               {-2.8, -21.0, -0.3},
                                               {2.9, 33.0, 0.8},
                                               {-3.0, 55.0, 1.5},
                                               {2.7, -90.0, 0.2}};
  std::vector<Reference> references;
  for (int i = 0; i < count; ++i) {
    references.push_back({kTruth.p_axes_in_site + places[static_cast<std::size_t>(i)], sigma_m});
  }
  return references;
}

struct Draw {
  std::vector<Reference> references;  // as surveyed: with their errors
  std::vector<ReferenceSighting> sightings;
};

Draw DrawSightings(const std::vector<Reference>& true_references,
                   Random& random,
                   int rounds,
                   double noise = 1.0) {
  Draw draw{true_references, {}};
  for (int round = 0; round < rounds; ++round) {
    for (int i = 0; i < static_cast<int>(true_references.size()); ++i) {
      PolarReading reading =
          *Sight(kTruth, true_references[static_cast<std::size_t>(i)].p_in_site, {});
      reading.circle_rad += noise * random.Normal(kSigma.circle_rad);
      reading.zenith_rad += noise * random.Normal(kSigma.zenith_rad);
      *reading.slope_m += noise * random.Normal(kSigma.slope_m);
      draw.sightings.push_back({i, reading, kSigma});
    }
  }
  for (Reference& reference : draw.references)
    reference.p_in_site += noise * random.Normal3(reference.sigma_m);
  return draw;
}

SetUpOptions Options() {
  SetUpOptions options;
  options.refraction_k_sigma = 1e-6;  // the draws bend as the model does
  return options;
}

Eigen::Vector4d ErrorOf(const SetUp& set_up) {
  Eigen::Vector4d error;
  error.head<3>() = set_up.station.p_axes_in_site - kTruth.p_axes_in_site;
  error[3] = HalfTurn(set_up.station.circle_zero_bearing_rad - kTruth.circle_zero_bearing_rad);
  return error;
}

TEST(SetUp, FreeStationWithoutNoiseIsExact) {
  for (int count = 2; count <= 6; ++count) {
    Random random("set_up_exact");
    const Draw draw = DrawSightings(Wall(count), random, 1, 0.0);
    const auto set_up = SolveSetUp(draw.references, draw.sightings, {}, Options());
    ASSERT_TRUE(set_up) << count;
    EXPECT_LT(ErrorOf(*set_up).head<3>().norm(), 2e-9);
    EXPECT_LT(std::abs(ErrorOf(*set_up)[3]), 1e-11);
    EXPECT_LT(set_up->chi2, 1e-6);
    EXPECT_EQ(set_up->dof, 3 * count - 4);
  }
}

// Normalised error squared over 3000 draws: 4 +- 0.1 is two sigmas of its mean. Two rounds on each
// reference: its own error does not average out, and a covariance that let it would give 5.5.
TEST(SetUp, CovarianceIsHonest) {
  Random random("set_up_nees");
  double nees = 0.0;
  double chi2 = 0.0;
  int inconsistent = 0;
  int solved = 0;
  for (int i = 0; i < 3000; ++i) {
    const Draw draw = DrawSightings(Wall(4), random, 2);
    const auto set_up = SolveSetUp(draw.references, draw.sightings, {}, Options());
    if (!set_up || set_up->left_out) {
      ++inconsistent;
      continue;
    }
    ++solved;
    const Eigen::Vector4d error = ErrorOf(*set_up);
    nees += error.dot(set_up->covariance.ldlt().solve(error));
    chi2 += set_up->chi2 / set_up->dof;
  }
  EXPECT_LE(inconsistent, 12);  // 3 expected of a gate at 1e-3
  EXPECT_NEAR(nees / solved, 4.0, 0.12);
  EXPECT_NEAR(chi2 / solved, 1.0, 0.02);
}

TEST(SetUp, RefractionThatIsNotKnownWidensTheHeightAlone) {
  Random random("set_up_refraction");
  const Draw draw = DrawSightings(Wall(6), random, 1);
  SetUpOptions unknown = Options();
  unknown.refraction_k_sigma = 2.0;
  const auto known = SolveSetUp(draw.references, draw.sightings, {}, Options());
  const auto wide = SolveSetUp(draw.references, draw.sightings, {}, unknown);
  ASSERT_TRUE(known && wide);
  EXPECT_GT(wide->covariance(2, 2), 1.01 * known->covariance(2, 2));
  EXPECT_NEAR(wide->covariance(0, 0) / known->covariance(0, 0), 1.0, 0.01);
}

TEST(SetUp, KnownStationNeedsOneBacksight) {
  Random random("set_up_backsight");
  const Draw draw = DrawSightings(Wall(1), random, 1, 0.0);
  StationPrior prior;
  prior.station.p_axes_in_site = kTruth.p_axes_in_site;
  prior.sigma = {0.001, 0.001, 0.001, std::nullopt};
  const auto set_up = SolveSetUp(draw.references, draw.sightings, prior, Options());
  ASSERT_TRUE(set_up);
  EXPECT_LT(std::abs(ErrorOf(*set_up)[3]), 1e-10);
  // Lateral 1 mm at the station and 2 mm at the backsight, 62 m away.
  EXPECT_NEAR(std::sqrt(set_up->covariance(3, 3)), std::hypot(0.001, 0.002) / 62.07, 2e-6);
  EXPECT_EQ(set_up->dof, 2);  // distance and height difference check the points against each other
}

// 30 mm in any coordinate of any of five references.
TEST(SetUp, AReferenceThatMovedIsNamed) {
  Random random("set_up_moved");
  int named = 0;
  int wrong = 0;
  constexpr int kDraws = 300;
  for (int i = 0; i < kDraws; ++i) {
    Draw draw = DrawSightings(Wall(5), random, 1);
    const int bad = random.Index(5);
    draw.references[static_cast<std::size_t>(bad)].p_in_site[random.Index(3)] += 0.03;
    const auto set_up = SolveSetUp(draw.references, draw.sightings, {}, Options());
    if (!set_up) continue;
    named += set_up->left_out == bad;
    wrong += set_up->left_out != bad;
    if (set_up->left_out == bad) {
      EXPECT_LT(ErrorOf(*set_up).head<3>().norm(), 0.01);
      // Its residual still stands in the table.
      EXPECT_GT(set_up->residuals[static_cast<std::size_t>(bad)].standardised, 4.0);
    }
  }
  EXPECT_EQ(wrong, 0);
  // Of the rest two references can be the one: these are refused as inconsistent.
  EXPECT_GE(named, 0.9 * kDraws);
}

TEST(SetUp, TwoReferencesThatDisagreeAreInconsistent) {
  Random random("set_up_two");
  Draw draw = DrawSightings(Wall(2), random, 1);
  draw.references[0].p_in_site.y() += 0.05;
  EXPECT_EQ(SolveSetUp(draw.references, draw.sightings, {}, Options()).error(),
            SetUpFailure::kInconsistent);
}

TEST(SetUp, ExchangedReferencesAreNotBelieved) {
  Random random("set_up_exchanged");
  Draw draw = DrawSightings(Wall(4), random, 1);
  std::swap(draw.references[0], draw.references[3]);
  EXPECT_EQ(SolveSetUp(draw.references, draw.sightings, {}, Options()).error(),
            SetUpFailure::kInconsistent);
}

TEST(SetUp, RefusesWhatCannotBeSolved) {
  Random random("set_up_refusals");
  const Draw one = DrawSightings(Wall(1), random, 1);
  EXPECT_EQ(SolveSetUp(one.references, one.sightings, {}, Options()).error(),
            SetUpFailure::kTooFewSightings);
  Draw angles = DrawSightings(Wall(4), random, 1);
  for (ReferenceSighting& sighting : angles.sightings) sighting.reading.slope_m.reset();
  EXPECT_EQ(SolveSetUp(angles.references, angles.sightings, {}, Options()).error(),
            SetUpFailure::kNoStart);
  Draw stranger = DrawSightings(Wall(2), random, 1);
  stranger.sightings[0].reference = 7;
  EXPECT_EQ(SolveSetUp(stranger.references, stranger.sightings, {}, Options()).error(),
            SetUpFailure::kNoSuchReference);
  // Two references side by side, 60 m away: the station's place across the line is open.
  std::vector<Reference> beside = Wall(1);
  beside.push_back({beside[0].p_in_site + Eigen::Vector3d(1.2, 0.0, 0.0), 0.002});
  const Draw weak = DrawSightings(beside, random, 1);
  EXPECT_EQ(SolveSetUp(weak.references, weak.sightings, {}, Options()).error(),
            SetUpFailure::kWeakGeometry);
}

// Else the one that is no number would be "left out" like a prism that moved.
TEST(SetUp, WhatIsNoNumberIsRefusedAndNotLeftOut) {
  Random random("set_up_not_finite");
  const Draw good = DrawSightings(Wall(5), random, 1);
  const auto refused = [](const Draw& draw) {
    const auto set_up = SolveSetUp(draw.references, draw.sightings, {}, Options());
    return !set_up && set_up.error() == SetUpFailure::kNotFinite;
  };
  const double nan = std::nan("");
  Draw draw = good;
  draw.sightings[2].reading.zenith_rad = nan;
  EXPECT_TRUE(refused(draw));
  draw = good;
  draw.sightings[2].reading.slope_m = nan;
  EXPECT_TRUE(refused(draw));
  draw = good;
  draw.sightings[2].sigma.circle_rad = 0.0;
  EXPECT_TRUE(refused(draw));
  draw = good;
  draw.references[2].p_in_site.x() = nan;
  EXPECT_TRUE(refused(draw));
  draw = good;
  draw.references[2].sigma_m = -0.001;
  EXPECT_TRUE(refused(draw));
  EXPECT_FALSE(refused(good));
}

TEST(SetUp, WhatNothingChecksSaysSo) {
  Random random("set_up_unchecked");
  const Draw draw = DrawSightings(Wall(1), random, 1);
  StationPrior prior;
  prior.station.p_axes_in_site = kTruth.p_axes_in_site;
  prior.sigma = {0.001, 0.001, 0.001, std::nullopt};
  Draw angles = draw;
  angles.sightings[0].reading.slope_m.reset();
  const auto set_up = SolveSetUp(angles.references, angles.sightings, prior, Options());
  ASSERT_TRUE(set_up);
  EXPECT_EQ(set_up->dof, 1);
  EXPECT_NEAR(set_up->residuals[0].circle_rad, 0.0, 1e-10);  // the zero takes all of it
}

// --- the second look ---

struct SecondLook {
  std::vector<Reference> references;
  std::vector<ReferenceSighting> then;
  std::vector<ReferenceSighting> now;
};

SecondLook Look(int count,
                Random& random,
                const Eigen::Vector4d& station_shift,
                int moved,
                const Eigen::Vector3d& by) {
  SecondLook look;
  look.references = Wall(count);
  look.then = DrawSightings(look.references, random, 1).sightings;
  const Station later{kTruth.p_axes_in_site + station_shift.head<3>(),
                      kTruth.circle_zero_bearing_rad + station_shift[3]};
  for (int i = 0; i < count; ++i) {
    Eigen::Vector3d p = look.references[static_cast<std::size_t>(i)].p_in_site;
    if (i == moved) p += by;
    PolarReading reading = *Sight(later, p, {});
    reading.circle_rad += random.Normal(kSigma.circle_rad);
    reading.zenith_rad += random.Normal(kSigma.zenith_rad);
    *reading.slope_m += random.Normal(kSigma.slope_m);
    look.now.push_back({i, reading, kSigma});
  }
  return look;
}

ReferenceCheck Check(const SecondLook& look) {
  return CheckReferences(kTruth, look.references, look.then, look.now, {});
}

TEST(ReferenceCheck, AnUnmovedStationIsGood) {
  Random random("check_good");
  int good = 0;
  for (int i = 0; i < 2000; ++i) {
    good += Check(Look(4, random, Eigen::Vector4d::Zero(), -1, Eigen::Vector3d::Zero())).verdict ==
            CheckVerdict::kGood;
  }
  EXPECT_GE(good, 1992);  // 1998 expected
}

TEST(ReferenceCheck, AStationThatMovedIsFoundWithItsShift) {
  Random random("check_station");
  const Eigen::Vector4d shift(0.004, -0.003, 0.002, 3e-5);
  int found = 0;
  double nees = 0.0;
  for (int i = 0; i < 300; ++i) {
    const ReferenceCheck check = Check(Look(4, random, shift, -1, Eigen::Vector3d::Zero()));
    if (check.verdict != CheckVerdict::kStationMoved) continue;
    ++found;
    const Eigen::Vector4d error = *check.station_shift - shift;
    nees += error.dot(check.shift_covariance.ldlt().solve(error));
  }
  EXPECT_GE(found, 290);
  EXPECT_NEAR(nees / found, 4.0, 0.5);
}

TEST(ReferenceCheck, AReferenceThatMovedIsNamed) {
  Random random("check_reference");
  int named = 0;
  for (int i = 0; i < 300; ++i) {
    const int bad = random.Index(4);
    Eigen::Vector3d by = Eigen::Vector3d::Zero();
    by[random.Index(3)] = 0.012;
    const ReferenceCheck check = Check(Look(4, random, Eigen::Vector4d::Zero(), bad, by));
    EXPECT_NE(check.verdict, CheckVerdict::kGood);
    named += check.moved_reference == bad;
  }
  EXPECT_GE(named, 285);
}

TEST(ReferenceCheck, SaysHowSmallAShiftItSees) {
  Random random("check_sees");
  const auto sees_m =
      Check(Look(4, random, Eigen::Vector4d::Zero(), -1, Eigen::Vector3d::Zero())).sees_m;
  ASSERT_TRUE(sees_m);
  int missed = 0;
  for (int i = 0; i < 500; ++i) {
    const double direction = random.Uniform(0.0, 2 * std::numbers::pi);
    const Eigen::Vector4d shift(
        *sees_m * std::cos(direction), *sees_m * std::sin(direction), 0.0, 0.0);
    missed +=
        Check(Look(4, random, shift, -1, Eigen::Vector3d::Zero())).verdict == CheckVerdict::kGood;
  }
  EXPECT_LE(missed, 25);  // 5 %
  EXPECT_LT(*sees_m, 0.01);
}

TEST(ReferenceCheck, WithoutACommonReferenceThereIsNoVerdict) {
  Random random("check_nothing");
  SecondLook look = Look(2, random, Eigen::Vector4d::Zero(), -1, Eigen::Vector3d::Zero());
  look.then.resize(1);
  look.now.erase(look.now.begin());
  const ReferenceCheck check = Check(look);
  EXPECT_EQ(check.verdict, CheckVerdict::kNothingSeen);
  EXPECT_FALSE(check.sees_m);
}

}  // namespace
}  // namespace tbm
