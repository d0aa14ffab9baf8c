// What the telescopic joint says of the rear shield, and what nobody knows while it is not watched.
#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "tests/guidance/core/core_bench.h"

namespace tbm::test {
namespace {

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

}  // namespace
}  // namespace tbm::test
