#include "pose/centres/assign_leds.h"

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <new>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pose/base/angle.h"
#include "tests/pose/centres/assign_draws.h"

namespace {
long allocations = 0;
}  // namespace

// GCC sees malloc behind new and free behind delete only after inlining, and takes it for a
// mismatch.
#pragma GCC diagnostic ignored "-Wmismatched-new-delete"

void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace tbm::test {
namespace {

Result<Assignment, AssignFailure> Assign(const Rig& rig, const Draw& draw) {
  return AssignLeds(rig, draw.centres, draw.target_tilt, draw.camera_tilt, draw.prior);
}

// The image comes from a rig with other intrinsics, LED places and mountings than the one solved
// with.
TEST(AssignLeds, CalibrationErrorsWithinTheirSigmasCostNothing) {
  Random random("assign_as_built");
  const Rig declared = DeclaredRig();
  Tally tally;
  for (int i = 0; i < 600; ++i) {
    const Rig as_built = AsBuilt(declared, random);
    const Draw draw = DrawFrame(as_built, Visible(5, 5, FalseSpots::kClustered, 10), random);
    const auto result = Assign(declared, draw);
    tally.Add(AnswerTo(draw, result));
    if (result) tally.leds_missed += 5 - static_cast<int>(result->leds.size());
  }
  Print("as built", tally);
  EXPECT_GE(tally.RightShare(), 0.995);
  EXPECT_LE(tally.WrongShare(), 0.001);
  EXPECT_LE(tally.leds_missed, 20);
}

// With the same errors but none declared the gates are too narrow: what the sigmas are for.
TEST(AssignLeds, UndeclaredCalibrationErrorsCostLeds) {
  Random random("assign_undeclared");
  const Rig declared = DeclaredRig();
  Tally tally;
  for (int i = 0; i < 300; ++i) {
    const Rig as_built = AsBuilt(declared, random);
    DrawOptions options = Visible(5, 5, FalseSpots::kUniform, 0);
    options.centre_sigma_px = 0.03;
    const Draw draw = DrawFrame(as_built, options, random);
    const auto result = Assign(FieldRig(), draw);
    tally.Add(AnswerTo(draw, result));
    if (result) tally.leds_missed += 5 - static_cast<int>(result->leds.size());
  }
  Print("undeclared", tally);
  EXPECT_LT(tally.right - tally.leds_missed, 290);
  EXPECT_EQ(tally.wrong, 0);
}

TEST(AssignLeds, APriorStandsInForTilts) {
  Random random("assign_prior_no_tilts");
  Tally tally;
  for (int i = 0; i < 1000; ++i) {
    Draw draw =
        DrawFrame(DeclaredRig(), WithPrior(Visible(3, 5, FalseSpots::kClustered, 10)), random);
    draw.camera_tilt.reset();
    const auto result = Assign(DeclaredRig(), draw);
    tally.Add(AnswerTo(draw, result));
    if (result) {
      EXPECT_TRUE(result->without_tilts);
      EXPECT_TRUE(result->used_prior);
    }
  }
  Print("prior, no tilts", tally);
  EXPECT_GE(tally.RightShare(), 0.99);
  EXPECT_LE(tally.WrongShare(), 0.001);
}

TEST(AssignLeds, AWrongPriorDoesNotOverruleFiveLeds) {
  Random random("assign_wrong_prior");
  for (int i = 0; i < 300; ++i) {
    Draw draw = DrawFrame(FieldRig(), WithPrior(Visible(5, 5, FalseSpots::kUniform, 10)), random);
    draw.prior->camera_from_target.translation += Eigen::Vector3d(0.1, -0.2, 0.5);
    const auto result = Assign(FieldRig(), draw);
    ASSERT_EQ(AnswerTo(draw, result), Answer::kRight);
    EXPECT_EQ(result->leds.size(), 5u);
    EXPECT_FALSE(result->used_prior);
  }
}

TEST(AssignLeds, WithoutTiltsFiveLedsNameThemselvesByVision) {
  Random random("assign_vision");
  Tally tally;
  for (int i = 0; i < 100; ++i) {
    Draw draw = DrawFrame(DeclaredRig(), Visible(5, 5, FalseSpots::kUniform, 2), random);
    draw.target_tilt.reset();
    const auto result = Assign(DeclaredRig(), draw);
    tally.Add(AnswerTo(draw, result));
    if (result) {
      EXPECT_TRUE(result->without_tilts);
    }
  }
  Print("vision", tally);
  EXPECT_GE(tally.RightShare(), 0.98);
  EXPECT_EQ(tally.wrong, 0);
}

// A plane target of four looks the same turned by half a turn: without tilts nothing tells.
TEST(AssignLeds, ASymmetricTargetIsAmbiguousWithoutTilts) {
  Rig rig = FieldRig();
  rig.leds.pop_back();
  Random random("assign_symmetric");
  for (int i = 0; i < 50; ++i) {
    Draw draw = DrawFrame(rig, Visible(4, 4, FalseSpots::kUniform, 0), random);
    EXPECT_EQ(AnswerTo(draw, Assign(rig, draw)), Answer::kRight) << "tilts tell up from down";
    draw.target_tilt.reset();
    const auto result = Assign(rig, draw);
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error(), AssignFailure::kAmbiguous);
  }
}

// Four LEDs that a quarter turn about the vertical maps onto each other.
TEST(AssignLeds, ATargetSymmetricAboutTheVerticalIsAmbiguousWithTilts) {
  Rig rig = PublishedRig();
  rig.leds.resize(4);
  const Eigen::Vector3d corner[4] = {{0.2, 0, 0}, {0, 0, 0.2}, {-0.2, 0, 0}, {0, 0, -0.2}};
  for (std::size_t i = 0; i < 4; ++i) {
    rig.leds[i].p_led_in_target = corner[i] + Eigen::Vector3d(0, 0.25, 0);
  }
  Random random("assign_turntable");
  DrawOptions options = Visible(4, 4, FalseSpots::kUniform, 0);
  options.range.relative_angle_rad = 0.0;  // plumb: its axis of symmetry is the vertical
  options.range.camera_tilt_rad = 0.0;
  for (int i = 0; i < 50; ++i) {
    const Draw draw = DrawFrame(rig, options, random);
    const auto result = Assign(rig, draw);
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error(), AssignFailure::kAmbiguous);
    Draw guided = draw;
    guided.prior = PosePrior{draw.truth.camera_from_target, 1e-4 * PoseCovariance::Identity()};
    const auto decided = Assign(rig, guided);
    EXPECT_EQ(AnswerTo(guided, decided), Answer::kRight);
    if (decided) {
      EXPECT_TRUE(decided->used_prior);
    }
  }
}

// One output of one inclinometer off by this much.
void Disturb(Draw& draw, double off_deg, Random& random) {
  Inclination& inclination =
      random.Unit() < 0.5 ? draw.target_tilt->inclination : draw.camera_tilt->inclination;
  double& angle_rad = random.Unit() < 0.5 ? inclination.beta_rad : inclination.gamma_rad;
  angle_rad += DegToRad(random.Unit() < 0.5 ? -off_deg : off_deg);
}

TEST(AssignLeds, ATiltFourDegreesOffIsNeverBelievedAndTheRetryNamesTheLeds) {
  for (const double off_deg : {0.3, 4.0}) {
    Random random("assign_wrong_tilt", static_cast<std::uint64_t>(10.0 * off_deg));
    Tally first;
    Tally retry;
    for (int i = 0; i < 150; ++i) {
      Draw draw = DrawFrame(DeclaredRig(), Visible(4, 5, FalseSpots::kUniform, i % 3), random);
      Disturb(draw, off_deg, random);
      auto result = Assign(DeclaredRig(), draw);
      first.Add(AnswerTo(draw, result));
      if (!result) {
        result = AssignLedsDoubtingTilts(
            DeclaredRig(), draw.centres, draw.target_tilt, draw.camera_tilt, draw.prior);
        if (result) {
          EXPECT_TRUE(result->without_tilts);
        }
      }
      retry.Add(AnswerTo(draw, result));
    }
    Print("tilt off, degrees x 10: " + std::to_string(static_cast<int>(10.0 * off_deg)), first);
    Print("  and after the retry", retry);
    EXPECT_EQ(first.wrong + retry.wrong, 0);
    EXPECT_GE(retry.RightShare(), 0.995);
    if (off_deg >= 4.0) {
      EXPECT_EQ(first.right, 0);
    }
  }
}

// Three that agree with the wrong tilt by chance are rare: hence many draws.
TEST(AssignLeds, ThreeLedsThatAgreeWithAWrongTiltAreNotBelieved) {
  Random random("assign_chance_three");
  int wrong = 0;
  for (int i = 0; i < 2500; ++i) {
    Draw draw = DrawFrame(DeclaredRig(), Visible(4, 5, FalseSpots::kUniform, i % 2), random);
    Disturb(draw, random.Uniform(1.0, 5.0), random);
    wrong += AnswerTo(draw, Assign(DeclaredRig(), draw)) == Answer::kWrong;
  }
  EXPECT_EQ(wrong, 0);
}

Rig Board(int leds) {
  Rig rig = FieldRig();
  Random random("assign_board", static_cast<std::uint64_t>(leds));
  rig.leds.clear();
  for (int i = 0; i < leds; ++i) {
    const Eigen::Vector3d p_led_in_target(
        random.Uniform(-0.3, 0.3), random.Uniform(-0.3, 0.3), random.Uniform(0.0, 0.25));
    rig.leds.push_back({"P" + std::to_string(i + 1), p_led_in_target, 0.0});
  }
  return rig;
}

TEST(AssignLeds, ThreeLedRigIsNamedWhenNothingElseShines) {
  const Tally tally =
      AssignDraws(Board(3), Board(3), Visible(3, 3, FalseSpots::kUniform, 1), 1000, "board 3");
  Print("board of 3", tally);
  EXPECT_GE(tally.RightShare(), 0.95);
  EXPECT_LE(tally.WrongShare(), 0.001);
}

TEST(AssignLeds, TwelveLedRigIsNamedAmongTwentyFalseSpots) {
  const Tally tally =
      AssignDraws(Board(12), Board(12), Visible(8, 12, FalseSpots::kClustered, 20), 25, "board 12");
  Print("board of 12", tally);
  EXPECT_GE(tally.RightShare(), 0.95);
  EXPECT_EQ(tally.wrong, 0);
}

TEST(AssignLeds, FiveLedsAreNamedAmongTwentyFalseSpots) {
  const Tally tally =
      AssignDraws(FieldRig(), FieldRig(), Visible(4, 5, FalseSpots::kUniform, 20), 200, "twenty");
  Print("20 false spots", tally);
  EXPECT_GE(tally.RightShare(), 0.99);
  EXPECT_EQ(tally.wrong, 0);
}

// Every row of the rig and of the centres full. LEDs among the brightest 32 spots are still found.
TEST(AssignLeds, SixtyFourSpotsAreAnsweredToo) {
  Random random("assign_sixty_four");
  for (int i = 0; i < 20; ++i) {
    Draw draw = DrawFrame(FieldRig(), Visible(5, 5, FalseSpots::kUniform, 59), random);
    for (std::size_t s = 0; s < draw.centres.size(); ++s) {
      draw.centres[s].peak_dn += draw.led_of_spot[s] >= 0 ? 100.0 : 0.0;
    }
    ASSERT_TRUE(draw.centres.full());
    EXPECT_EQ(AnswerTo(draw, Assign(FieldRig(), draw)), Answer::kRight);
  }
}

TEST(AssignLeds, OrderOfSpotsDoesNotMatter) {
  Random random("assign_order");
  for (int i = 0; i < 200; ++i) {
    const Draw draw = DrawFrame(
        DeclaredRig(), WithPrior(Visible(2, 5, FalseSpots::kClustered, random.Index(11))), random);
    const auto result = Assign(DeclaredRig(), draw);
    Draw reversed = draw;
    std::reverse(reversed.centres.begin(), reversed.centres.end());
    const auto again = Assign(DeclaredRig(), reversed);
    ASSERT_EQ(result.has_value(), again.has_value());
    if (!result) continue;
    ASSERT_EQ(result->leds.size(), again->leds.size());
    for (std::size_t k = 0; k < result->leds.size(); ++k) {
      EXPECT_EQ(result->leds[k].led_index, again->leds[k].led_index);
      EXPECT_EQ(result->leds[k].pixel_px, again->leds[k].pixel_px);
    }
    EXPECT_EQ(result->camera_from_target.translation, again->camera_from_target.translation);
    EXPECT_EQ(result->camera_from_target.rotation.coeffs(),
              again->camera_from_target.rotation.coeffs());
  }
}

TEST(AssignLeds, OneSpotPerLedAndOneLedPerSpot) {
  Random random("assign_one_to_one");
  for (int i = 0; i < 300; ++i) {
    DrawOptions options = Visible(2, 5, FalseSpots::kGhosts, 10);
    options.centre_sigma_px = 1.0;  // gates as wide as the ghosts are away
    const auto result = Assign(FieldRig(), DrawFrame(FieldRig(), WithPrior(options), random));
    if (!result) continue;
    ASSERT_EQ(result->leds.size(), result->spot_of_led.size());
    for (std::size_t a = 0; a < result->leds.size(); ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        EXPECT_NE(result->leds[a].led_index, result->leds[b].led_index);
        EXPECT_NE(result->spot_of_led[a], result->spot_of_led[b]);
      }
    }
  }
}

// How many of 200 frames of machines built as `declared` allows are named right.
int RightAsBuilt(const Rig& declared, const char* stream) {
  Random random(stream);
  int right = 0;
  for (int i = 0; i < 200; ++i) {
    const Rig as_built = AsBuilt(declared, random);
    const Draw draw = DrawFrame(as_built, Visible(5, 5, FalseSpots::kUniform, 2), random);
    right += AnswerTo(draw, Assign(declared, draw)) == Answer::kRight;
  }
  return right;
}

// A rig whose principal point was never measured well: the verticals then turn with it.
TEST(AssignLeds, APoorlyKnownPrincipalPointWidensTheGates) {
  Rig declared = FieldRig();
  declared.intrinsics_sigma_px = {0.0, 0.0, 8.0, 8.0};
  EXPECT_GE(RightAsBuilt(declared, "assign_principal_point"), 198);
}

// The same for inclinometers bolted on by eye.
TEST(AssignLeds, PoorlyKnownMountingsWidenTheGates) {
  Rig declared = FieldRig();
  declared.target_tilt.mounting_sigma_rad = declared.camera_tilt.mounting_sigma_rad =
      DegToRad(0.15);
  EXPECT_GE(RightAsBuilt(declared, "assign_mountings"), 198);
}

// Centres good to 1.5 px leave wide gates, and among twenty spots beside the target one may well
// stand where a dark LED would be: it is left out rather than believed.
TEST(AssignLeds, ASpotThatMayBeChanceIsLeftOut) {
  DrawOptions options = WithPrior(Visible(4, 4, FalseSpots::kClustered, 20));
  options.centre_sigma_px = 1.5;
  const Tally tally = AssignDraws(FieldRig(), FieldRig(), options, 600, "assign_left_out");
  Print("left out", tally);
  EXPECT_GE(tally.RightShare(), 0.85);
  EXPECT_LE(tally.WrongShare(), 0.01);
}

// Old spots that still look like the target where it was, beside the target where it is now.
TEST(AssignLeds, FiveLedsOutweighAPriorThatThreeOldReflectionsSupport) {
  Random random("assign_outweighs");
  for (int i = 0; i < 100; ++i) {
    Draw draw = DrawFrame(FieldRig(), WithPrior(Visible(5, 5, FalseSpots::kUniform, 0)), random);
    draw.prior->camera_from_target = draw.truth.camera_from_target;
    draw.prior->camera_from_target.translation += Eigen::Vector3d(0.12, -0.09, 0.5);
    for (const int led : {0, 2, 4}) {
      Centre old_spot = draw.centres[0];
      old_spot.pixel_px =
          ExactPixel(FieldRig().camera,
                     draw.prior->camera_from_target *
                         FieldRig().leds[static_cast<std::size_t>(led)].p_led_in_target);
      draw.centres.push_back(old_spot);
      draw.led_of_spot.push_back(-1);
    }
    const auto result = Assign(FieldRig(), draw);
    ASSERT_EQ(AnswerTo(draw, result), Answer::kRight);
    EXPECT_EQ(result->leds.size(), 5u);
  }
}

// Two LEDs 3 mm apart and one of them dark: the other's spot lies in the gates of both.
TEST(AssignLeds, TwoLedsNeverShareASpot) {
  Rig rig = FieldRig();
  rig.leds.push_back({"P6", rig.leds[0].p_led_in_target + Eigen::Vector3d(0.003, 0, 0), 0.0});
  Random random("assign_shared");
  for (int i = 0; i < 300; ++i) {
    DrawOptions options = Visible(4, 5, FalseSpots::kUniform, 1);
    options.centre_sigma_px = 1.0;
    const auto result = Assign(rig, DrawFrame(rig, WithPrior(options), random));
    if (!result) continue;
    for (std::size_t a = 0; a < result->leds.size(); ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        EXPECT_NE(result->spot_of_led[a], result->spot_of_led[b]);
      }
    }
  }
}

// Seen on a recorded run: glare 15 px beside an LED, its own sigma 4 px, made the frame ambiguous.
TEST(AssignLeds, GlareOfPixelsSigmaBesideAnLedIsNoRival) {
  Random random("assign_glare");
  for (int i = 0; i < 200; ++i) {
    Draw draw = DrawFrame(DeclaredRig(), Visible(3, 5, FalseSpots::kUniform, 0), random);
    const std::size_t leds = draw.centres.size();
    for (std::size_t k = 0; k < leds; ++k) {
      Centre glare = draw.centres[k];
      glare.pixel_px += Eigen::Vector2d(-12.0, 7.0);
      glare.sigma_px = 4.0;
      draw.centres.push_back(glare);
      draw.led_of_spot.push_back(-1);
    }
    const Answer answer = AnswerTo(draw, Assign(DeclaredRig(), draw));
    Draw clean = draw;
    clean.centres.resize(leds);
    clean.led_of_spot.resize(leds);
    ASSERT_EQ(answer, AnswerTo(clean, Assign(DeclaredRig(), clean))) << "draw " << i;
  }
}

TEST(AssignLeds, ReturnsCentresAsTheyWereGivenAndAPoseNearTheTruth) {
  Random random("assign_output");
  const Draw draw = DrawFrame(FieldRig(), Visible(5, 5, FalseSpots::kUniform, 5), random);
  const auto result = Assign(FieldRig(), draw);
  ASSERT_TRUE(result);
  ASSERT_EQ(result->leds.size(), 5u);
  for (std::size_t i = 0; i < 5; ++i) {
    const Centre& centre = draw.centres[static_cast<std::size_t>(result->spot_of_led[i])];
    EXPECT_EQ(result->leds[i].pixel_px, centre.pixel_px);
    EXPECT_EQ(result->leds[i].sigma_px, centre.sigma_px);
  }
  const PoseError error = ErrorBetween(result->camera_from_target, draw.truth.camera_from_target);
  EXPECT_LT(error.head<3>().norm(), DegToRad(0.2));
  EXPECT_LT(error.tail<3>().norm(), 0.01);
  EXPECT_FALSE(result->used_prior);
  EXPECT_FALSE(result->without_tilts);
}

TEST(AssignLeds, ExactCentresWithoutSigmaAreAccepted) {
  Random random("assign_exact");
  for (int i = 0; i < 100; ++i) {
    DrawOptions options = Visible(4, 5, FalseSpots::kUniform, 3);
    options.centre_sigma_px = 0.0;
    options.tilt_sigma_rad = 0.0;
    const Draw draw = DrawFrame(PublishedRig(), options, random);
    EXPECT_EQ(AnswerTo(draw, Assign(PublishedRig(), draw)), Answer::kRight);
  }
}

TEST(AssignLeds, FalseSpotsAloneAreNeverATarget) {
  Random random("assign_only_false");
  Tally tally;
  for (int i = 0; i < 1000; ++i) {
    const Draw draw =
        DrawFrame(DeclaredRig(), Visible(0, 0, FalseSpots::kUniform, 2 + random.Index(12)), random);
    tally.Add(AnswerTo(draw, Assign(DeclaredRig(), draw)));
  }
  Print("only false spots", tally);
  EXPECT_LE(tally.wrong, 2);
}

TEST(AssignLeds, SaysWhenThereAreTooFewSpots) {
  Random random("assign_too_few");
  Draw draw = DrawFrame(FieldRig(), Visible(1, 1, FalseSpots::kUniform, 0), random);
  EXPECT_EQ(Assign(FieldRig(), draw).error(), AssignFailure::kTooFewCentres);
  draw = DrawFrame(FieldRig(), Visible(2, 2, FalseSpots::kUniform, 0), random);
  EXPECT_EQ(Assign(FieldRig(), draw).error(), AssignFailure::kAmbiguous);
  draw.camera_tilt.reset();
  EXPECT_EQ(Assign(FieldRig(), draw).error(), AssignFailure::kTooFewCentres);
  draw.centres.clear();
  EXPECT_EQ(Assign(FieldRig(), draw).error(), AssignFailure::kTooFewCentres);
}

// With limits 0.3 m this side of the board, and 0.3 m beyond it; with a pose of a moment ago too.
TEST(AssignLeds, WhatStandsOutsideTheDistancesIsNotTheTarget) {
  Random random("assign_distances");
  for (int i = 0; i < 100; ++i) {
    const bool with_prior = i % 2 == 0;
    const DrawOptions visible = Visible(5, 5, FalseSpots::kUniform, 2);
    const Draw draw = DrawFrame(FieldRig(), with_prior ? WithPrior(visible) : visible, random);
    AssignOptions nearer;
    nearer.max_distance_m = draw.truth.camera_from_target.translation.z() - 0.3;
    AssignOptions farther;
    farther.min_distance_m = draw.truth.camera_from_target.translation.z() + 0.3;
    for (const AssignOptions& options : {nearer, farther}) {
      EXPECT_FALSE(AssignLeds(
          FieldRig(), draw.centres, draw.target_tilt, draw.camera_tilt, draw.prior, options));
    }
    EXPECT_TRUE(Assign(FieldRig(), draw));
  }
}

// Two spots so near each other that every pair of LEDs would be beyond the greatest distance.
TEST(AssignLeds, SaysWhenNoSetOfSpotsCanBeTheTarget) {
  Random random("assign_no_match");
  Draw draw = DrawFrame(FieldRig(), Visible(0, 0, FalseSpots::kUniform, 2), random);
  draw.centres[1].pixel_px = draw.centres[0].pixel_px + Eigen::Vector2d(0.5, 0.3);
  EXPECT_EQ(Assign(FieldRig(), draw).error(), AssignFailure::kNoMatch);
}

TEST(AssignLeds, NumbersThatAreNoneAreLeftOut) {
  Random random("assign_nan");
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  Draw draw = DrawFrame(FieldRig(), WithPrior(Visible(5, 5, FalseSpots::kUniform, 3)), random);
  Centre broken = draw.centres[0];
  broken.pixel_px.x() = kNan;
  draw.centres.push_back(broken);
  draw.led_of_spot.push_back(-1);
  broken = draw.centres[0];
  broken.sigma_px = -1.0;
  draw.centres.push_back(broken);
  draw.led_of_spot.push_back(-1);
  draw.prior->covariance(3, 3) = kNan;
  EXPECT_EQ(AnswerTo(draw, Assign(FieldRig(), draw)), Answer::kRight);
  draw.camera_tilt->inclination.beta_rad = kNan;
  const auto without = Assign(FieldRig(), draw);
  if (without) {
    EXPECT_TRUE(without->without_tilts);
  }
  EXPECT_NE(AnswerTo(draw, without), Answer::kWrong);
}

TEST(AssignLeds, TouchesNoHeap) {
  Random random("assign_no_heap");
  const Rig rig = DeclaredRig();
  for (const int false_spots : {0, 3, 10}) {
    Draw draw =
        DrawFrame(rig, WithPrior(Visible(3, 5, FalseSpots::kClustered, false_spots)), random);
    const long before = allocations;
    const bool named = Assign(rig, draw).has_value();
    draw.prior.reset();
    const bool alone = Assign(rig, draw).has_value();
    const bool doubting =
        AssignLedsDoubtingTilts(rig, draw.centres, draw.target_tilt, draw.camera_tilt, draw.prior)
            .has_value();
    EXPECT_EQ(allocations, before) << named << alone << doubting;
  }
}

}  // namespace
}  // namespace tbm::test
