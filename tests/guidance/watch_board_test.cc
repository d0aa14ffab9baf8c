#include "guidance/app/watch_board.h"

#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pose/base/angle.h"

namespace tbm {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

constexpr Timestamp kUtc{1'790'000'000'000'000'000};
const WatchBoard::Instant kSteady{std::chrono::hours(5)};

WatchNow NowAfter(std::chrono::milliseconds span) { return {kSteady + span, kUtc + span}; }

dds::RelativePose Pose() {
  dds::RelativePose pose;
  pose.machine_id = "tbm7";
  pose.sensed_at = kUtc;
  pose.status = PoseStatus::kOk;
  pose.leds_used = 0b11011;
  pose.camera_from_target = {Eigen::Quaterniond::Identity(), {0.123, -0.456, 3.789}};
  pose.covariance = PoseCovariance::Identity() * 1e-8;  // 0.1 mm
  pose.rms_px = 0.05;
  pose.points.push_back({"shield_head", {0.111, 0.222, 5.333}, 0.0002, 0.0015});
  return pose;
}

WatchRow RowOf(const WatchBoard& board, const WatchNow& now, std::string_view what) {
  for (const WatchRow& row : board.Rows(now)) {
    if (row.what == what) return row;
  }
  ADD_FAILURE() << "no row " << what;
  return {};
}

TEST(WatchBoard, AFreshPoseShowsValueSigmaAgeAndStatus) {
  WatchBoard board;
  board.Add(Pose(), kSteady);
  const WatchRow row = RowOf(board, NowAfter(std::chrono::milliseconds(120)), "pose tbm7");
  EXPECT_THAT(row.value, HasSubstr("123.00    -456.00    3789.00 mm, 4 LEDs"));
  EXPECT_EQ(row.sigma, "0.100 0.100 0.100");
  EXPECT_EQ(row.age, "0.12 s");
  EXPECT_EQ(row.status, "ok");
  EXPECT_EQ(row.style, WatchStyle::kGood);
  const WatchRow point = RowOf(board, NowAfter(std::chrono::milliseconds(120)), "  shield_head");
  EXPECT_THAT(point.value, HasSubstr("bound 1.50"));
  EXPECT_EQ(point.sigma, "0.200");
}

TEST(WatchBoard, SilenceMakesItStaleByOurOwnClock) {
  WatchBoard board;
  board.Add(Pose(), kSteady);
  // Our civil clock was set back: by the stamp the pose would look fresh for ever.
  const WatchNow now{kSteady + std::chrono::milliseconds(900), kUtc};
  const WatchRow row = RowOf(board, now, "pose tbm7");
  EXPECT_EQ(row.style, WatchStyle::kStale);
  EXPECT_EQ(row.age, "0.90 s");
  EXPECT_THAT(row.status, StartsWith("STALE, was ok"));
  EXPECT_THAT(row.value, StartsWith("("));
  EXPECT_EQ(row.sigma, "");
  EXPECT_EQ(RowOf(board, now, "  shield_head").style, WatchStyle::kStale);
}

TEST(WatchBoard, AnOldStampIsStaleHoweverLatelyItCame) {
  WatchBoard board;
  board.Add(Pose(), kSteady);
  const WatchNow now{kSteady, kUtc + std::chrono::seconds(30)};
  EXPECT_EQ(RowOf(board, now, "pose tbm7").style, WatchStyle::kStale);
  EXPECT_EQ(RowOf(board, now, "pose tbm7").age, "30 s");
}

TEST(WatchBoard, AStampFromTheFutureIsMentioned) {
  WatchBoard board;
  board.Add(Pose(), kSteady);
  const WatchNow now{kSteady, kUtc - std::chrono::seconds(3)};
  EXPECT_THAT(RowOf(board, now, "pose tbm7").status, HasSubstr("clock 3.0 s ahead"));
}

TEST(WatchBoard, WithoutAPoseThereAreNoNumbers) {
  WatchBoard board;
  dds::RelativePose pose;
  pose.machine_id = "tbm7";
  pose.sensed_at = kUtc;
  pose.reason = PoseReason::kTooFewLeds;
  board.Add(pose, kSteady);
  const WatchRow row = RowOf(board, NowAfter(std::chrono::milliseconds(1)), "pose tbm7");
  EXPECT_EQ(row.value, "");
  EXPECT_EQ(row.status, "none too_few_leds");
  EXPECT_EQ(row.style, WatchStyle::kBad);
}

TEST(WatchBoard, ANewSampleReplacesTheOldOfItsKeyOnly) {
  WatchBoard board;
  dds::TiltReading tilt;
  tilt.machine_id = "tbm7";
  tilt.sensor = "target";
  tilt.sensed_at = kUtc;
  tilt.validity = dds::Validity::kValid;
  tilt.inclination = {DegToRad(1.5), DegToRad(-2.5)};
  tilt.sigma_rad = DegToRad(0.005);
  board.Add(tilt, kSteady);
  tilt.sensor = "camera";
  tilt.inclination = {DegToRad(7.0), 0.0};
  board.Add(tilt, kSteady);
  EXPECT_THAT(RowOf(board, NowAfter({}), "tilt tbm7 target").value,
              HasSubstr("1.5000   -2.5000 deg"));
  EXPECT_THAT(RowOf(board, NowAfter({}), "tilt tbm7 camera").value, HasSubstr("7.0000"));
  tilt.validity = dds::Validity::kInvalid;
  tilt.reason = "tilt_not_finite";
  board.Add(tilt, kSteady);
  const WatchRow row = RowOf(board, NowAfter({}), "tilt tbm7 camera");
  EXPECT_EQ(row.value, "");
  EXPECT_EQ(row.status, "tilt_not_finite");
}

TEST(WatchBoard, HealthIsStaleAfterItsOwnDeadline) {
  WatchBoard board;
  dds::DeviceHealth health;
  health.machine_id = "tbm7";
  health.device_id = "camera";
  health.published_at = kUtc;
  health.state = dds::DeviceState::kSilent;
  health.detail = "no frame for 2 s";
  board.Add(health, kSteady);
  const WatchRow row =
      RowOf(board, NowAfter(std::chrono::milliseconds(2000)), "device tbm7 camera");
  EXPECT_EQ(row.status, "silent: no frame for 2 s");
  EXPECT_EQ(row.style, WatchStyle::kBad);
  EXPECT_EQ(RowOf(board, NowAfter(std::chrono::milliseconds(3500)), "device tbm7 camera").style,
            WatchStyle::kStale);
}

TEST(WatchBoard, AlarmsStandUntilTheyAreTakenBack) {
  WatchBoard board;
  dds::Alarm alarm{dds::AlarmKind::kInterfaceMismatch, true, "", "built from other files"};
  board.Add(alarm);
  EXPECT_EQ(RowOf(board, NowAfter({}), "alarm interface_mismatch").style, WatchStyle::kBad);
  alarm.active = false;
  board.Add(alarm);
  EXPECT_EQ(board.Rows(NowAfter({})).size(), 1u) << "the heading alone";
}

TEST(WatchBoard, ALineForAPipeHasNoNumbersWhenItIsStale) {
  const std::string fresh = WatchLine(Pose(), 0.1);
  EXPECT_THAT(
      fresh,
      StartsWith("relative_pose machine=tbm7 stamp_ns=1790000000000000000 age_s=0.100 status=ok"));
  EXPECT_THAT(fresh, HasSubstr(" tx_mm=123.0000 sigma_tx_mm=0.1000"));
  EXPECT_THAT(fresh, HasSubstr(" shield_head_bound_mm=1.5000"));
  const std::string stale = WatchLine(Pose(), 0.6);
  EXPECT_THAT(stale, HasSubstr("status=stale was=ok"));
  EXPECT_THAT(stale, Not(HasSubstr("_mm=")));
}

TEST(WatchBoard, TextFromTheWireCannotSteerTheTerminal) {
  WatchBoard board;
  dds::Event event;
  event.machine_id = "tbm7";
  event.source = "box\x1b[2J";
  event.code = "x";
  event.at = kUtc;
  event.text = "a\nb\x1b[31m";
  board.Add(event, kSteady);
  const std::string screen = WatchScreen(board.Rows(NowAfter({})), 100, false);
  EXPECT_THAT(screen, Not(HasSubstr("\x1b")));
  EXPECT_THAT(screen, HasSubstr("a?b?[31m"));
  EXPECT_THAT(WatchLine(event, 0.0), HasSubstr("text=\"a?b?[31m\""));
}

TEST(WatchBoard, LinesFitTheTerminal) {
  WatchBoard board;
  board.Add(Pose(), kSteady);
  const std::string screen = WatchScreen(board.Rows(NowAfter({})), 60, false);
  for (std::size_t at = 0; at < screen.size();) {
    const std::size_t end = screen.find('\n', at);
    EXPECT_LE(end - at, 60u);
    at = end + 1;
  }
  // What a number is worth stays visible when the numbers themselves are cut.
  EXPECT_THAT(WatchScreen(board.Rows(NowAfter({})), 40, false), HasSubstr("pose tbm7      ok"));
  EXPECT_THAT(WatchScreen(board.Rows(NowAfter({})), 132, true), HasSubstr("\x1b[32mpose tbm7"));
}

}  // namespace
}  // namespace tbm
