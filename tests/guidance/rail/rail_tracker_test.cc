// The trolley followed live, against truth and against itself with everything delayed.
#include "guidance/rail/rail_tracker.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <variant>

#include <gtest/gtest.h>

#include "guidance/rail/rail_line.h"
#include "tests/guidance/rail/rail_generator.h"

namespace tbm {
namespace {

using test::GeneratedRun;
using test::GenerateRail;

using Input = std::variant<ImuSample, TrolleyTilt, TargetImage>;

struct Coming {
  Timestamp comes_at;
  Input input;
};

// What comes when, if images and tilts are late by so much, at random up to `jitter_s` more.
std::vector<Coming> Delayed(const RailRecording& recording,
                            double late_s,
                            double jitter_s,
                            std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  const auto delay = [&] {
    const double part = std::generate_canonical<double, 53>(engine);
    return Duration(std::llround(1e9 * (late_s + part * jitter_s)));
  };
  std::vector<Coming> all;
  for (const ImuSample& one : recording.imu) all.push_back({one.ends_at, one});
  for (const TrolleyTilt& one : recording.tilts) all.push_back({one.sensed_at + delay(), one});
  for (const TargetImage& one : recording.images) all.push_back({one.stamped_at + delay(), one});
  std::stable_sort(all.begin(), all.end(), [](const Coming& a, const Coming& b) {
    return a.comes_at < b.comes_at;
  });
  return all;
}

struct Followed {
  std::vector<TrolleyPlace> places;
  std::uint64_t came_too_late = 0;
  RailTrackerPhase phase = RailTrackerPhase::kNoRun;
  std::optional<RailStartFailure> failure;
};

// A place for each tenth of a second.
Followed Follow(const GeneratedRun& run, const std::vector<Coming>& coming, double lag_s) {
  RailTracker tracker(run.setup, run.recording.targets, {.lag_s = lag_s});
  Followed followed;
  std::size_t samples = 0;
  for (const Coming& one : coming) {
    std::visit([&](const auto& input) { tracker.Add(input); }, one.input);
    if (!std::holds_alternative<ImuSample>(one.input) || ++samples % 20 != 0) continue;
    if (const auto place = tracker.Place()) followed.places.push_back(*place);
  }
  followed.came_too_late = tracker.came_too_late();
  followed.phase = tracker.phase();
  followed.failure = tracker.start_failure();
  return followed;
}

// Root mean square of error over sigma, all axes.
double ErrorOverSigma(const GeneratedRun& run, const std::vector<TrolleyPlace>& places) {
  double sum = 0.0;
  double count = 0.0;
  for (const TrolleyPlace& place : places) {
    const auto truth = std::lower_bound(
        run.truth.begin(), run.truth.end(), place.at, [](const auto& row, Timestamp at) {
          return row.at < at;
        });
    if (truth == run.truth.end() || truth->at != place.at) continue;
    const Eigen::Vector3d off = place.motion.position_world_m - truth->position_world_m;
    sum += off.cwiseQuotient(place.sigma_position_m).squaredNorm();
    count += 3.0;
  }
  EXPECT_GT(count, 100.0);
  return std::sqrt(sum / count);
}

// Also where the survey is that of wall targets: its error is the same in every image.
TEST(RailTracker, FollowsWithinWhatItSaysOfItself) {
  for (const double target_sigma_m : {3e-5, 5e-4}) {
    double squares = 0.0;
    constexpr int kRuns = 8;
    for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
      const GeneratedRun run = GenerateRail({.seed = seed, .target_sigma_m = target_sigma_m});
      const Followed followed = Follow(run, Delayed(run.recording, 0.1, 0.1, seed), 0.6);
      ASSERT_EQ(followed.phase, RailTrackerPhase::kTracks);
      EXPECT_EQ(followed.came_too_late, 0u);
      const double ratio = ErrorOverSigma(run, followed.places);
      EXPECT_LT(ratio, 2.5) << seed;
      squares += ratio * ratio;
      const TrolleyPlace& last = followed.places.back();
      EXPECT_EQ(last.hold, TrolleyHold::kFixed);
      EXPECT_LT(last.sigma_position_m.maxCoeff(), 2e-3 + 20.0 * target_sigma_m);
      EXPECT_NEAR(last.distance_m,
                  (run.truth.back().position_world_m - run.truth.front().position_world_m).norm(),
                  0.15);
    }
    const double ratio = std::sqrt(squares / kRuns);
    std::printf("survey of %.2f mm: error over sigma %.2f\n", 1e3 * target_sigma_m, ratio);
    EXPECT_GT(ratio, 0.5);
    EXPECT_LT(ratio, 1.4);
  }
}

TEST(RailTracker, TheOrderOfArrivalWithinTheLagChangesNotOneBit) {
  const GeneratedRun run = GenerateRail({.seed = 3});
  const Followed at_once = Follow(run, Delayed(run.recording, 0.0, 0.0, 1), 0.6);
  const Followed late = Follow(run, Delayed(run.recording, 0.2, 0.35, 2), 0.6);
  EXPECT_EQ(late.came_too_late, 0u);
  ASSERT_EQ(at_once.places.size(), late.places.size());
  for (std::size_t i = 0; i < late.places.size(); ++i) {
    ASSERT_EQ(at_once.places[i].at, late.places[i].at);
    ASSERT_EQ(at_once.places[i].motion.position_world_m, late.places[i].motion.position_world_m);
    ASSERT_EQ(at_once.places[i].sigma_position_m, late.places[i].sigma_position_m);
  }
}

TEST(RailTracker, WhatComesTooLateIsCountedAndNotTaken) {
  const GeneratedRun run = GenerateRail({.seed = 3});
  const Followed followed = Follow(run, Delayed(run.recording, 0.9, 0.0, 1), 0.6);
  ASSERT_EQ(followed.phase, RailTrackerPhase::kTracks);
  EXPECT_GT(followed.came_too_late, 50u);
  // No target on the whole way: it says that nothing holds it.
  const auto on_its_way =
      std::find_if(followed.places.begin(), followed.places.end(), [](const TrolleyPlace& place) {
        return place.distance_m > 1.0;
      });
  ASSERT_NE(on_its_way, followed.places.end());
  EXPECT_EQ(on_its_way->hold, TrolleyHold::kOpen);
}

TEST(RailTracker, RestAtTheEndIsNoticedAndHoldsThePlace) {
  const GeneratedRun run = GenerateRail({.seed = 4, .end_rest_s = 6.0});
  const Followed followed = Follow(run, Delayed(run.recording, 0.1, 0.1, 1), 0.6);
  ASSERT_FALSE(followed.places.empty());
  const TrolleyPlace& last = followed.places.back();
  ASSERT_TRUE(last.rest_age_s);
  EXPECT_LT(*last.rest_age_s, 1.0);
  EXPECT_LT(last.motion.velocity_world_m_s.norm(), 2e-3);
}

TEST(RailTracker, AGapIsToldUntilSomethingHoldsThePlaceAgain) {
  GeneratedRun run = GenerateRail({.seed = 5});
  const Timestamp begin = run.recording.imu.front().ends_at;
  std::erase_if(run.recording.imu, [&](const ImuSample& sample) {
    const double at_s = SecondsBetween(begin, sample.ends_at);
    return at_s > 12.0 && at_s < 12.15;
  });
  std::erase_if(run.recording.images, [&](const TargetImage& image) {
    const double at_s = SecondsBetween(begin, image.stamped_at);
    return at_s > 12.0 && at_s < 13.0;
  });
  const Followed followed = Follow(run, Delayed(run.recording, 0.1, 0.0, 1), 0.6);
  const auto hold_at = [&](double at_s) {
    for (const TrolleyPlace& place : followed.places) {
      if (SecondsBetween(begin, place.at) >= at_s) return place.hold;
    }
    return TrolleyHold::kOpen;
  };
  EXPECT_EQ(hold_at(11.5), TrolleyHold::kFixed);
  EXPECT_EQ(hold_at(13.0), TrolleyHold::kGap);
  EXPECT_EQ(hold_at(14.5), TrolleyHold::kFixed);
  EXPECT_LT(ErrorOverSigma(run, followed.places), 3.0);
}

TEST(RailTracker, AStartThatIsNoneIsSaid) {
  GeneratedRun run = GenerateRail({.seed = 6});
  run.setup.start.at_rest_s = 12.0;
  const Followed followed = Follow(run, Delayed(run.recording, 0.0, 0.0, 1), 0.6);
  EXPECT_EQ(followed.phase, RailTrackerPhase::kStartFailed);
  ASSERT_TRUE(followed.failure);
  EXPECT_EQ(followed.failure->fault, RailStartFault::kMovesAtStart);
  EXPECT_TRUE(followed.places.empty());
}

TEST(RailTracker, SamplesOutOfOrderAreCountedAndNothingIsSaidBeforeTheStart) {
  const GeneratedRun run = GenerateRail({.seed = 7});
  RailTracker tracker(run.setup, run.recording.targets, {});
  EXPECT_EQ(tracker.phase(), RailTrackerPhase::kNoRun);
  EXPECT_FALSE(tracker.Place());
  tracker.Add(run.recording.imu[1]);
  tracker.Add(run.recording.imu[0]);
  tracker.Add(run.recording.imu[1]);
  EXPECT_EQ(tracker.came_too_late(), 2u);
  EXPECT_EQ(tracker.phase(), RailTrackerPhase::kWaitingForRest);
  EXPECT_FALSE(tracker.Place());
}

// Found as it comes, the quiet is the same as found in the whole; and none of it is told early.
TEST(QuietWatch, FindsAsItComesWhatTheWholeRecordingShows) {
  const GeneratedRun run = GenerateRail({.seed = 8, .end_rest_s = 5.0});
  const auto rest = FindRestSignature(run.setup, run.recording);
  ASSERT_TRUE(rest);
  const std::vector<RestSpan> whole = FindQuietSpans(run.setup, run.recording, *rest);
  ASSERT_GE(whole.size(), 2u);
  QuietWatch watch(run.setup, *rest);
  for (const ImuSample& sample : run.recording.imu) {
    watch.Feed(sample);
    if (!watch.spans().empty()) {
      EXPECT_LT(watch.spans().back().ends_at, sample.ends_at);
    }
  }
  ASSERT_EQ(watch.spans().size(), whole.size());
  for (std::size_t i = 0; i < whole.size(); ++i) {
    EXPECT_EQ(watch.spans()[i].begins_at, whole[i].begins_at);
    EXPECT_EQ(watch.spans()[i].ends_at, whole[i].ends_at);
  }
}

}  // namespace
}  // namespace tbm
