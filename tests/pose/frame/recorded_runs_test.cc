#include <cmath>
#include <cstdio>
#include <set>

#include "tests/support/opencv_reference.h"
#include "tests/support/recorded_run.h"

namespace tbm {
namespace {

struct SolvedRun {
  RecordedRun run;
  std::vector<test::TruthRow> truth;
  std::vector<FrameResult> results;

  double HeadErrorMm(std::size_t i) const {
    return 1e3 * (results[i].points[0].p_in_camera - truth[i].head_in_camera_m).norm();
  }
};

SolvedRun Solve(const std::string& folder) {
  auto run = ReadRun(folder);
  TBM_CHECK(run.has_value());
  SolvedRun solved{*run, test::ReadTruth(folder), {}};
  solved.results = test::SolveRun(solved.run);
  TBM_CHECK(solved.truth.size() == solved.results.size());
  return solved;
}

void Print(const SolvedRun& solved) {
  for (std::size_t i = 0; i < solved.results.size(); ++i) {
    const FrameResult& r = solved.results[i];
    std::printf("%3zu %-9s %-18s leds %d of %d, %2zu spots",
                i,
                StatusCode(r.status).data(),
                ReasonCode(r.reason).data(),
                r.pose ? std::popcount(r.pose->leds_used) : 0,
                solved.truth[i].leds_visible,
                r.centres.size());
    if (r.pose) {
      std::printf(" chi2/dof %6.2f/%d rms %.3f px head error %.3f mm sigma %.3f bound %.3f",
                  r.pose->pose.chi2,
                  r.pose->pose.dof,
                  r.pose->pose.rms_px,
                  solved.HeadErrorMm(i),
                  1e3 * r.points[0].sigma_m,
                  1e3 * r.points[0].bound_m.value_or(NAN));
    }
    std::printf("  (%s)\n", solved.truth[i].note.c_str());
  }
}

// No pose may be further from the truth than its bound says; one that has no bound is as bad.
void ExpectBoundsHold(const SolvedRun& solved) {
  for (std::size_t i = 0; i < solved.results.size(); ++i) {
    const FrameResult& r = solved.results[i];
    if (!r.pose) continue;
    ASSERT_TRUE(r.points[0].bound_m.has_value()) << "frame " << i;
    EXPECT_LE(solved.HeadErrorMm(i), 1e3 * *r.points[0].bound_m) << "frame " << i;
  }
}

TEST(RecordedRuns, BenchSolvesEveryFrameToItsLimit) {
  const std::string folder = test::SharedRun("run_bench");
  TBM_SKIP_WITHOUT(folder);
  const SolvedRun solved = Solve(folder);
  Print(solved);
  double mean_mm = 0.0;
  for (std::size_t i = 0; i < solved.results.size(); ++i) {
    ASSERT_EQ(solved.results[i].status, PoseStatus::kOk) << "frame " << i;
    mean_mm += solved.HeadErrorMm(i) / static_cast<double>(solved.results.size());
  }
  std::printf("mean shield head error %.4f mm (wanted <= 0.18)\n", mean_mm);
  EXPECT_LE(mean_mm, 0.18);
  ExpectBoundsHold(solved);
}

TEST(RecordedRuns, DriveIsAsGoodAsTheWeightedReference) {
  const std::string folder = test::SharedRun("run_drive");
  TBM_SKIP_WITHOUT(folder);
  const SolvedRun solved = Solve(folder);
  Print(solved);
  double ours_mm2 = 0.0;
  double reference_mm2 = 0.0;
  for (std::size_t i = 0; i < solved.results.size(); ++i) {
    const FrameResult& r = solved.results[i];
    ASSERT_TRUE(r.pose) << "frame " << i;
    PoseProblem problem;
    problem.rig = &solved.run.rig;
    for (std::size_t spot = 0; spot < r.centres.size(); ++spot) {
      if (r.led_of_centre[spot] < 0) continue;
      problem.leds.push_back(
          {r.led_of_centre[spot], r.centres[spot].pixel_px, r.centres[spot].sigma_px});
    }
    problem.target_tilt = r.target_tilt.observation;
    problem.camera_tilt = r.camera_tilt.observation;
    const auto reference = test::OpenCvWeightedPose(problem);
    ASSERT_TRUE(reference) << "frame " << i;
    const Eigen::Vector3d head = *reference * solved.run.rig.points[0].p_point_in_target;
    ours_mm2 += std::pow(solved.HeadErrorMm(i), 2);
    reference_mm2 += 1e6 * (head - solved.truth[i].head_in_camera_m).squaredNorm();
  }
  const double ratio = std::sqrt(ours_mm2 / reference_mm2);
  std::printf("RMS head error %.3f mm, weighted reference %.3f mm: %.3f x (wanted <= 1.1)\n",
              std::sqrt(ours_mm2 / static_cast<double>(solved.results.size())),
              std::sqrt(reference_mm2 / static_cast<double>(solved.results.size())),
              ratio);
  EXPECT_LE(ratio, 1.1);
  ExpectBoundsHold(solved);
}

TEST(RecordedRuns, HostilePublishesNoWrongPoseAndLosesNone) {
  const std::string folder = test::SharedRun("run_hostile");
  TBM_SKIP_WITHOUT(folder);
  const SolvedRun solved = Solve(folder);
  Print(solved);
  for (std::size_t i = 0; i < solved.results.size(); ++i) {
    if (solved.truth[i].leds_visible < 3) continue;
    EXPECT_TRUE(solved.results[i].pose) << "frame " << i << " lost";
  }
  ExpectBoundsHold(solved);
}

TEST(RecordedRuns, FaultsGetTheirOwnReasonAndTheRunGoesOn) {
  const std::string folder = test::SharedRun("run_faults");
  TBM_SKIP_WITHOUT(folder);
  const SolvedRun solved = Solve(folder);
  Print(solved);
  const std::map<std::string, PoseReason> expected = {
      {"ok", PoseReason::kNone},
      {"black", PoseReason::kFrameDark},
      {"saturated", PoseReason::kFrameSaturated},
      {"truncated", PoseReason::kFrameUnreadable},
      {"missing_file", PoseReason::kFrameMissing},
      {"tilt_nan", PoseReason::kTiltNotFinite},
      {"tilt_outlier", PoseReason::kTiltDisagrees},
      {"tilt_missing", PoseReason::kTiltStale},
      {"duplicate_stamp", PoseReason::kStampNotIncreasing},
      {"wrong_size", PoseReason::kFrameSize},
      {"two_leds", PoseReason::kTwoLeds},
      {"one_led", PoseReason::kTooFewLeds},
      {"tilt_out_of_range", PoseReason::kTiltOutOfRange}};
  std::set<std::string> met;
  for (std::size_t i = 0; i < solved.results.size(); ++i) {
    const auto row = expected.find(solved.truth[i].note);
    ASSERT_NE(row, expected.end()) << solved.truth[i].note;
    EXPECT_EQ(ReasonCode(solved.results[i].reason), ReasonCode(row->second))
        << "frame " << i << " " << row->first;
    met.insert(row->first);
  }
  EXPECT_EQ(met.size(), expected.size());
  ExpectBoundsHold(solved);
}

TEST(RecordedRuns, TheSameRunTwiceGivesTheSameBits) {
  const std::string folder = test::SharedRun("run_hostile");
  TBM_SKIP_WITHOUT(folder);
  const auto run = ReadRun(folder);
  ASSERT_TRUE(run);
  const auto first = test::SolveRun(*run);
  const auto second = test::SolveRun(*run);
  for (std::size_t i = 0; i < first.size(); ++i) {
    ASSERT_EQ(first[i].pose.has_value(), second[i].pose.has_value());
    if (!first[i].pose) continue;
    const Rigid3& a = first[i].pose->pose.camera_from_target;
    const Rigid3& b = second[i].pose->pose.camera_from_target;
    EXPECT_EQ(a.rotation.coeffs(), b.rotation.coeffs());
    EXPECT_EQ(a.translation, b.translation);
    EXPECT_EQ(first[i].pose->pose.covariance, second[i].pose->pose.covariance);
  }
}

// A recording that begins in the middle of the day goes on from the state written down there.
TEST(RecordedRuns, RestoredStateContinuesWithTheSameBits) {
  const std::string folder = test::SharedRun("run_hostile");
  TBM_SKIP_WITHOUT(folder);
  const auto run = ReadRun(folder);
  ASSERT_TRUE(run);
  const auto whole = test::SolveRun(*run);
  constexpr std::size_t kCut = 15;

  FrameSolver early(run->rig);
  FrameSolver late(run->rig);
  TiltFeed tilts(*run);
  for (std::size_t i = 0; i < run->frames.size(); ++i) {
    if (i == kCut) {
      ASSERT_TRUE(late.RestoreState(early.BeginRecord()));
      for (const TiltSensor sensor : {TiltSensor::kTarget, TiltSensor::kCamera}) {
        for (const auto& entry : early.tilt_history(sensor).entries()) {
          late.AddTilt({entry.sensed_at, sensor, entry.inclination});
        }
      }
    }
    FrameSolver& solver = i < kCut ? early : late;
    for (const TiltReading& reading : tilts.Before(i)) solver.AddTilt(reading);
    const ImageResult image = ReadFrame(*run, i);
    ASSERT_TRUE(image);
    const FrameResult& result =
        solver.Solve({run->frames[i].sensed_at, image->View(), PoseReason::kNone});
    ASSERT_EQ(result.reason, whole[i].reason) << "frame " << i;
    if (!result.pose) continue;
    EXPECT_EQ(result.pose->pose.camera_from_target.translation,
              whole[i].pose->pose.camera_from_target.translation);
    EXPECT_EQ(result.points[0].bound_m, whole[i].points[0].bound_m);
  }
  EXPECT_FALSE(late.RestoreState("tbm_solver_state 2 1"));
  EXPECT_FALSE(late.RestoreState(early.BeginRecord() + "x"));
  EXPECT_FALSE(late.RestoreState(""));
}

}  // namespace
}  // namespace tbm
