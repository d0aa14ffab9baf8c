#include "guidance/app/accuracy.h"

#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace tbm {
namespace {

using ::testing::HasSubstr;

PlacedPoint At(std::int64_t ms, double x) {
  return {Timestamp{ms * 1'000'000}, Eigen::Vector3d(x, 0, 0), 0};
}
PlacedPoint NoneAt(std::int64_t ms) { return {Timestamp{ms * 1'000'000}, std::nullopt, 0}; }
PlacedPoint NoStamp(double x) { return {std::nullopt, Eigen::Vector3d(x, 0, 0), 0}; }

constexpr Duration kTolerance = std::chrono::milliseconds(100);

TEST(Accuracy, WithStampsPosesAreInterpolatedOrNearest) {
  const std::vector<PlacedPoint> poses = {
      At(0, 0.0), At(100, 10.0), NoneAt(200), At(300, 30.0), NoneAt(1000)};
  const auto pairs =
      PairUp(poses,
             {At(25, 1.0), At(100, 2.0), At(150, 3.0), At(400, 4.0), At(700, 5.0), At(1010, 6.0)},
             kTolerance);
  ASSERT_TRUE(pairs.has_value());
  ASSERT_EQ(pairs->observations.size(), 4u);
  EXPECT_EQ(pairs->observations[0].pairing, Pairing::kInterpolated);
  EXPECT_DOUBLE_EQ(pairs->observations[0].difference_mm().x(), 2.5 - 1.0);
  EXPECT_EQ(pairs->observations[1].pairing, Pairing::kExact);
  EXPECT_DOUBLE_EQ(pairs->observations[1].difference_mm().x(), 10.0 - 2.0);
  EXPECT_EQ(pairs->observations[2].pairing, Pairing::kNearest) << "the other neighbour has no pose";
  EXPECT_DOUBLE_EQ(pairs->observations[2].posed_mm.x(), 10.0);
  EXPECT_EQ(pairs->observations[3].pairing, Pairing::kNearest);
  EXPECT_DOUBLE_EQ(pairs->observations[3].posed_mm.x(), 30.0);
  EXPECT_EQ(pairs->without_partner, 1u);
  EXPECT_EQ(pairs->without_pose, 1u);
}

TEST(Accuracy, OfTwoFramesWithOneStampTheOneWithAPoseCounts) {
  for (const auto& poses :
       {std::vector{NoneAt(100), At(100, 10.0)}, std::vector{At(100, 10.0), NoneAt(100)}}) {
    const auto pairs = PairUp(poses, {At(100, 2.0)}, kTolerance);
    ASSERT_TRUE(pairs.has_value());
    ASSERT_EQ(pairs->observations.size(), 1u);
    EXPECT_EQ(pairs->observations[0].pairing, Pairing::kExact);
    EXPECT_DOUBLE_EQ(pairs->observations[0].posed_mm.x(), 10.0);
  }
}

TEST(Accuracy, WithoutStampsRowsPairInOrder) {
  std::vector<PlacedPoint> poses = {NoStamp(1), {std::nullopt, std::nullopt, 0}, NoStamp(3)};
  const auto by_row = PairUp(poses, {NoStamp(1), NoStamp(2), NoStamp(3.5)}, kTolerance);
  ASSERT_TRUE(by_row.has_value());
  ASSERT_EQ(by_row->observations.size(), 2u);
  EXPECT_EQ(by_row->without_pose, 1u);
  EXPECT_DOUBLE_EQ(by_row->observations[1].difference_mm().x(), -0.5);
  const auto by_pose = PairUp(poses, {NoStamp(1), NoStamp(3.5)}, kTolerance);
  ASSERT_TRUE(by_pose.has_value());
  EXPECT_EQ(by_pose->observations.size(), 2u);
  const auto uneven = PairUp(poses, {NoStamp(1)}, kTolerance);
  ASSERT_FALSE(uneven.has_value());
  EXPECT_THAT(uneven.error(), HasSubstr("3 poses (2 with a position) and 1 survey rows"));
}

TEST(Accuracy, RigidAlignmentFindsTheMotionBetweenTheFrames) {
  test::Random random("Accuracy.RigidAlignmentFindsTheMotionBetweenTheFrames");
  const Rigid3 camera_from_log{random.Rotation(), random.Normal3(5000.0)};
  Pairs pairs;
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d in_log = random.Normal3(800.0);
    pairs.observations.push_back(
        {std::nullopt, Pairing::kInOrder, camera_from_log * in_log, in_log});
  }
  const Alignment alignment = AlignRigid(pairs);
  EXPECT_EQ(alignment.degrees_of_freedom, 6);
  EXPECT_LT(alignment.posed_from_surveyed.rotation.angularDistance(camera_from_log.rotation), 1e-7);
  EXPECT_LT((alignment.posed_from_surveyed.translation - camera_from_log.translation).norm(), 1e-6);
  for (const Observation& o : pairs.observations) EXPECT_LT(o.difference_mm().norm(), 1e-6);
}

TEST(Accuracy, RigidAlignmentIsNeverAMirror) {
  test::Random random("Accuracy.RigidAlignmentIsNeverAMirror");
  Pairs pairs;
  for (int i = 0; i < 6; ++i) {
    const Eigen::Vector3d in_log = random.Normal3(800.0);
    pairs.observations.push_back(
        {std::nullopt, Pairing::kInOrder, in_log.cwiseProduct(Eigen::Vector3d(1, 1, -1)), in_log});
  }
  const Alignment alignment = AlignRigid(pairs);
  EXPECT_NEAR(alignment.posed_from_surveyed.rotation.norm(), 1.0, 1e-12);
  double worst = 0.0;
  for (const Observation& o : pairs.observations) worst = std::max(worst, o.difference_mm().norm());
  EXPECT_GT(worst, 100.0) << "a left-handed log must not look right";
}

TEST(Accuracy, AlignmentCountsWhatTheDataGive) {
  Pairs line;
  for (int i = 0; i < 4; ++i) {
    line.observations.push_back(
        {std::nullopt, Pairing::kInOrder, Eigen::Vector3d(i, 0, 0), Eigen::Vector3d(0, i, 0)});
  }
  EXPECT_EQ(AlignRigid(line).degrees_of_freedom, 5);
  // Off the line by less and by more than a thousandth of its length.
  for (const auto& [off_mm, degrees] : {std::pair(1e-3, 5), std::pair(1e-2, 6)}) {
    Pairs nearly = line;
    nearly.observations[1].surveyed_mm.z() += off_mm;
    EXPECT_EQ(AlignRigid(nearly).degrees_of_freedom, degrees) << off_mm;
  }
  Pairs one;
  one.observations.push_back(
      {std::nullopt, Pairing::kInOrder, Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(0, 0, 0)});
  EXPECT_EQ(AlignRigid(one).degrees_of_freedom, 3);
}

TEST(Accuracy, SpreadOfKnownValues) {
  std::vector<double> values;
  for (int i = 1; i <= 20; ++i) values.push_back(i % 2 == 0 ? i : -i);
  const Spread spread = SpreadOf(values);
  EXPECT_DOUBLE_EQ(spread.mean_mm, 0.5);
  EXPECT_DOUBLE_EQ(spread.rms_mm, std::sqrt(2870.0 / 20.0));
  EXPECT_DOUBLE_EQ(spread.p95_mm, 19.0) << "19 of 20 do not exceed it";
  EXPECT_DOUBLE_EQ(spread.max_mm, 20.0);
}

TEST(Accuracy, ReadsPosesOfOnePoint) {
  const auto poses = ReadPosedPoint(
      "stamp_ns,status,reason,head_x_mm,head_y_mm,head_z_mm\n5,ok,,1,2,3\n6,none,no_match,,,\n",
      "p.csv",
      "head");
  ASSERT_TRUE(poses.has_value()) << poses.error().Text();
  ASSERT_EQ(poses->size(), 2u);
  EXPECT_EQ((*poses)[0].xyz_mm, Eigen::Vector3d(1, 2, 3));
  EXPECT_FALSE((*poses)[1].xyz_mm.has_value());
}

TEST(Accuracy, FaultsOfBothFilesNameTheirPlace) {
  const std::string header = "stamp_ns,status,head_x_mm,head_y_mm,head_z_mm\n";
  const auto poses = [&](const std::string& rows) {
    return ReadPosedPoint(header + rows, "p.csv", "head").error().Text();
  };
  EXPECT_THAT(poses("1,ok,1,x,3\n"), HasSubstr("p.csv:2: column head_y_mm"));
  EXPECT_THAT(poses("1,ok,1,,3\n"), HasSubstr("p.csv:2: column head_y_mm"));
  EXPECT_THAT(poses("1,fine,1,2,3\n"),
              HasSubstr("p.csv:2: column status: 'fine' must be ok, degraded or none"));
  EXPECT_THAT(poses("1,ok,1,2,3\n,ok,1,2,3\n"), HasSubstr("p.csv:3: column stamp_ns"));
  EXPECT_THAT(ReadPosedPoint(header, "p.csv", "tail").error().Text(),
              HasSubstr("no point 'tail'; it has head"));
  const auto log = [](const std::string& text) {
    return ReadSurveyLog(text, "l.csv", "head").error().Text();
  };
  EXPECT_THAT(log("stamp_ns,point,x_mm,y_mm\n"), HasSubstr("l.csv:1: column z_mm"));
  EXPECT_THAT(log("stamp_ns,point,x_mm,y_mm,z_mm\n1,head,1,nan,3\n"),
              HasSubstr("l.csv:2: column y_mm"));
  EXPECT_THAT(log("stamp_ns,point,x_mm,y_mm,z_mm\n1,tail,1,2,3\n"),
              HasSubstr("no point 'head'; it has tail"));
}

TEST(Accuracy, ReadsALeicaLog) {
  const auto log = ReadSurveyLog(
      "*110001+000000000000HEAD 81..06+0000000000010000 82..06+0000000000020000 "
      "83..06-0000000000030000\n"
      "110002+00000TGT 81..00+00000001 82..00+00000002 83..00+00000003",
      "l.gsi",
      "HEAD");
  ASSERT_TRUE(log.has_value()) << log.error().Text();
  ASSERT_EQ(log->points.size(), 1u);
  EXPECT_EQ(log->other_points, 1u);
  EXPECT_LT((*log->points[0].xyz_mm - Eigen::Vector3d(1000, 2000, -3000)).norm(), 1e-9);
  EXPECT_FALSE(log->points[0].at.has_value());
}

}  // namespace
}  // namespace tbm
