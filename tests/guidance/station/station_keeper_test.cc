#include "guidance/station/station_keeper.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/guidance/station/station_scene.h"

namespace tbm {
namespace {

using namespace std::chrono_literals;
using test::kArcsec;
using test::StationScene;
using testing::HasSubstr;
using Kind = KeeperNews::Kind;

bool IsGood(const StationScene& scene) { return scene.keeper->health() == SetUpHealth::kGood; }

// A scene that is set up and has measured the shield a few times.
void SetUpAndMeasure(StationScene& scene, Duration span = 2min) {
  scene.Start();
  ASSERT_TRUE(scene.RunUntil([&] { return IsGood(scene); }, 3min)) << scene.AllNews();
  scene.Run(span);
}

Eigen::Vector4d ErrorOf(const StationScene& scene) {
  const Station& station = scene.keeper->state().in_use->station;
  Eigen::Vector4d error;
  error.head<3>() = station.p_axes_in_site - scene.instrument.pillar.p_in_site;
  error[3] =
      HalfTurn(station.circle_zero_bearing_rad - scene.instrument.pillar.circle_zero_bearing_rad);
  return error;
}

TEST(StationKeeper, SetsUpAndMeasuresTheShield) {
  StationScene scene("keeper_plain");
  SetUpAndMeasure(scene);
  EXPECT_TRUE(IsGood(scene));
  EXPECT_EQ(scene.keeper->state().in_use->number, 1u);
  EXPECT_GE(scene.Count(Trust::kGood, ""), 12);
  EXPECT_EQ(scene.Count(Trust::kNone, "wrong_prism"), 0);
  // The first two have nothing that they could be compared with.
  EXPECT_EQ(scene.Count(Trust::kDegraded, "prism_unchecked"), 2);
  EXPECT_LT(scene.WorstGood_m(), 0.004);
  EXPECT_NEAR(scene.keeper->state().in_use->axis_errors.collimation_rad, 8 * kArcsec, 2 * kArcsec);
}

// Normalised errors of the station over many set-ups: four degrees of freedom each.
TEST(StationKeeper, SaysHowGoodTheStationIs) {
  constexpr int kCases = 150;
  double sum = 0.0;
  for (int i = 0; i < kCases; ++i) {
    StationScene scene("keeper_nees", static_cast<std::uint64_t>(i));
    scene.Start();
    ASSERT_TRUE(scene.RunUntil([&] { return IsGood(scene); }, 3min)) << i << scene.AllNews();
    const Eigen::Vector4d error = ErrorOf(scene);
    sum += error.dot(scene.keeper->state().in_use->covariance.inverse() * error);
  }
  // Mean of 600 degrees of freedom / 150: 4 with a sigma of 0.23.
  EXPECT_GT(sum / kCases, 3.2);
  EXPECT_LT(sum / kCases, 4.8);
}

TEST(StationKeeper, KnowsThatNobodyHasSetItUp) {
  StationScene scene("keeper_none");
  scene.is_hidden.assign(16, true);
  scene.Start();
  scene.Run(2min);
  EXPECT_EQ(scene.keeper->health(), SetUpHealth::kNone);
  EXPECT_EQ(scene.keeper->reason(), "not_set_up");
  EXPECT_TRUE(scene.HasNews(Kind::kSetUpFailed));
  EXPECT_FALSE(scene.keeper->AskCheck());
  EXPECT_FALSE(scene.keeper->ProposeMove({}, scene.now));
  EXPECT_FALSE(scene.keeper->Undone());
}

TEST(StationKeeper, AKnockMakesItSuspectWithinTheCheckPeriodUntilItIsSetUpAnew) {
  StationScene scene("keeper_knock");
  SetUpAndMeasure(scene);
  const Timestamp knocked_at = scene.now;
  scene.instrument.pillar.knocks.push_back({knocked_at, {0.004, -0.002, 0.001}, 6 * kArcsec});
  const Timestamp good_until = scene.keeper->state().in_use->last_good_check_at;
  ASSERT_TRUE(scene.RunUntil([&] { return !IsGood(scene); }, scene.options.check_period + 1min));
  scene.Run(5min);
  EXPECT_FALSE(IsGood(scene)) << "no check may lift it: it stands elsewhere";
  EXPECT_EQ(scene.keeper->reason(), "station_moved");
  EXPECT_EQ(scene.keeper->last_verdict(), CheckVerdict::kStationMoved);
  EXPECT_NEAR(scene.keeper->station_shift()->x(), 0.004, 0.001);
  const Timestamp last_good = scene.keeper->state().in_use->last_good_check_at;
  EXPECT_LT(last_good, knocked_at);
  EXPECT_GE(last_good, good_until);
  EXPECT_LT(scene.WorstGood_m(last_good), 0.004);
  EXPECT_GT(scene.Count(Trust::kDegraded, "set_up_suspect", -1, knocked_at), 5);
  for (const auto& one : scene.told) {
    EXPECT_FALSE(one.judged.reason == "set_up_suspect" && one.judged.p_in_site);
  }
  const Timestamp asked_at = scene.now;
  ASSERT_TRUE(scene.keeper->AskSetUp({}));
  ASSERT_TRUE(scene.RunUntil([&] { return IsGood(scene); }, 3min)) << scene.AllNews();
  scene.Run(2min);
  EXPECT_EQ(scene.keeper->state().in_use->number, 2u);
  EXPECT_GT(scene.Count(Trust::kGood, "", -1, asked_at), 5);
}

TEST(StationKeeper, ADriftingPillarIsFoundBeforeItMatters) {
  StationScene scene("keeper_drift");
  scene.options.check_period = 5min;
  scene.instrument.pillar.drift_m_per_s = Eigen::Vector3d(0.006, 0.0, -0.003) / 3600.0;
  SetUpAndMeasure(scene);
  ASSERT_TRUE(scene.RunUntil([&] { return !IsGood(scene); }, 2h));
  EXPECT_EQ(scene.keeper->reason(), "station_moved");
  const double drifted_m = SecondsBetween(scene.instrument.pillar.since, scene.now) *
                           scene.instrument.pillar.drift_m_per_s.norm();
  EXPECT_LT(drifted_m, 0.004);
  // Up to the last good check it had drifted by less than what a check finds.
  EXPECT_LT(scene.WorstGood_m(scene.keeper->state().in_use->last_good_check_at), 0.006);
}

TEST(StationKeeper, AStationThatIsBackIsBelievedAgain) {
  StationScene scene("keeper_back");
  SetUpAndMeasure(scene);
  const Timestamp at = scene.now;
  scene.instrument.pillar.knocks.push_back({at, {0.005, 0.0, 0.0}, 0.0});
  scene.instrument.pillar.knocks.push_back({at + 20min, {-0.005, 0.0, 0.0}, 0.0});
  ASSERT_TRUE(scene.RunUntil([&] { return !IsGood(scene); }, 11min));
  ASSERT_TRUE(scene.RunUntil([&] { return IsGood(scene); }, 20min));
  EXPECT_GT(scene.now, at + 20min);
  EXPECT_GT(scene.keeper->state().in_use->last_good_check_at, at + 20min);
}

TEST(StationKeeper, ADoubtIsNotLiftedByACheckThatDoesNotSeeWhatHadDisagreed) {
  StationScene scene("keeper_lift");
  SetUpAndMeasure(scene);
  // Two references go in different directions, then out of sight: what is left agrees.
  scene.references[0].x() += 0.01;
  scene.references[3].z() += 0.01;
  ASSERT_TRUE(scene.RunUntil([&] { return !IsGood(scene); }, 11min));
  EXPECT_EQ(scene.keeper->reason(), "check_unclear");
  scene.is_hidden[0] = scene.is_hidden[3] = true;
  scene.Run(10min);
  EXPECT_FALSE(IsGood(scene));
  scene.is_hidden[0] = scene.is_hidden[3] = false;
  scene.references[0].x() -= 0.01;
  scene.references[3].z() -= 0.01;
  EXPECT_TRUE(scene.RunUntil([&] { return IsGood(scene); }, 10min));
}

TEST(StationKeeper, OneMovedReferenceIsNamedAndTheOthersVouch) {
  StationScene scene("keeper_reference");
  SetUpAndMeasure(scene);
  scene.references[1].y() += 0.008;
  ASSERT_TRUE(scene.RunUntil([&] { return !IsGood(scene); }, 11min));
  EXPECT_EQ(scene.keeper->reason(), "reference_disagrees");
  // Measured once more in both faces: then it is sure, and the set-up rests on the others.
  ASSERT_TRUE(scene.RunUntil([&] { return IsGood(scene); }, 3min)) << scene.AllNews();
  EXPECT_THAT(scene.keeper->moved_references(), testing::ElementsAre("R2"));
  EXPECT_THAT(scene.AllNews(), HasSubstr("reference R2 has moved; the others stand"));
  scene.Run(25min);
  EXPECT_TRUE(IsGood(scene));
  EXPECT_LT(scene.WorstGood_m(), 0.004);
  // A knock is still found by the others.
  scene.instrument.pillar.knocks.push_back({scene.now, {0.006, 0.0, 0.0}, 0.0});
  EXPECT_TRUE(scene.RunUntil([&] { return scene.keeper->reason() == "station_moved"; }, 11min));
}

TEST(StationKeeper, AReferenceThatWasSurveyedWrongIsLeftOutOfTheSetUp) {
  StationScene scene("keeper_left_out");
  scene.Start();
  // The keeper's coordinates are those of the start; the prism stands elsewhere.
  scene.references[4] += Eigen::Vector3d(0.02, 0.01, 0.0);
  ASSERT_TRUE(scene.RunUntil([&] { return IsGood(scene); }, 3min)) << scene.AllNews();
  EXPECT_THAT(scene.keeper->moved_references(), testing::ElementsAre("R5"));
  EXPECT_EQ(scene.keeper->state().in_use->references[4].reason, "left_out");
  EXPECT_FALSE(scene.keeper->state().in_use->references[4].is_used);
  EXPECT_LT(ErrorOf(scene).head<3>().norm(), 0.002);
}

TEST(StationKeeper, WithoutReferencesNothingVouchesForIt) {
  StationScene scene("keeper_hidden_references");
  SetUpAndMeasure(scene);
  const Timestamp last_good = scene.keeper->state().in_use->last_good_check_at;
  for (std::size_t i = 0; i < 5; ++i) scene.is_hidden[i] = true;
  ASSERT_TRUE(scene.RunUntil([&] { return !IsGood(scene); }, 15min));
  EXPECT_EQ(scene.keeper->reason(), "references_not_seen");
  EXPECT_EQ(scene.keeper->state().in_use->last_good_check_at, last_good);
  for (std::size_t i = 0; i < 5; ++i) scene.is_hidden[i] = false;
  EXPECT_TRUE(scene.RunUntil([&] { return IsGood(scene); }, 5min));
}

TEST(StationKeeper, AHiddenPrismIsMissedAndTheOthersGoOn) {
  StationScene scene("keeper_hidden_prism");
  SetUpAndMeasure(scene);
  scene.is_hidden[5 + 1] = true;
  const Timestamp at = scene.now;
  scene.Run(2min);
  EXPECT_GE(scene.keeper->times_missed(1), 4);
  EXPECT_EQ(scene.keeper->times_missed(0), 0);
  EXPECT_GT(scene.Count(Trust::kNone, "no_target", 1, at), 3);
  EXPECT_EQ(scene.Count(Trust::kGood, "", 1, at), 0);
  EXPECT_LT(scene.WorstGood_m(), 0.004);
}

// left, right and top make an isosceles triangle: no distance tells left from right, only that the
// machine would stand the other way round.
TEST(StationKeeper, SwappedPrismsAreFoundByGeometry) {
  for (const bool believes : {false, true}) {
    StationScene scene("keeper_swapped");
    SetUpAndMeasure(scene);
    scene.believes = believes;
    scene.Run(1min);
    scene.believes = false;  // a guidance that is mistaken must not be made one's own
    const Timestamp at = scene.now;
    scene.taken_for_it = {1, 0, 2};
    scene.Run(3min);
    EXPECT_EQ(scene.Count(Trust::kGood, "", 0, at) + scene.Count(Trust::kGood, "", 1, at), 0);
    EXPECT_GT(scene.Count(Trust::kNone, "swapped_prism", -1, at) +
                  scene.Count(Trust::kNone, "wrong_prism", -1, at),
              5);
    EXPECT_LT(scene.WorstGood_m(), 0.004);
    scene.taken_for_it = {0, 1, 2};
    const Timestamp back_at = scene.now;
    scene.Run(3min);
    EXPECT_GT(scene.Count(Trust::kGood, "", 0, back_at), 3);
  }
}

TEST(StationKeeper, SwappedFromTheStartIsFoundAsWell) {
  StationScene scene("keeper_swapped_start");
  scene.options.prisms[2].p_in_rear_shield = {-1.0, 0.7, 2.9};  // not isosceles
  scene.taken_for_it = {1, 0, 2};
  SetUpAndMeasure(scene, 4min);
  EXPECT_LT(scene.WorstGood_m(), 0.004);
  EXPECT_EQ(scene.Count(Trust::kGood, "", 0) + scene.Count(Trust::kGood, "", 1), 0);
  EXPECT_GT(scene.Count(Trust::kNone, "swapped_prism"), 3);
}

TEST(StationKeeper, AVestOrTheWrongPrismIsNeverGood) {
  StationScene scene("keeper_vest");
  SetUpAndMeasure(scene);
  // Where the left prism was, its view now blocked, somebody stands 0.3 m beside.
  scene.is_hidden[5] = true;
  scene.vest = scene.Place(0) + Eigen::Vector3d(-0.3, 0.1, -0.2);
  Timestamp at = scene.now;
  scene.Run(2min);
  EXPECT_GT(scene.Count(Trust::kNone, "wrong_prism", 0, at), 3);
  EXPECT_EQ(scene.Count(Trust::kGood, "", 0, at), 0);
  EXPECT_GT(scene.Count(Trust::kGood, "", 1, at) +
                scene.Count(Trust::kDegraded, "prism_unchecked", 1, at),
            3);
  scene.is_hidden[5] = false;
  scene.vest.reset();
  scene.Run(1min);
  // Recognition goes to the second nearest each time.
  at = scene.now;
  for (int i = 0; i < 20; ++i) {
    scene.instrument.takes_wrong_prism = true;
    scene.Run(5s);
  }
  EXPECT_GT(scene.Count(Trust::kNone, "wrong_prism", -1, at), 3);
  EXPECT_LT(scene.WorstGood_m(), 0.004);
}

TEST(StationKeeper, FollowsTheMachineThatAdvances) {
  StationScene scene("keeper_advance");
  SetUpAndMeasure(scene);
  scene.believes = true;
  scene.speed_m_per_s = 1e-3;
  const Timestamp at = scene.now;
  scene.Run(30min);
  EXPECT_EQ(scene.Count(Trust::kNone, "wrong_prism", -1, at), 0);
  EXPECT_GT(scene.Count(Trust::kGood, "", -1, at), 150);
  EXPECT_LT(scene.WorstGood_m(), 0.004);
}

// The rear shield is pulled up to the next stroke while guidance still says it stands.
TEST(StationKeeper, AShieldThatJumpsIsFoundByTheDistances) {
  StationScene scene("keeper_jump");
  SetUpAndMeasure(scene);
  scene.believes = true;
  scene.Run(1min);
  scene.believes = false;
  scene.shield.translation += scene.shield.rotation * Eigen::Vector3d(0.4, 0.0, 0.0);
  const Timestamp at = scene.now;
  scene.Run(90s);
  EXPECT_GT(scene.Count(Trust::kNone, "wrong_prism", -1, at), 0) << "the first ones";
  EXPECT_GT(scene.Count(Trust::kGood, "", -1, at), 3);
  EXPECT_LT(scene.WorstGood_m(), 0.004);
}

TEST(StationKeeper, ComesBackSuspectAfterARestart) {
  StationScene scene("keeper_restart");
  SetUpAndMeasure(scene, 12min);
  const std::uint64_t number = scene.keeper->state().in_use->number;
  scene.Restart();
  EXPECT_EQ(scene.keeper->health(), SetUpHealth::kSuspect);
  EXPECT_EQ(scene.keeper->reason(), "restarted");
  const Timestamp at = scene.now;
  ASSERT_TRUE(scene.RunUntil([&] { return IsGood(scene); }, 3min)) << scene.AllNews();
  EXPECT_EQ(scene.keeper->state().in_use->number, number);
  EXPECT_EQ(scene.Count(Trust::kGood, "", -1, at), 0) << "first the references";
  // Moved while it was off.
  scene.instrument.pillar.knocks.push_back({scene.now, {0.01, 0.0, 0.0}, 0.0});
  scene.Restart();
  scene.Run(3min);
  EXPECT_EQ(scene.keeper->reason(), "station_moved");
}

TEST(StationKeeper, AnotherInstrumentHasNoSetUp) {
  StationScene scene("keeper_other");
  SetUpAndMeasure(scene);
  scene.keeper->SetInstrument(78);
  EXPECT_EQ(scene.keeper->health(), SetUpHealth::kNone);
  EXPECT_EQ(scene.keeper->reason(), "other_instrument");
  ASSERT_TRUE(scene.RunUntil([&] { return IsGood(scene); }, 3min));
  EXPECT_EQ(scene.keeper->state().in_use->instrument, 78);
  EXPECT_EQ(scene.keeper->state().in_use->number, 2u) << "never the same number again";
}

class StationMove : public testing::Test {
 protected:
  void SetUp() override {
    scene_.control_reference = 4;
    SetUpAndMeasure(scene_);
    ASSERT_TRUE(scene_.keeper->Pause());
    ASSERT_TRUE(scene_.RunUntil([&] { return scene_.keeper->is_paused(); }, 3min));
    EXPECT_TRUE(scene_.HasNews(Kind::kPaused));
    old_ = scene_.keeper->state();
  }
  void Carry() {
    scene_.instrument.pillar.p_in_site = {1000.6, 2008.0, 50.4};
    scene_.instrument.pillar.circle_zero_bearing_rad = 1.9;
  }
  bool Propose() {
    EXPECT_TRUE(scene_.keeper->ProposeMove({{1000.4, 2008.2, 50.3}, 1.895}, scene_.now));
    return scene_.RunUntil(
        [&] { return scene_.HasNews(Kind::kMoveProposed) || scene_.HasNews(Kind::kMoveFailed); },
        5min);
  }
  StationScene scene_{"keeper_move"};
  KeptStation old_;
};

TEST_F(StationMove, IsTakenOverWholeWhenItCloses) {
  Carry();
  ASSERT_TRUE(Propose()) << scene_.AllNews();
  ASSERT_TRUE(scene_.keeper->proposed() && scene_.keeper->proposed()->closure) << scene_.AllNews();
  const Closure& closure = *scene_.keeper->proposed()->closure;
  EXPECT_EQ(closure.points, 4) << "three prisms and the control";
  EXPECT_LT(closure.worst_m, 0.003);
  EXPECT_EQ(scene_.keeper->state().in_use->number, old_.in_use->number) << "not yet";
  EXPECT_EQ(scene_.keeper->health(), SetUpHealth::kSuspect);
  auto taken = scene_.keeper->TakenOver(scene_.now);
  ASSERT_TRUE(taken);
  scene_.keeper->AdoptTakenOver(*taken);
  EXPECT_TRUE(IsGood(scene_));
  EXPECT_EQ(scene_.keeper->state().in_use->number, 2u);
  EXPECT_EQ(scene_.keeper->state().previous->number, 1u);
  EXPECT_LT(ErrorOf(scene_).head<3>().norm(), 0.002);
  const Timestamp at = scene_.now;
  scene_.Run(12min);
  EXPECT_TRUE(IsGood(scene_));
  EXPECT_GT(scene_.Count(Trust::kGood, "", -1, at), 20);
  EXPECT_LT(scene_.WorstGood_m(), 0.004);
}

TEST_F(StationMove, IsRefusedWithTheFigureWhenItDoesNotClose) {
  Carry();
  scene_.shield.translation.y() += 0.02;  // the machine went on meanwhile
  ASSERT_TRUE(Propose());
  ASSERT_TRUE(scene_.keeper->proposed());
  const auto taken = scene_.keeper->TakenOver(scene_.now);
  ASSERT_FALSE(taken);
  EXPECT_THAT(taken.error(), HasSubstr("allowed are 5.0 mm"));
  EXPECT_THAT(taken.error(), testing::ContainsRegex("the closure is (19|20|21)\\.[0-9] mm"));
  ASSERT_TRUE(scene_.keeper->GiveUpMove());
  EXPECT_FALSE(scene_.keeper->proposed());
  EXPECT_EQ(scene_.keeper->reason(), "move_given_up");
  scene_.Run(5min);
  EXPECT_FALSE(IsGood(scene_)) << "the instrument is not where the old set-up says";
  EXPECT_EQ(scene_.keeper->state().in_use->number, 1u);
}

TEST_F(StationMove, GivenUpWithoutHavingMovedGoesOnAsBefore) {
  ASSERT_TRUE(scene_.keeper->ProposeMove(scene_.keeper->state().in_use->station, scene_.now));
  ASSERT_TRUE(scene_.RunUntil([&] { return scene_.HasNews(Kind::kMoveProposed); }, 5min));
  ASSERT_TRUE(scene_.keeper->GiveUpMove());
  ASSERT_TRUE(scene_.keeper->Resume());
  EXPECT_TRUE(scene_.RunUntil([&] { return IsGood(scene_); }, 3min)) << scene_.AllNews();
}

TEST_F(StationMove, CanBeUndone) {
  Carry();
  ASSERT_TRUE(Propose());
  scene_.keeper->AdoptTakenOver(*scene_.keeper->TakenOver(scene_.now));
  scene_.Run(2min);
  const auto undone = scene_.keeper->Undone();
  ASSERT_TRUE(undone);
  scene_.keeper->AdoptUndone(*undone);
  EXPECT_EQ(scene_.keeper->state().in_use->number, 1u);
  EXPECT_EQ(scene_.keeper->state().previous->number, 2u);
  EXPECT_EQ(scene_.keeper->reason(), "undone");
  const Timestamp at = scene_.now;
  scene_.Run(3min);
  EXPECT_FALSE(IsGood(scene_)) << "suspect until it is carried back";
  EXPECT_EQ(scene_.Count(Trust::kGood, "", -1, at), 0);
  scene_.instrument.pillar.p_in_site = {1000.0, 2000.0, 50.0};
  scene_.instrument.pillar.circle_zero_bearing_rad = 0.25;
  EXPECT_TRUE(scene_.RunUntil([&] { return IsGood(scene_); }, 10min)) << scene_.AllNews();
}

TEST_F(StationMove, SaysWhatIsMissing) {
  EXPECT_FALSE(scene_.keeper->TakenOver(scene_.now));
  EXPECT_FALSE(scene_.keeper->GiveUpMove());
  EXPECT_FALSE(scene_.keeper->Undone());
  Carry();
  for (std::size_t i = 0; i < 16; ++i) scene_.is_hidden[i] = true;
  ASSERT_TRUE(Propose());
  EXPECT_TRUE(scene_.HasNews(Kind::kMoveFailed));
  EXPECT_FALSE(scene_.keeper->TakenOver(scene_.now));
  // While it is under way nothing else is begun.
  EXPECT_FALSE(scene_.keeper->AskCheck());
  EXPECT_FALSE(scene_.keeper->AskSetUp({}));
  EXPECT_FALSE(scene_.keeper->Pause());
  EXPECT_EQ(scene_.keeper->state().in_use->number, old_.in_use->number);
}

// Two references exchanged fit two distances as well: the place tells.
TEST(StationKeeper, ASetUpFarFromWhereItWasSaidToStandIsRefused) {
  StationScene scene("keeper_far");
  scene.options.start_within_m = 0.05;
  scene.Start();
  scene.Run(2min);
  EXPECT_EQ(scene.keeper->health(), SetUpHealth::kNone);
  EXPECT_THAT(scene.AllNews(), HasSubstr("from where it was said to stand"));
}

}  // namespace
}  // namespace tbm
