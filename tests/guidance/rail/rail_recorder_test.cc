#include "guidance/app/rail_recorder.h"

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "guidance/app/even_clock.h"
#include "guidance/app/rail_words.h"
#include "tests/support/command.h"
#include "tests/support/fake_clock.h"
#include "tests/support/temp_folder.h"

namespace tbm::test {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Timestamp kBegin{1'790'000'000'000'000'000};

ImuSample SampleAt(Timestamp at) { return {.ends_at = at, .interval_s = 4e-3}; }

class Recorder : public ::testing::Test {
 protected:
  Recorder() : recorder_(folder_ / "run", {"", "", {"north, upper"}}, seconds(1)) {
    EXPECT_EQ(recorder_.Begin(), std::nullopt);
  }
  std::vector<std::vector<std::string>> RowsOf(const std::string& name) const {
    return Rows(ReadText(folder_ / "run/" + name));
  }

  TempFolder folder_;
  RailRecorder recorder_;
};

// Seen by reading: a step back within the hold-back put new samples between old ones.
TEST_F(Recorder, SamplesThatGoBackInTimeAreNotPutBetweenOthers) {
  for (int i = 0; i < 100; ++i) recorder_.Add(SampleAt(kBegin + milliseconds(10 * i)));
  for (int i = 0; i < 50; ++i) recorder_.Add(SampleAt(kBegin + milliseconds(305 + 10 * i)));
  EXPECT_EQ(recorder_.Finish(), std::nullopt);
  EXPECT_EQ(RowsOf("imu.csv").size(), 101u);
  EXPECT_EQ(recorder_.not_recorded(), 50u);
}

TEST_F(Recorder, WritesTiltsWhileTheUnitIsSilent) {
  for (int i = 0; i < 100; ++i) recorder_.Add(TrolleyTilt{kBegin + milliseconds(100 * i), {}});
  EXPECT_EQ(recorder_.Flush(), std::nullopt);
  EXPECT_EQ(Rows(ReadText(folder_ / "run.unfinished/tilt.csv")).size(), 90u);
}

TEST_F(Recorder, KeepsTheSigmaOfEachImagePointAndQuotesNames) {
  recorder_.Add(TargetImage{kBegin, {{0, {1.5, 2.5}, 0.25}}});
  recorder_.Add(TargetImage{kBegin + seconds(1), {{0, {1.5, 2.5}, 0.0}}});  // nobody knows it
  EXPECT_EQ(recorder_.Finish(), std::nullopt);
  EXPECT_EQ(ReadText(folder_ / "run/centres.csv"),
            "stamp_ns,target,u_px,v_px,sigma_px\n"
            "1790000000000000000,\"north, upper\",1.5,2.5,0.25\n");
  EXPECT_EQ(recorder_.not_recorded(), 1u);
}

TEST_F(Recorder, WithoutSigmaThereIsNoColumnOfIt) {
  recorder_.Add(TargetImage{kBegin, {{0, {1.5, 2.5}, 0.0}}});
  EXPECT_EQ(recorder_.Finish(), std::nullopt);
  EXPECT_EQ(RowsOf("centres.csv")[0].back(), "v_px");
}

TEST_F(Recorder, TakesNoFolderThatIsThere) {
  EXPECT_NE(RailRecorder(folder_ / "run", {}, seconds(1)).Begin(), std::nullopt);
  EXPECT_EQ(recorder_.Finish(), std::nullopt);
  EXPECT_NE(RailRecorder(folder_ / "run", {}, seconds(1)).Begin(), std::nullopt);
}

TEST(EvenClock, GoesOnWhateverTheClockIsSetTo) {
  FakeClock clock;
  const EvenClock even(clock);
  const Timestamp begin = clock.Now();
  clock.Advance(seconds(1));
  clock.StepCivilTime(-seconds(2));
  clock.Advance(seconds(1));
  EXPECT_EQ(even.Now() - begin, seconds(2));
  EXPECT_EQ(even.SetSince(), -seconds(2));
}

TEST(RunFolders, OneAtATimeAndNoNameTwice) {
  const TempFolder folder;
  const std::string runs = folder / "a/runs";
  RunFolders first(runs, folder / "lines");
  EXPECT_EQ(first.Take(), std::nullopt);
  RunFolders second(folder / "other", folder / "lines");
  EXPECT_EQ(second.Take(), (folder / "lines") + ": another rail_line is at work in this folder");
  EXPECT_EQ(first.FreeName(kBegin), "rail_20260921_141320");
  std::filesystem::create_directories(runs + "/rail_20260921_141320.unfinished");
  EXPECT_EQ(first.FreeName(kBegin), "rail_20260921_141320_2");
  EXPECT_EQ(first.CleanUp().size(), 1u);
  first.Release();
  EXPECT_EQ(second.Take(), std::nullopt);
  RunFolders same(folder / "same", folder / "same");
  EXPECT_EQ(same.Take(), std::nullopt);
}

// Seen by reading: of 100 000 places every third was told, the worst perhaps not.
TEST(SettlementPieces, ThinningKeepsTheWorstPlaceOfEachStretch) {
  Settlement settlement;
  for (int i = 0; i < 100'000; ++i) {
    SettlementPlace place;
    place.distance_m = 0.1 * i;
    place.changes = {HeightChange{1e-4 * (i % 7), 3e-4, false}};
    if (i % 5 == 0) place.changes = {std::nullopt};
    settlement.places.push_back(place);
  }
  settlement.places[50'002].changes = {HeightChange{-0.02, 3e-4, true}};
  settlement.places[50'002].alert = 2;
  settlement.epochs.resize(1);
  const auto pieces = PiecesOf(settlement, {"base", "a", {}}, {"later", "b", {}}, 0.95);
  std::size_t alerts = 0;
  std::size_t without = 0;
  for (const dds::SettlementPiece& piece : pieces) {
    EXPECT_EQ(piece.highest_alert, 2);
    for (const dds::SettlementPoint& point : piece.points) {
      if (std::isnan(point.dz_m)) ++without;
      if (point.alert != 2) continue;
      ++alerts;
      EXPECT_NEAR(point.distance_m, 5000.2, 1e-9);
    }
  }
  EXPECT_EQ(alerts, 1u);
  EXPECT_EQ(without, 0u) << "of each stretch some place is compared";
}

}  // namespace
}  // namespace tbm::test
