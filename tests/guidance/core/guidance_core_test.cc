#include "guidance/core/guidance_core.h"

#include <cmath>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/drive.h"

namespace tbm::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

const GuidedMachine& TheMachine() {
  static const GuidedMachine machine = ExampleMachine();
  return machine;
}

std::vector<GuidanceInput> Later(std::vector<GuidanceInput> inputs, Duration by) {
  for (GuidanceInput& input : inputs) {
    std::visit(
        [&](auto& one) {
          if constexpr (requires { one.sensed_at; }) one.sensed_at = one.sensed_at + by;
        },
        input);
  }
  return inputs;
}
template <class Kind>
std::vector<GuidanceInput> Only(const std::vector<GuidanceInput>& inputs) {
  std::vector<GuidanceInput> some;
  for (const GuidanceInput& input : inputs) {
    if (std::holds_alternative<Kind>(input)) some.push_back(input);
  }
  return some;
}
template <class Kind>
std::vector<GuidanceInput> Without(const std::vector<GuidanceInput>& inputs) {
  std::vector<GuidanceInput> some;
  for (const GuidanceInput& input : inputs) {
    if (!std::holds_alternative<Kind>(input)) some.push_back(input);
  }
  return some;
}

// A machine that stands still: one round of readings, and the core that got it.
class Core : public testing::Test {
 protected:
  Core() : drive_(TheMachine(), {}, "guidance core") {
    drive_.Measure(2100.0);
    round_ = drive_.inputs();
    at_ = drive_.now();
  }

  const Snapshot& Begin() {
    core_.Advance(round_, at_);
    begun_with_s_ = core_.snapshot().station.age_s.value_or(0.0);
    return core_.snapshot();
  }
  // What keeps coming while one source is silent: the camera's poses, every five seconds.
  const Snapshot& CameraGoesOn(Duration after) {
    const auto live = Without<SetUpKnown>(Without<PrismSeen>(round_));
    while (went_on_ + seconds(5) < after) {
      went_on_ += seconds(5);
      core_.Advance(Later(live, went_on_), at_ + went_on_);
    }
    went_on_ = after;
    return core_.Advance(Later(live, after), at_ + after);
  }
  // The target comes nearer to the camera by so much along the shield's x axis.
  static std::vector<GuidanceInput> Closed(std::vector<GuidanceInput> inputs, double closed_m) {
    const Rigid3& rear_from_camera = TheMachine().machine.geometry.rear_shield_from_camera.b_from_a;
    for (GuidanceInput& input : inputs) {
      if (auto* pose = std::get_if<RelativeSeen>(&input)) {
        pose->camera_from_target.b_from_a.translation +=
            rear_from_camera.rotation.conjugate() * Eigen::Vector3d(-closed_m, 0.0, 0.0);
      }
    }
    return inputs;
  }
  const Snapshot& StationGoesOn(Duration after) {
    return core_.Advance(Later(Without<RelativeSeen>(round_), after), at_ + after);
  }
  // The round again, later, and everything seen 30 mm further east: the pillar was knocked.
  std::vector<GuidanceInput> Knocked(Duration after) const {
    auto knocked = Later(Without<SetUpKnown>(round_), after);
    for (GuidanceInput& input : knocked) {
      if (auto* prism = std::get_if<PrismSeen>(&input)) prism->p_in_site.x() += 0.03;
    }
    return knocked;
  }
  SetUpKnown SuspectSince(Timestamp last_good) const {
    SetUpKnown set_up = std::get<SetUpKnown>(Only<SetUpKnown>(round_).front());
    set_up.trusted_until = last_good;
    return set_up;
  }
  const PointState& Cutter() const {
    return core_.snapshot().points[TheMachine().machine.steer_by];
  }
  AlarmState StateOf(GuidanceAlarm alarm) const {
    return core_.alarms().alarm(static_cast<std::size_t>(alarm)).state;
  }
  void Answer(GuidanceAlarm alarm, Timestamp now) {
    core_.Advance(std::vector<GuidanceInput>{AlarmOrder{static_cast<std::size_t>(alarm)}}, now);
  }

  Drive drive_;
  std::vector<GuidanceInput> round_;
  Timestamp at_;
  Duration went_on_{};
  double begun_with_s_ = 0.0;  // age of the first fix
  GuidanceCore core_{TheMachine().machine, TheMachine().rig, TheMachine().axis};
};

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

// Stroke done, the rear shield is pulled after the front one at 10 mm/s, and the sight to the
// prisms is blocked by it.
TEST_F(Core, ARegripWithTheStationBlockedMovesTheRearShieldAndNotTheFrontOne) {
  Begin();
  const Rigid3 rear = core_.snapshot().rear.site_from_shield.b_from_a;
  const Rigid3 front = core_.snapshot().front.site_from_shield.b_from_a;
  const auto live = Without<SetUpKnown>(Without<PrismSeen>(round_));
  for (int i = 1; i <= 600; ++i) {
    const Duration after = milliseconds(200 * i);
    core_.Advance(Closed(Later(live, after), std::min(0.8, 0.010 * 0.2 * i)), at_ + after);
  }
  const ShieldState& rear_now = core_.snapshot().rear;
  const ShieldState& front_now = core_.snapshot().front;
  const Eigen::Vector3d went = rear_now.site_from_shield.b_from_a.translation - rear.translation;
  const Eigen::Vector3d ahead = rear.rotation * Eigen::Vector3d::UnitX();
  const double drifted_m = std::abs(rear_now.speed_m_per_s) * 125.0;  // of the fix' own speed
  EXPECT_NEAR(went.dot(ahead), 0.8, 0.02 + drifted_m);
  EXPECT_LT((went - went.dot(ahead) * ahead).norm(), 1e-6);
  EXPECT_LT((front_now.site_from_shield.b_from_a.translation - front.translation).norm(),
            0.02 + drifted_m);
  // It says what it does not know of the way: 2 % of it along, 3 mm/m across.
  const Eigen::Matrix3d covariance = rear_now.site_from_shield.covariance.bottomRightCorner<3, 3>();
  EXPECT_GT(std::sqrt(ahead.dot(covariance * ahead)), 0.016);
  EXPECT_GT(Cutter().deviation.right_sigma_m, 0.003);
  EXPECT_NE(Cutter().worth, Worth::kInvalid);
}

// The same while the front shield bores: the joint opens, and the rear shield stands.
TEST_F(Core, ABoringStrokeDoesNotMoveTheRearShield) {
  Begin();
  const Rigid3 rear = core_.snapshot().rear.site_from_shield.b_from_a;
  const auto live = Without<SetUpKnown>(Without<PrismSeen>(round_));
  for (int i = 1; i <= 300; ++i) {
    const Duration after = milliseconds(200 * i);
    const double shaking_m = 0.0015 * std::sin(1.3 * i);  // vibration closes and opens it again
    core_.Advance(Closed(Later(live, after), -0.0002 * i + shaking_m), at_ + after);
  }
  const double drifted_m = std::abs(core_.snapshot().rear.speed_m_per_s) * 75.0;
  EXPECT_LT((core_.snapshot().rear.site_from_shield.b_from_a.translation - rear.translation).norm(),
            0.001 + drifted_m);
}

// Prisms measured one after the other while the shield is pulled: the joint says how far each was.
TEST_F(Core, ARoundOfPrismsInTheMiddleOfARegripMakesAFix) {
  Begin();
  const Rigid3 before = core_.snapshot().rear.site_from_shield.b_from_a;
  const Eigen::Vector3d ahead = before.rotation * Eigen::Vector3d::UnitX();
  const auto live = Without<SetUpKnown>(Without<PrismSeen>(round_));
  const auto prisms = Only<PrismSeen>(round_);
  std::size_t measured = 0;
  // Pulled by 10 mm/s from 10 s to 30 s, standing before and behind; a prism every 8 s.
  for (int i = 1; i <= 250; ++i) {
    const Duration after = milliseconds(200 * i);
    const double closed_m = 0.010 * std::clamp(0.2 * i - 10.0, 0.0, 20.0);
    auto inputs = Closed(Later(live, after), closed_m);
    if (i % 40 == 30 && measured < prisms.size()) {
      PrismSeen prism = std::get<PrismSeen>(prisms[measured++]);
      prism.sensed_at = at_ + after;
      prism.p_in_site += closed_m * ahead;
      inputs.push_back(prism);
    }
    core_.Advance(inputs, at_ + after);
  }
  ASSERT_EQ(measured, 4u);
  EXPECT_EQ(core_.snapshot().fix_trouble, GuidanceReason::kNone);
  ASSERT_TRUE(core_.snapshot().fix);
  EXPECT_EQ(core_.snapshot().fix->prisms_used, 4);
  EXPECT_FALSE(core_.snapshot().fix->left_out);
  const Eigen::Vector3d went =
      core_.snapshot().rear.site_from_shield.b_from_a.translation - before.translation;
  EXPECT_NEAR(went.dot(ahead), 0.2, 0.02);
}

// Both shields advance as one, and the joint stays as it is: the prisms themselves tell the speed.
TEST_F(Core, PrismsMeasuredWhileBothShieldsAdvanceTellTheSpeed) {
  Begin();
  const Rigid3 standing = core_.snapshot().rear.site_from_shield.b_from_a;
  GuidanceCore other(TheMachine().machine, TheMachine().rig, TheMachine().axis);
  const Eigen::Vector3d ahead = standing.rotation * Eigen::Vector3d::UnitX();
  auto moving = round_;
  for (GuidanceInput& input : moving) {
    if (auto* prism = std::get_if<PrismSeen>(&input)) {
      prism->p_in_site += 0.0015 * SecondsBetween(at_, prism->sensed_at) * ahead;
    }
  }
  const Snapshot& snapshot = other.Advance(moving, at_);
  ASSERT_EQ(snapshot.rear.worth, Worth::kValid);
  EXPECT_NEAR(snapshot.rear.speed_m_per_s, 0.0015, 4.0 * snapshot.rear.speed_sigma_m_per_s);
  EXPECT_GT(snapshot.rear.speed_m_per_s, 0.001);
}

// Nobody watches the joint: along the drive the rear shield may be wherever a regrip takes it.
TEST_F(Core, WithoutTheCameraARegripMayHaveTakenPlace) {
  Begin();
  core_.Advance({}, at_ + seconds(50));
  const ShieldState& rear = core_.snapshot().rear;
  ASSERT_NE(rear.worth, Worth::kInvalid);
  const Eigen::Vector3d ahead = rear.site_from_shield.b_from_a.rotation * Eigen::Vector3d::UnitX();
  const Eigen::Matrix3d covariance = rear.site_from_shield.covariance.bottomRightCorner<3, 3>();
  EXPECT_GT(std::sqrt(ahead.dot(covariance * ahead)), 0.3);
}

TEST(JointClosing, CountsWhatClosesAndNothingElse) {
  JointClosing joint;
  const Timestamp begin{1'700'000'000'000'000'000};
  EXPECT_FALSE(joint.Between(begin, begin));
  const auto at = [&](double s) {
    return Timestamp{begin.ns + static_cast<std::int64_t>(s * 1e9)};
  };
  const auto length = [](double s) {  // bores 0.3 m, closes it, bores again
    if (s < 300.0) return 3.0 + 0.001 * s;
    return s < 330.0 ? 3.3 - 0.01 * (s - 300.0) : 3.0 + 0.001 * (s - 330.0);
  };
  for (int i = 0; i <= 4000; ++i) joint.Add(at(0.1 * i), length(0.1 * i));
  EXPECT_NEAR(*joint.Between(at(0), at(299)), 0.0, 1e-12);
  EXPECT_NEAR(*joint.Between(at(0), at(400)), 0.3, 0.006);
  EXPECT_NEAR(*joint.Between(at(310), at(320)), 0.1, 0.011);
  EXPECT_NEAR(*joint.Between(at(320), at(310)), -0.1, 0.011);
  EXPECT_FALSE(joint.Between(at(-5), at(10)));
  EXPECT_FALSE(joint.Between(at(10), at(430)));
  // A gap, or a pose that cannot be: nothing is known of what was before.
  joint.Add(at(430), 3.07);
  EXPECT_FALSE(joint.Between(at(399), at(430)));
  joint.Add(at(431), 3.37);
  EXPECT_FALSE(joint.Between(at(429), at(431)));
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

TEST_F(Core, WhatWasSeenSinceTheLastGoodCheckIsNotUsedWhenTheStationIsSuspect) {
  Begin();
  const Eigen::Vector3d before = core_.snapshot().rear.site_from_shield.b_from_a.translation;
  // The pillar was knocked after the check.
  core_.Advance(Knocked(seconds(40)), at_ + seconds(40));
  EXPECT_NEAR(
      core_.snapshot().rear.site_from_shield.b_from_a.translation.x() - before.x(), 0.03, 0.003);
  SetUpKnown set_up = SuspectSince(at_ + seconds(5));
  const auto live = Later(Without<SetUpKnown>(Without<PrismSeen>(round_)), seconds(41));
  auto with_check = live;
  with_check.insert(with_check.begin(), set_up);
  core_.Advance(with_check, at_ + seconds(41));
  EXPECT_EQ(core_.snapshot().rear.worth, Worth::kDegraded);
  EXPECT_EQ(core_.snapshot().rear.reason, GuidanceReason::kSetUpSuspect);
  EXPECT_LT((core_.snapshot().rear.site_from_shield.b_from_a.translation - before).norm(), 0.01);
  EXPECT_NEAR(core_.snapshot().rear.age_s, 45.0, 12.0);
  went_on_ = seconds(41);
  CameraGoesOn(seconds(43));
  EXPECT_EQ(StateOf(GuidanceAlarm::kSetUpNotGood), AlarmState::kUnacknowledged);
  // The check was repeated and is good: the readings count again.
  set_up.trusted_until.reset();
  core_.Advance(std::vector<GuidanceInput>{set_up}, at_ + seconds(44));
  EXPECT_NEAR(
      core_.snapshot().rear.site_from_shield.b_from_a.translation.x() - before.x(), 0.03, 0.003);
  EXPECT_EQ(core_.snapshot().fix_trouble, GuidanceReason::kNone);
}

// The pillar was knocked and the camera went blind before the check found it: what coasts rests on
// a fix that is taken back.
TEST_F(Core, TheCoastingFrontShieldGivesUpWhatIsTakenBack) {
  Begin();
  const Eigen::Vector3d before = core_.snapshot().front.site_from_shield.b_from_a.translation;
  core_.Advance(Knocked(seconds(40)), at_ + seconds(40));
  const ShieldState& front = core_.snapshot().front;
  EXPECT_GT((front.site_from_shield.b_from_a.translation - before).norm(), 0.025);
  core_.Advance({}, at_ + seconds(50));
  EXPECT_EQ(front.reason, GuidanceReason::kCameraCoasting);
  core_.Advance(std::vector<GuidanceInput>{SuspectSince(at_ + seconds(5))}, at_ + seconds(55));
  EXPECT_EQ(front.worth, Worth::kDegraded);
  EXPECT_EQ(front.reason, GuidanceReason::kSetUpSuspect);
  EXPECT_LT((front.site_from_shield.b_from_a.translation - before).norm(), 0.01);
  EXPECT_NEAR(front.age_s, 55.0 + begun_with_s_, 1e-6);
}

TEST_F(Core, NothingIsLeftToCoastOnWhenAllOfItIsTakenBack) {
  Begin();
  core_.Advance({}, at_ + seconds(20));
  EXPECT_EQ(core_.snapshot().front.worth, Worth::kDegraded);
  core_.Advance(std::vector<GuidanceInput>{SuspectSince(at_ - seconds(60))}, at_ + seconds(21));
  EXPECT_EQ(core_.snapshot().front.worth, Worth::kInvalid);
  EXPECT_EQ(core_.snapshot().front.reason, GuidanceReason::kSetUpSuspect);
}

// The camera's exposure is fresh enough to coast on, the fix of the rear shield below it is not.
TEST_F(Core, TheCoastingFrontShieldEndsWithTheFixItRestsOn) {
  Begin();
  CameraGoesOn(seconds(880));
  EXPECT_EQ(core_.snapshot().front.reason, GuidanceReason::kStationCoasting);
  core_.Advance({}, at_ + seconds(885));
  EXPECT_EQ(core_.snapshot().front.reason, GuidanceReason::kCameraCoasting);
  core_.Advance({}, at_ + seconds(930));
  EXPECT_EQ(core_.snapshot().camera.freshness, Freshness::kCoasting);
  EXPECT_EQ(core_.snapshot().front.worth, Worth::kInvalid);
  EXPECT_EQ(core_.snapshot().front.reason, GuidanceReason::kStationStale);
}

TEST_F(Core, TrendAndLookAheadForgetWhatIsTakenBack) {
  Timestamp checked_at;
  for (int i = 1; i <= 12; ++i) {
    drive_.Measure(2100.0 + 1.5 * i);
    core_.Advance(drive_.inputs(), drive_.now());
    if (i == 11) checked_at = drive_.now();
  }
  ASSERT_TRUE(Cutter().trend_right && Cutter().trend_up);
  ASSERT_EQ(core_.snapshot().ahead.size(), 20u);
  SetUpKnown set_up = std::get<SetUpKnown>(Only<SetUpKnown>(drive_.inputs()).front());
  const Timestamp now = drive_.now() + milliseconds(300);
  // A check that takes nothing back changes nothing.
  set_up.trusted_until = now;
  core_.Advance(std::vector<GuidanceInput>{set_up}, now);
  EXPECT_TRUE(Cutter().trend_right && !core_.snapshot().ahead.empty());
  set_up.trusted_until = checked_at;
  core_.Advance(std::vector<GuidanceInput>{set_up}, now);
  EXPECT_EQ(Cutter().worth, Worth::kDegraded);
  EXPECT_FALSE(Cutter().trend_right || Cutter().trend_up);
  EXPECT_TRUE(core_.snapshot().ahead.empty());
  // They begin anew with the next good look.
  drive_.Measure(2120.0);
  core_.Advance(drive_.inputs(), drive_.now());
  EXPECT_EQ(Cutter().worth, Worth::kValid);
  EXPECT_FALSE(Cutter().trend_right);
  EXPECT_EQ(core_.snapshot().ahead.size(), 20u);
}

TEST_F(Core, ANewSetUpDoesNotBringBackWhatTheOldOneTookBack) {
  for (const bool there_was_none_between : {false, true}) {
    GuidanceCore core(TheMachine().machine, TheMachine().rig, TheMachine().axis);
    core.Advance(round_, at_);
    const Eigen::Vector3d before = core.snapshot().rear.site_from_shield.b_from_a.translation;
    core.Advance(Knocked(seconds(40)), at_ + seconds(40));
    SetUpKnown set_up = SuspectSince(at_ + seconds(5));
    core.Advance(std::vector<GuidanceInput>{set_up}, at_ + seconds(41));
    if (there_was_none_between) {
      core.Advance(std::vector<GuidanceInput>{SetUpKnown{}}, at_ + seconds(42));
      EXPECT_EQ(core.snapshot().rear.worth, Worth::kInvalid);
    }
    set_up.number += 1;
    set_up.trusted_until.reset();
    core.Advance(std::vector<GuidanceInput>{set_up}, at_ + seconds(43));
    ASSERT_NE(core.snapshot().rear.worth, Worth::kInvalid);
    const Eigen::Vector3d now = core.snapshot().rear.site_from_shield.b_from_a.translation;
    EXPECT_LT((now - before).norm(), 0.01) << there_was_none_between;
  }
}

// The instrument was away and came back with the same set-up, checked and good.
TEST_F(Core, TheSameSetUpFoundGoodBringsBackWhatWasDoubted) {
  Begin();
  const Eigen::Vector3d before = core_.snapshot().rear.site_from_shield.b_from_a.translation;
  core_.Advance(Knocked(seconds(40)), at_ + seconds(40));
  SetUpKnown set_up = SuspectSince(at_ + seconds(5));
  core_.Advance(std::vector<GuidanceInput>{set_up, SetUpKnown{}}, at_ + seconds(41));
  set_up.trusted_until.reset();
  core_.Advance(std::vector<GuidanceInput>{set_up}, at_ + seconds(42));
  set_up.number += 1;
  core_.Advance(std::vector<GuidanceInput>{set_up}, at_ + seconds(43));
  const Eigen::Vector3d now = core_.snapshot().rear.site_from_shield.b_from_a.translation;
  EXPECT_NEAR(now.x() - before.x(), 0.03, 0.003);
}

// After undo_move the set-up has its old, lower number again.
TEST_F(Core, ASetUpThatIsTakenUpAgainIsReadAgain) {
  Begin();
  const Eigen::Vector3d before = core_.snapshot().rear.site_from_shield.b_from_a.translation;
  const SetUpKnown first = std::get<SetUpKnown>(Only<SetUpKnown>(round_).front());
  SetUpKnown second = first;
  second.number += 1;
  auto moved = Later(Without<SetUpKnown>(round_), seconds(40));
  for (GuidanceInput& input : moved) {
    if (auto* prism = std::get_if<PrismSeen>(&input)) prism->set_up_number = second.number;
  }
  moved.insert(moved.begin(), second);
  core_.Advance(moved, at_ + seconds(40));
  EXPECT_EQ(core_.snapshot().set_up_number, second.number);
  auto undone = Knocked(seconds(80));
  undone.insert(undone.begin(), first);
  core_.Advance(undone, at_ + seconds(80));
  EXPECT_EQ(core_.snapshot().set_up_number, first.number);
  EXPECT_EQ(core_.snapshot().rear.worth, Worth::kValid);
  EXPECT_EQ(core_.snapshot().fix->prisms_used, 4);
  const Eigen::Vector3d now = core_.snapshot().rear.site_from_shield.b_from_a.translation;
  EXPECT_NEAR(now.x() - before.x(), 0.03, 0.003);
}

// A prism that the second set-up never saw still has its reading of the first.
TEST_F(Core, AnOlderReadingOfATakenUpSetUpIsNotTheNewestFix) {
  Begin();
  const SetUpKnown first = std::get<SetUpKnown>(Only<SetUpKnown>(round_).front());
  SetUpKnown second = first;
  second.number += 1;
  auto moved = Knocked(seconds(40));
  std::erase_if(moved, [](const GuidanceInput& input) {
    const auto* prism = std::get_if<PrismSeen>(&input);
    return prism != nullptr && prism->prism > 1;
  });
  for (GuidanceInput& input : moved) {
    if (auto* prism = std::get_if<PrismSeen>(&input)) prism->set_up_number = second.number;
  }
  moved.insert(moved.begin(), second);
  core_.Advance(moved, at_ + seconds(40));
  const Timestamp fixed_at = core_.snapshot().fix->at;
  core_.Advance(std::vector<GuidanceInput>{first}, at_ + seconds(41));
  EXPECT_EQ(core_.snapshot().fix->at, fixed_at);
  EXPECT_EQ(core_.snapshot().fix_trouble, GuidanceReason::kNone);
}

// A reading every five seconds, and a check of the references that says after ten minutes that the
// pillar had moved all the while.
TEST_F(Core, WhatWasTrustedAtTheLastCheckIsStillKnownAtTheNext) {
  Begin();
  const RearShieldFix before = *core_.snapshot().fix;
  const auto live = Without<SetUpKnown>(Without<PrismSeen>(round_));
  const auto prisms = Only<PrismSeen>(round_);
  for (int i = 1; i <= 120; ++i) {
    const Duration after = seconds(5 * i);
    auto inputs = Later(live, after);
    PrismSeen prism = std::get<PrismSeen>(prisms[static_cast<std::size_t>(i) % prisms.size()]);
    prism.sensed_at = at_ + after;
    prism.p_in_site.x() += 0.03;
    inputs.push_back(prism);
    core_.Advance(inputs, at_ + after);
  }
  went_on_ = seconds(600);
  core_.Advance(std::vector<GuidanceInput>{SuspectSince(at_ + seconds(2))}, at_ + seconds(600));
  ASSERT_EQ(core_.snapshot().rear.worth, Worth::kDegraded);
  EXPECT_EQ(core_.snapshot().rear.reason, GuidanceReason::kSetUpSuspect);
  EXPECT_EQ(core_.snapshot().fix->at, before.at);
  EXPECT_EQ(core_.snapshot().fix->site_from_rear_shield, before.site_from_rear_shield);
}

// The other prisms are hidden after a while: what is left has its heading from the last fix that
// had one of its own, however many without came after.
TEST_F(Core, AFixWithAHeadingOfItsOwnIsNotGivenUpForOneWithout) {
  auto one = round_;
  std::erase_if(one, [](const GuidanceInput& input) {
    const auto* prism = std::get_if<PrismSeen>(&input);
    return prism != nullptr && prism->prism != 0;
  });
  // No heading before this: the first prism alone is no fix, then all four are.
  core_.Advance(Later(one, -seconds(30)), at_ - seconds(30));
  Begin();
  const Timestamp fixed_at = core_.snapshot().fix->at;
  for (int i = 1; i <= 60; ++i) {
    core_.Advance(Later(Without<SetUpKnown>(one), seconds(30 + 5 * i)), at_ + seconds(30 + 5 * i));
    ASSERT_EQ(core_.snapshot().fix_trouble, GuidanceReason::kNone) << i;
  }
  EXPECT_GT(SecondsBetween(fixed_at, core_.snapshot().fix->at), 300.0);
}

// The camera is silent for so short that the joint's closing still counts as known: nobody has
// watched it since.
TEST_F(Core, WhatTheJointDidSinceTheLastPoseNobodyKnows) {
  Begin();
  const auto along_sigma_m = [&](double after_s) {
    core_.Advance({}, at_ + milliseconds(static_cast<int>(1e3 * after_s)));
    const ShieldState& rear = core_.snapshot().rear;
    const Eigen::Vector3d ahead =
        rear.site_from_shield.b_from_a.rotation * Eigen::Vector3d::UnitX();
    const Eigen::Matrix3d covariance = rear.site_from_shield.covariance.bottomRightCorner<3, 3>();
    return std::sqrt(ahead.dot(covariance * ahead));
  };
  EXPECT_LT(along_sigma_m(0.0), 0.03);
  const double after_5_s_m = along_sigma_m(5.0);
  EXPECT_GT(after_5_s_m, 0.9 * 5.0 * 8e-3);
  EXPECT_LT(after_5_s_m, 1.1 * 5.0 * 8e-3 + 0.03);
  // Where it is not known at all, at 20 s, there is no step.
  EXPECT_LT(along_sigma_m(17.0), 17.0 * 0.04);
}

// The camera is silent and the station goes on: from the last fix on, and no longer, nobody knows.
TEST_F(Core, AFixAfterTheLastPoseEndsWhatNobodyKnows) {
  Begin();
  core_.Advance(Later(Only<PrismSeen>(round_), seconds(21)), at_ + seconds(10));
  const ShieldState& rear = core_.snapshot().rear;
  const double since_s = *core_.snapshot().station.age_s;
  ASSERT_LT(since_s, 2.0);
  const Eigen::Vector3d ahead = rear.site_from_shield.b_from_a.rotation * Eigen::Vector3d::UnitX();
  const Eigen::Matrix3d covariance = rear.site_from_shield.covariance.bottomRightCorner<3, 3>();
  EXPECT_LT(std::sqrt(ahead.dot(covariance * ahead)), 8e-3 * since_s + 0.01);
}

// A round whose second half is measured after the camera's last pose, in the middle of a regrip:
// the prisms fit together only for who knows that nobody has watched the joint.
TEST_F(Core, ARoundThatNobodyWatchesTheJointOfFitsTogether) {
  Begin();
  const Eigen::Vector3d ahead =
      core_.snapshot().rear.site_from_shield.b_from_a.rotation * Eigen::Vector3d::UnitX();
  const auto live = Without<SetUpKnown>(Without<PrismSeen>(round_));
  core_.Advance(Later(live, seconds(12)), at_ + seconds(12));
  core_.Advance(Later(live, seconds(24)), at_ + seconds(24));
  core_.Advance(Later(live, seconds(33)), at_ + seconds(33));
  int i = 0;
  for (const GuidanceInput& input : Only<PrismSeen>(round_)) {
    // Two as it stands, then it is pulled by 40 mm, then the other two.
    PrismSeen prism = std::get<PrismSeen>(input);
    const Duration after = seconds(36 + 3 * i);
    prism.sensed_at = at_ + after;
    if (i >= 2) prism.p_in_site += 0.04 * ahead;
    core_.Advance(std::vector<GuidanceInput>{prism}, at_ + after);
    ++i;
  }
  ASSERT_EQ(i, 4);
  EXPECT_EQ(core_.snapshot().fix_trouble, GuidanceReason::kNone);
  ASSERT_TRUE(core_.snapshot().fix);
  EXPECT_EQ(core_.snapshot().fix->prisms_used, 4);
  EXPECT_FALSE(core_.snapshot().fix->left_out);
}

TEST_F(Core, WhatTheJointDoesFromTheExposureToALaterFixNobodyKnows) {
  Begin();
  const auto live = Without<SetUpKnown>(Without<PrismSeen>(round_));
  const auto prisms = Only<PrismSeen>(round_);
  for (int i = 1; i <= 100; ++i) {  // an exposure takes 0.9 s to come
    auto inputs = Later(live, milliseconds(200 * i - 600));
    PrismSeen prism = std::get<PrismSeen>(prisms[static_cast<std::size_t>(i) % prisms.size()]);
    prism.sensed_at = at_ + milliseconds(200 * i);
    inputs.push_back(prism);
    core_.Advance(inputs, at_ + milliseconds(200 * i));
  }
  const ShieldState& rear = core_.snapshot().rear;
  const double later_s = SecondsBetween(core_.snapshot().valid_at, core_.snapshot().fix->at);
  ASSERT_GT(later_s, 0.6);
  const Eigen::Vector3d ahead = rear.site_from_shield.b_from_a.rotation * Eigen::Vector3d::UnitX();
  const Eigen::Matrix3d covariance = rear.site_from_shield.covariance.bottomRightCorner<3, 3>();
  EXPECT_GT(std::sqrt(ahead.dot(covariance * ahead)), 0.99 * 8e-3 * later_s);
}

TEST_F(Core, WithNothingTrustedThereIsNoPosition) {
  auto never = round_;
  for (GuidanceInput& input : never) {
    if (auto* set_up = std::get_if<SetUpKnown>(&input)) set_up->trusted_until = Timestamp{-1};
  }
  core_.Advance(never, at_);
  EXPECT_EQ(core_.snapshot().rear.worth, Worth::kInvalid);
  EXPECT_EQ(core_.snapshot().rear.reason, GuidanceReason::kSetUpSuspect);
}

TEST_F(Core, ReadingsOfAnotherSetUpAreNotMixedWithThoseOfThisOne) {
  Begin();
  // A second set-up, 20 mm off, of which three prisms were read and one not yet.
  auto set_up = std::get<SetUpKnown>(Only<SetUpKnown>(round_).front());
  set_up.number += 1;
  std::vector<GuidanceInput> inputs{set_up};
  for (GuidanceInput input : Later(Only<PrismSeen>(round_), seconds(20))) {
    auto& prism = std::get<PrismSeen>(input);
    if (prism.prism == 3) continue;
    prism.set_up_number = set_up.number;
    prism.p_in_site.x() += 0.02;
    inputs.push_back(input);
  }
  const auto tilts = Later(Only<TiltSeen>(round_), seconds(20));
  inputs.insert(inputs.begin(), tilts.begin(), tilts.end());
  core_.Advance(inputs, at_ + seconds(20));
  ASSERT_TRUE(core_.snapshot().fix);
  EXPECT_EQ(core_.snapshot().fix->prisms_used, 3);
  EXPECT_FALSE(core_.snapshot().fix->left_out);
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
