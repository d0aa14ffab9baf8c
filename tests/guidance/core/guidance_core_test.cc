#include "guidance/core/guidance_core.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "tests/guidance/core/core_bench.h"

namespace tbm::test {
namespace {

TEST_F(Core, StartsWithNothingAndSaysWhatIsMissing) {
  const Snapshot& snapshot = core_.Advance({}, at_);
  EXPECT_EQ(snapshot.rear.worth, Worth::kInvalid);
  EXPECT_EQ(snapshot.rear.reason, GuidanceReason::kNoSetUp);
  EXPECT_EQ(snapshot.front.reason, GuidanceReason::kNoRelativePose);
  EXPECT_EQ(Cutter().worth, Worth::kInvalid);
  EXPECT_EQ(snapshot.station.freshness, Freshness::kMissing);
  EXPECT_FALSE(snapshot.station.age_s);
  EXPECT_FALSE(snapshot.lead || snapshot.joint || snapshot.ring_number || snapshot.fix);
  EXPECT_TRUE(snapshot.ahead.empty());
  core_.Advance({}, at_ + seconds(3));
  EXPECT_EQ(StateOf(GuidanceAlarm::kPositionLost), AlarmState::kUnacknowledged);
  EXPECT_EQ(StateOf(GuidanceAlarm::kSetUpNotGood), AlarmState::kUnacknowledged);
  EXPECT_EQ(StateOf(GuidanceAlarm::kDeviationHigh), AlarmState::kNormal);
}

TEST_F(Core, WithAllSourcesEveryNumberIsValid) {
  const Snapshot& snapshot = Begin();
  EXPECT_EQ(snapshot.rear.worth, Worth::kValid);
  EXPECT_EQ(snapshot.front.worth, Worth::kValid);
  for (const PointState& point : snapshot.points) EXPECT_EQ(point.worth, Worth::kValid);
  ASSERT_TRUE(snapshot.lead && snapshot.joint && snapshot.ring_number);
  EXPECT_EQ(snapshot.fix->prisms_used, 4);
  // Counted at the rear shield's datum, which is the point `rear`; rings of 1.5 m from 2000 m on.
  EXPECT_EQ(
      *snapshot.ring_number,
      1 + static_cast<std::int64_t>((snapshot.points[3].deviation.chainage.m - 2000.0) / 1.5));
  EXPECT_GE(*snapshot.joint->stroke_m, -0.01);
  EXPECT_LE(*snapshot.joint->stroke_m, 1.21);
  EXPECT_EQ(snapshot.ahead.size(), 20u);
  // What is common to all looks is in the band from its beginning; what may happen on the way only
  // grows.
  EXPECT_GT(snapshot.ahead[0].right.sigma_m, Cutter().deviation.right_sigma_m * 1.2);
  for (std::size_t i = 1; i < snapshot.ahead.size(); ++i) {
    EXPECT_GT(snapshot.ahead[i].right.sigma_m, snapshot.ahead[i - 1].right.sigma_m);
  }
}

TEST_F(Core, WithTheStationBlockedTheNumbersCoastSaySoAndThenEnd) {
  Begin();
  const double fresh_m = Cutter().deviation.right_sigma_m;
  CameraGoesOn(seconds(45));
  EXPECT_EQ(Cutter().worth, Worth::kValid);  // within two periods of the station
  CameraGoesOn(seconds(240));
  EXPECT_EQ(core_.snapshot().station.freshness, Freshness::kCoasting);
  EXPECT_EQ(Cutter().worth, Worth::kDegraded);
  EXPECT_EQ(Cutter().reason, GuidanceReason::kStationCoasting);
  EXPECT_EQ(core_.snapshot().front.age_s, core_.snapshot().rear.age_s);  // the older of both
  EXPECT_NEAR(core_.snapshot().rear.age_s, 240.0, 30.0);
  // The law of guidance/shield/coast.h: 0.02 mm/s across at the rear shield's datum, and 0.8
  // microrad/s of turning over the 8 m to the cutter.
  const double age_s = core_.snapshot().rear.age_s;
  const double lever_m =
      (Cutter().p_in_site.p - core_.snapshot().rear.site_from_shield.b_from_a.translation).norm();
  const double grown_m = std::sqrt(fresh_m * fresh_m + std::pow(2e-5 * age_s, 2) +
                                   std::pow(8e-7 * age_s * lever_m, 2));
  EXPECT_NEAR(Cutter().deviation.right_sigma_m / grown_m, 1.0, 0.05);
  CameraGoesOn(seconds(800));
  EXPECT_EQ(Cutter().worth, Worth::kDegraded);
  CameraGoesOn(seconds(930));
  EXPECT_EQ(core_.snapshot().station.freshness, Freshness::kStale);
  EXPECT_EQ(Cutter().worth, Worth::kInvalid);
  EXPECT_EQ(Cutter().reason, GuidanceReason::kStationStale);
  EXPECT_FALSE(core_.snapshot().lead);
  EXPECT_TRUE(core_.snapshot().ahead.empty());
}

TEST_F(Core, WithTheCameraDirtyTheFrontShieldCoastsAndThenEnds) {
  Begin();
  StationGoesOn(seconds(20));
  EXPECT_EQ(core_.snapshot().rear.worth, Worth::kValid);
  EXPECT_EQ(core_.snapshot().front.worth, Worth::kDegraded);
  EXPECT_EQ(core_.snapshot().front.reason, GuidanceReason::kCameraCoasting);
  EXPECT_NEAR(core_.snapshot().front.age_s, 20.0 + begun_with_s_, 1e-6);  // of the fix below it
  const Eigen::Matrix3d now = core_.snapshot().front.site_from_shield.covariance.block<3, 3>(3, 3);
  // 1 mm/s along, in 20 s.
  EXPECT_GT(std::sqrt(now.trace()), 0.02);
  EXPECT_FALSE(core_.snapshot().joint);  // nothing is seen of the joint now
  StationGoesOn(seconds(130));
  EXPECT_EQ(core_.snapshot().front.worth, Worth::kInvalid);
  EXPECT_EQ(core_.snapshot().front.reason, GuidanceReason::kCameraStale);
  EXPECT_EQ(core_.snapshot().rear.worth, Worth::kValid);
}

TEST_F(Core, AFrameWithoutAPoseIsNoPoseAndItsReasonIsTold) {
  Begin();
  RelativeSeen nothing;
  nothing.sensed_at = at_ + milliseconds(300);
  nothing.reason = PoseReason::kTooFewLeds;
  core_.Advance(std::vector<GuidanceInput>{nothing}, at_ + milliseconds(400));
  EXPECT_EQ(core_.snapshot().camera_trouble, PoseReason::kTooFewLeds);
  EXPECT_EQ(core_.snapshot().front.worth, Worth::kValid);  // the last one is half a second old
  EXPECT_LT(core_.snapshot().valid_at, nothing.sensed_at);
}

TEST_F(Core, APrismThatWasKnockedIsLeftOutAndNamed) {
  for (GuidanceInput& input : round_) {
    auto* prism = std::get_if<PrismSeen>(&input);
    if (prism != nullptr && prism->prism == 2) prism->p_in_site += Eigen::Vector3d(0.04, 0.03, 0.0);
  }
  Begin();
  ASSERT_TRUE(core_.snapshot().fix && core_.snapshot().fix->left_out);
  EXPECT_EQ(*core_.snapshot().fix->left_out, 2);
  EXPECT_EQ(core_.snapshot().rear.worth, Worth::kDegraded);
  EXPECT_EQ(core_.snapshot().rear.reason, GuidanceReason::kPrismLeftOut);
  CameraGoesOn(seconds(2));
  EXPECT_EQ(StateOf(GuidanceAlarm::kPrismsDisagree), AlarmState::kUnacknowledged);
}

TEST_F(Core, TwoPrismsTakenForEachOtherArePutRight) {
  Begin();
  const Eigen::Vector3d truth = core_.snapshot().rear.site_from_shield.b_from_a.translation;
  GuidanceCore other(TheMachine().machine, TheMachine().rig, TheMachine().axis);
  for (GuidanceInput& input : round_) {
    auto* prism = std::get_if<PrismSeen>(&input);
    if (prism != nullptr && prism->prism < 2) prism->prism = 1 - prism->prism;
  }
  const Snapshot& snapshot = other.Advance(round_, at_);
  ASSERT_TRUE(snapshot.fix && snapshot.fix->exchanged);
  EXPECT_EQ(snapshot.rear.reason, GuidanceReason::kPrismsExchanged);
  EXPECT_LT((snapshot.rear.site_from_shield.b_from_a.translation - truth).norm(), 0.002);
}

// Only RS1 is in sight: with the tilt and the heading of a while ago the place is still measured.
TEST_F(Core, OnePrismTheTiltAndAnEarlierHeadingPlaceTheRearShieldAndSayHowWeakThatIs) {
  Begin();
  const Rigid3 before = core_.snapshot().rear.site_from_shield.b_from_a;
  auto inputs = Later(Without<SetUpKnown>(round_), seconds(100));
  std::erase_if(inputs, [](const GuidanceInput& input) {
    const auto* prism = std::get_if<PrismSeen>(&input);
    return prism != nullptr && prism->prism != 0;
  });
  for (GuidanceInput& input : inputs) {
    if (auto* prism = std::get_if<PrismSeen>(&input)) prism->p_in_site.z() += 0.02;
  }
  core_.Advance(inputs, at_ + seconds(100));
  const ShieldState& rear = core_.snapshot().rear;
  ASSERT_TRUE(core_.snapshot().fix);
  EXPECT_EQ(core_.snapshot().fix->prisms_used, 1);
  EXPECT_EQ(rear.worth, Worth::kDegraded);
  EXPECT_EQ(rear.reason, GuidanceReason::kFewPrisms);
  EXPECT_NEAR(rear.site_from_shield.b_from_a.translation.z() - before.translation.z(), 0.02, 0.002);
  EXPECT_NEAR(HeadingOf(rear.site_from_shield.b_from_a), HeadingOf(before), 1e-6);
  // The heading is as uncertain as it was, and what 100 s of the coasting law add.
  const double grown_rad = 8e-7 * 88.0;
  EXPECT_GT(std::sqrt(rear.attitude_covariance(0, 0)), 0.9 * grown_rad);
  // A second look at one prism does not make the old heading newer.
  const double sigma_rad = std::sqrt(rear.attitude_covariance(0, 0));
  core_.Advance(Later(inputs, seconds(100)), at_ + seconds(200));
  EXPECT_GT(std::sqrt(core_.snapshot().rear.attitude_covariance(0, 0)), 1.18 * sigma_rad);
}

TEST_F(Core, OnePrismWithoutAnyHeadingIsNoPose) {
  auto inputs = round_;
  std::erase_if(inputs, [](const GuidanceInput& input) {
    const auto* prism = std::get_if<PrismSeen>(&input);
    return prism != nullptr && prism->prism != 0;
  });
  core_.Advance(inputs, at_);
  EXPECT_EQ(core_.snapshot().rear.worth, Worth::kInvalid);
  EXPECT_EQ(core_.snapshot().rear.reason, GuidanceReason::kTooFewPrisms);
}

TEST_F(Core, LateAndDoubledInputsChangeNothing) {
  Begin();
  const Eigen::Vector3d said = Cutter().p_in_site.p;
  auto late = Later(round_, -seconds(5));
  for (GuidanceInput& input : late) {
    if (auto* prism = std::get_if<PrismSeen>(&input)) prism->p_in_site.y() += 1.0;
    if (auto* pose = std::get_if<RelativeSeen>(&input)) {
      pose->camera_from_target.b_from_a.translation.x() += 1.0;
    }
  }
  core_.Advance(Without<TiltSeen>(late), at_);
  EXPECT_EQ(Cutter().p_in_site.p, said);
  core_.Advance(Without<TiltSeen>(round_), at_);
  EXPECT_EQ(Cutter().p_in_site.p, said);
}

TEST_F(Core, AClockThatIsSetBackMakesEverythingMeasuredUnknown) {
  Begin();
  core_.Advance({}, at_ - seconds(3600));
  EXPECT_EQ(core_.snapshot().rear.worth, Worth::kInvalid);
  EXPECT_EQ(core_.snapshot().station.freshness, Freshness::kMissing);
  // The next round counts under the new clock, with the set-up that is still the same.
  core_.Advance(Later(Without<SetUpKnown>(round_), -seconds(3600)), at_ - seconds(3600));
  EXPECT_EQ(Cutter().worth, Worth::kValid);
}

TEST_F(Core, BeyondTheEndOfTheDesignThereIsNoDeviation) {
  auto far_off = round_;
  const AxisPoint end = *TheMachine().axis.At(TheMachine().axis.end());
  const Eigen::Vector3d move = *end.p_in_site() + 10.0 * *end.direction_in_site() - [&] {
    Begin();
    return Cutter().p_in_site.p;
  }();
  GuidanceCore other(TheMachine().machine, TheMachine().rig, TheMachine().axis);
  for (GuidanceInput& input : far_off) {
    if (auto* prism = std::get_if<PrismSeen>(&input)) prism->p_in_site += move;
  }
  const Snapshot& snapshot = other.Advance(far_off, at_);
  EXPECT_EQ(snapshot.front.worth, Worth::kValid);  // it is known where it is
  const PointState& cutter = snapshot.points[TheMachine().machine.steer_by];
  EXPECT_EQ(cutter.worth, Worth::kInvalid);
  EXPECT_EQ(cutter.reason, GuidanceReason::kBeyondEnd);
}

TEST_F(Core, AnAlarmIsRaisedAnsweredAndClearedWithHysteresis) {
  Machine strict = TheMachine().machine;
  Begin();
  const Deviation said = Cutter().deviation;
  const double off_m = std::hypot(said.right_m, *said.up_m);
  strict.deviation_m = {0.9 * off_m, 0.8 * off_m};
  GuidanceCore core(strict, TheMachine().rig, TheMachine().axis);
  const auto state = [&] { return core.alarms().alarm(0).state; };
  const auto live = Without<SetUpKnown>(Without<PrismSeen>(round_));
  core.Advance(round_, at_);
  EXPECT_EQ(state(), AlarmState::kNormal);  // not yet for long enough
  core.Advance(Later(live, seconds(3)), at_ + seconds(3));
  EXPECT_EQ(state(), AlarmState::kUnacknowledged);
  core.Advance(std::vector<GuidanceInput>{AlarmOrder{0}}, at_ + seconds(3));
  EXPECT_EQ(state(), AlarmState::kAcknowledged);
  // The camera fails for good: nothing is known, so nothing is cleared.
  for (int s = 4; s < 400; ++s) core.Advance({}, at_ + seconds(s));
  EXPECT_EQ(core.snapshot().points[strict.steer_by].worth, Worth::kInvalid);
  EXPECT_EQ(state(), AlarmState::kAcknowledged);
}

TEST_F(Core, TheSameInputsGiveTheSameBits) {
  GuidanceCore again(TheMachine().machine, TheMachine().rig, TheMachine().axis);
  Drive drive(TheMachine(), {}, "same bits");
  for (int i = 0; i < 60; ++i) {
    drive.Measure(2060.0 + 5.0 * i);
    const Snapshot& a = core_.Advance(drive.inputs(), drive.now());
    const Snapshot& b = again.Advance(drive.inputs(), drive.now());
    ASSERT_EQ(a.front.worth, b.front.worth);
    ASSERT_EQ(a.front.site_from_shield.b_from_a, b.front.site_from_shield.b_from_a);
    ASSERT_EQ(a.front.site_from_shield.covariance, b.front.site_from_shield.covariance);
    ASSERT_EQ(a.ahead.size(), b.ahead.size());
    if (!a.ahead.empty()) {
      ASSERT_EQ(a.ahead.back().right.off_m, b.ahead.back().right.off_m);
    }
  }
}

TEST(GuidanceReasons, EachHasAWordOfItsOwn) {
  std::vector<std::string> words;
  for (int i = 0; i < kGuidanceReasonCount; ++i) {
    words.emplace_back(ReasonCode(static_cast<GuidanceReason>(i)));
    EXPECT_LE(words.back().size(), 48u);
  }
  EXPECT_EQ(words.front(), "");
  std::sort(words.begin(), words.end());
  EXPECT_EQ(std::adjacent_find(words.begin(), words.end()), words.end());
}

}  // namespace
}  // namespace tbm::test
