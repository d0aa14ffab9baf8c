#include "guidance/app/watch_board.h"

#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pose/base/angle.h"
#include "tests/idl/rail_samples.h"

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
  dds::Alarm alarm{
      dds::AlarmKind::kInterfaceMismatch, true, "", "a program", "built from other files"};
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

dds::Guidance Steering() {
  dds::Guidance guidance;
  guidance.machine_id = "tbm7";
  guidance.valid_at = kUtc;
  guidance.validity = dds::Validity::kValid;
  guidance.steer_by = "cutter_face";
  guidance.set_up_number = 3;
  guidance.lead_right_per_m = 0.0012;
  guidance.lead_up_per_m = -0.0003;
  guidance.lead_right_sigma_per_m = 0.0001;
  guidance.lead_up_sigma_per_m = 0.0002;
  guidance.articulation_right_rad = 0.004;
  guidance.articulation_up_rad = -0.001;
  guidance.articulation_roll_rad = 0.0005;
  guidance.stroke_m = 0.5123;
  guidance.ring_number = 45;
  guidance.prisms_used = 4;
  guidance.prisms_dof = 5;
  guidance.prisms_rms_m = 0.0008;
  dds::GuidedPoint point;
  point.name = "cutter_face";
  point.shield = "front";
  point.validity = dds::Validity::kValid;
  point.chainage_m = 2266.7234;
  point.official_chainage_m = 2291.7234;
  point.official_section = 1;
  point.deviation_right_m = 0.0123;
  point.deviation_up_m = -0.0045;
  point.deviation_right_sigma_m = 0.0021;
  point.deviation_up_sigma_m = 0.0089;
  point.trend_right_per_m = 0.0004;
  point.trend_up_per_m = 0.0001;
  point.trend_length_m = 5.0;
  guidance.points.push_back(point);
  guidance.sources.push_back({"station", dds::SourceFreshness::kFresh, 12.0, ""});
  guidance.sources.push_back({"camera", dds::SourceFreshness::kFresh, 0.2, ""});
  guidance.ahead.push_back({1.0, 0.013, -0.005, 0.002, 0.003});
  guidance.ahead.push_back({5.0, 0.0143, -0.0055, 0.004, 0.0045});
  return guidance;
}

TEST(WatchBoard, ShowsWhatTheOperatorSteersBy) {
  WatchBoard board;
  board.Add(Steering(), kSteady);
  const WatchNow now = NowAfter(std::chrono::milliseconds(150));
  const WatchRow head = RowOf(board, now, "guidance tbm7");
  EXPECT_EQ(head.value, "chainage 2266.723, on the wall 2291.723/1, ring 45, stroke 512.3 mm");
  EXPECT_EQ(head.status, "valid");
  EXPECT_EQ(head.style, WatchStyle::kGood);
  const WatchRow face = RowOf(board, now, " > cutter_face");
  EXPECT_EQ(face.value, "right    +12.3  up     -4.5 mm  at 2266.723");
  EXPECT_EQ(face.sigma, "2.1 8.9");
  EXPECT_EQ(RowOf(board, now, "   lead, look-up").value, "right     +1.2  up     -0.3 mm/m");
  EXPECT_EQ(RowOf(board, now, "   lead, look-up").sigma, "0.1 0.2");
  EXPECT_EQ(RowOf(board, now, "   articulation").value,
            "right     +4.0  up     -1.0 mm/m  roll     +0.5 mm/m");
  EXPECT_THAT(RowOf(board, now, "   trend").value, HasSubstr("+0.4  up     +0.1 mm/m  over 5.0 m"));
  EXPECT_EQ(RowOf(board, now, "   5 m ahead").value, "right    +14.3  up     -5.5 mm");
  EXPECT_EQ(RowOf(board, now, "   5 m ahead").sigma, "4.0 4.5");
  EXPECT_EQ(RowOf(board, now, "   source station").value, "set-up 3, prisms 4, rms 0.8 mm");
  EXPECT_EQ(RowOf(board, now, "   source station").status, "fresh 12 s");
}

TEST(WatchBoard, SigmasStandBesideTheirNumbersHoweverLongASentenceIs) {
  WatchBoard board;
  board.Add(Steering(), kSteady);
  dds::Event event;
  event.machine_id = "tbm7";
  event.source = "box";
  event.code = "x";
  event.at = kUtc;
  const std::string sentence(150, 'a');
  event.text = std::string_view(sentence);
  board.Add(event, kSteady);
  const std::string screen = WatchScreen(board.Rows(NowAfter({})), 132, false);
  const std::size_t line = screen.find("> cutter_face");
  EXPECT_THAT(screen.substr(line, screen.find('\n', line) - line), HasSubstr("2.1 8.9"));
}

TEST(WatchBoard, ACoastingSourceSaysForHowLongAndHowWell) {
  WatchBoard board;
  dds::Guidance guidance = Steering();
  guidance.validity = dds::Validity::kDegraded;
  guidance.reason = "station_coasting";
  guidance.sources[0] = {"station", dds::SourceFreshness::kCoasting, 250.0, "prism_not_found"};
  board.Add(guidance, kSteady);
  const WatchNow now = NowAfter(std::chrono::milliseconds(100));
  const WatchRow source = RowOf(board, now, "   source station");
  EXPECT_EQ(source.status, "coasting 4 min, +-9 mm");
  EXPECT_EQ(source.style, WatchStyle::kDegraded);
  EXPECT_THAT(source.value, HasSubstr("; prism_not_found"));
  EXPECT_EQ(RowOf(board, now, "guidance tbm7").status, "degraded station_coasting");
}

TEST(WatchBoard, MissingIsDashesNeverZero) {
  WatchBoard board;
  dds::Guidance guidance;
  guidance.machine_id = "tbm7";
  guidance.valid_at = kUtc;
  guidance.reason = "no_prisms";
  guidance.steer_by = "cutter_face";
  dds::GuidedPoint point;
  point.name = "cutter_face";
  guidance.points.push_back(point);
  guidance.sources.push_back({"station", dds::SourceFreshness::kMissing, NAN, ""});
  board.Add(guidance, kSteady);
  dds::ShieldPose shield;
  shield.machine_id = "tbm7";
  shield.shield = "rear";
  shield.valid_at = kUtc;
  board.Add(shield, kSteady);
  dds::StationSetUp set_up;
  set_up.machine_id = "tbm7";
  set_up.role = "in_use";
  set_up.published_at = kUtc;
  board.Add(set_up, kSteady);
  for (const WatchRow& row : board.Rows(NowAfter(std::chrono::milliseconds(100)))) {
    if (row.style == WatchStyle::kHeading) continue;
    EXPECT_THAT(row.value + row.sigma, Not(HasSubstr("nan"))) << row.what;
    EXPECT_THAT(row.value + row.sigma, Not(HasSubstr("0.0"))) << row.what;
    EXPECT_EQ(row.style, WatchStyle::kBad) << row.what;
  }
  const WatchNow now = NowAfter(std::chrono::milliseconds(100));
  EXPECT_EQ(RowOf(board, now, "guidance tbm7").value,
            "chainage --, on the wall --, ring --, stroke -- mm");
  EXPECT_EQ(RowOf(board, now, "guidance tbm7").status, "none no_prisms");
  EXPECT_EQ(RowOf(board, now, " > cutter_face").value, "right       --  up       -- mm  at --");
  EXPECT_EQ(RowOf(board, now, "   ahead").value, "right       --  up       -- mm");
  EXPECT_EQ(RowOf(board, now, "   source station").status, "missing");
  EXPECT_THAT(RowOf(board, now, "shield tbm7 rear").value, HasSubstr("rests on --"));
  EXPECT_THAT(RowOf(board, now, "station tbm7 in_use").value, HasSubstr("checked --"));
}

TEST(WatchBoard, OldGuidanceIsStaleInEveryRow) {
  WatchBoard board;
  board.Add(Steering(), kSteady);
  for (const WatchRow& row : board.Rows(NowAfter(std::chrono::milliseconds(900)))) {
    if (row.style == WatchStyle::kHeading) continue;
    EXPECT_EQ(row.style, WatchStyle::kStale) << row.what;
    EXPECT_EQ(row.sigma, "") << row.what;
    EXPECT_TRUE(row.value.empty() || row.value.starts_with("(")) << row.what;
  }
}

TEST(WatchBoard, AlarmsSayCauseAndWhatToDoAndOutliveTheirSender) {
  WatchBoard board;
  dds::AlarmStatus alarm;
  alarm.machine_id = "tbm7";
  alarm.source = "guidance";
  alarm.code = "deviation_high";
  alarm.published_at = kUtc;
  alarm.raised_at = kUtc - std::chrono::seconds(90);
  alarm.phase = dds::AlarmPhase::kUnacknowledged;
  alarm.urgency = dds::AlarmUrgency::kHigh;
  alarm.value = 52.34;
  alarm.raise_above = 50.0;
  alarm.unit = "mm";
  alarm.cause = "cutter_face is off the design";
  alarm.response = "steer back, no faster than 5 mm/m";
  board.Add(alarm, kSteady);
  dds::AlarmStatus other = alarm;
  other.code = "roll_high";
  other.phase = dds::AlarmPhase::kNormal;
  board.Add(other, kSteady);
  WatchRow row =
      RowOf(board, NowAfter(std::chrono::milliseconds(100)), "ALARM guidance deviation_high");
  EXPECT_EQ(row.value,
            "cutter_face is off the design (52.3 mm, limit 50); steer back, no faster than 5 mm/m");
  EXPECT_EQ(row.status, "high unacknowledged");
  EXPECT_EQ(row.age, "90 s");
  EXPECT_EQ(row.style, WatchStyle::kBad);
  EXPECT_EQ(board.Rows(NowAfter({})).size(), 2u) << "a normal alarm is no row";

  row = RowOf(board, NowAfter(std::chrono::seconds(60)), "ALARM guidance deviation_high");
  EXPECT_EQ(row.status, "high unacknowledged, source silent");
  EXPECT_EQ(row.style, WatchStyle::kBad);

  alarm.phase = dds::AlarmPhase::kAcknowledged;
  alarm.acknowledged_by = "m.weber";
  board.Add(alarm, kSteady);
  EXPECT_EQ(RowOf(board, NowAfter({}), "ALARM guidance deviation_high").status,
            "high acknowledged by m.weber");
}

TEST(WatchBoard, AShelvedAlarmStandsLastInPlainDressUntilItsTime) {
  WatchBoard board;
  dds::AlarmStatus alarm;
  alarm.machine_id = "tbm7";
  alarm.source = "guidance";
  alarm.code = "camera_late";
  alarm.published_at = kUtc;
  alarm.cause = "no pose from the camera box";
  alarm.shelved_until = kUtc + std::chrono::minutes(20);  // kUtc is 14:13:20
  alarm.shelved_by = "m.weber";
  alarm.shelved_because = "the camera is being cleaned";
  board.Add(alarm, kSteady);
  const std::string name = "ALARM guidance camera_late";
  EXPECT_EQ(RowOf(board, NowAfter({}), name).status,
            "medium normal, shelved until 14:33 UTC by m.weber");
  alarm.phase = dds::AlarmPhase::kUnacknowledged;
  alarm.raised_at = kUtc;
  alarm.raise_number = 1;
  board.Add(alarm, kSteady);
  dds::AlarmStatus other = alarm;
  other.code = "roll_high";
  other.phase = dds::AlarmPhase::kAcknowledged;
  other.raise_number = 2;
  other.shelved_until = dds::kNever;
  other.shelved_by = {};
  other.shelved_because = {};
  board.Add(other, kSteady);
  const auto rows = board.Rows(NowAfter({}));
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows[1].what, "ALARM guidance roll_high");
  EXPECT_EQ(rows[2].what, name);
  EXPECT_EQ(rows[2].style, WatchStyle::kPlain);
  EXPECT_THAT(WatchLine(alarm, 0.1), HasSubstr(" shelved_until_ns=1790001200000000000 "));
  EXPECT_THAT(WatchLine(alarm, 0.1), HasSubstr(" shelved_by=\"m.weber\""));
  // Nothing was heard since: it ends all the same.
  const WatchRow over = RowOf(board, NowAfter(std::chrono::minutes(20)), name);
  EXPECT_EQ(over.status, "medium unacknowledged, source silent");
  EXPECT_EQ(over.style, WatchStyle::kBad);
}

TEST(WatchBoard, AShieldAndASetUpShowTheirNumbers) {
  WatchBoard board;
  dds::ShieldPose shield;
  shield.machine_id = "tbm7";
  shield.shield = "front";
  shield.valid_at = kUtc;
  shield.validity = dds::Validity::kValid;
  shield.age_s = 31.0;
  shield.site_from_shield.translation = {1038.5672, 5045.9627, 99.1};
  shield.heading_rad = DegToRad(40.0);
  shield.pitch_rad = -0.015;
  shield.roll_rad = 0.0021;
  shield.roll_sigma_rad = 0.00011;
  shield.pitch_sigma_rad = 0.00022;
  board.Add(shield, kSteady);
  dds::StationSetUp set_up;
  set_up.machine_id = "tbm7";
  set_up.role = "proposed";
  set_up.published_at = kUtc;
  set_up.set_up_number = 4;
  set_up.state = dds::SetUpState::kGood;
  set_up.last_good_check_at = kUtc - std::chrono::seconds(300);
  set_up.position_in_site_m = {1017.8, 5017.7, 101.6};
  set_up.covariance = 1e-6 * Eigen::Matrix4d::Identity();
  set_up.closure_worst_m = 0.0021;
  set_up.closure_tolerance_m = 0.005;
  set_up.closure_points = 3;
  set_up.references.resize(2);
  set_up.references[1].used = true;
  board.Add(set_up, kSteady);
  const WatchNow now = NowAfter(std::chrono::milliseconds(100));
  EXPECT_EQ(RowOf(board, now, "shield tbm7 front").value,
            "roll     +2.1  pitch    -15.0 mm/m, heading 40.0000 deg, at 1038.5672 5045.9627 "
            "99.1000 m, rests on 31 s ago");
  EXPECT_EQ(RowOf(board, now, "shield tbm7 front").sigma, "0.11 0.22");
  EXPECT_EQ(RowOf(board, now, "station tbm7 proposed").value,
            "set-up 4 at 1017.8000 5017.7000 101.6000 m, references 1 of 2, checked 5 min ago, "
            "closure 2.1 of 5.0 mm at 3 points");
  EXPECT_EQ(RowOf(board, now, "station tbm7 proposed").sigma, "1.0 1.0 1.0");
}

TEST(WatchLine, GuidanceGivesItsNumbersAndLeavesOutWhatIsMissing) {
  const std::string line = WatchLine(Steering(), 0.1);
  EXPECT_THAT(line,
              StartsWith("guidance machine=tbm7 stamp_ns=1790000000000000000 age_s=0.100 "
                         "status=valid steer_by=cutter_face ring=45 stroke_mm=512.30"));
  EXPECT_THAT(line, HasSubstr(" cutter_face_right_mm=12.30 cutter_face_up_mm=-4.50"));
  EXPECT_THAT(line, HasSubstr(" station=fresh station_age_s=12.0"));
  const std::string stale = WatchLine(Steering(), 2.0);
  EXPECT_THAT(stale, HasSubstr("status=stale was=valid"));
  EXPECT_THAT(stale, Not(HasSubstr("_mm=")));
  dds::Guidance nothing = Steering();
  nothing.points[0].deviation_up_m = NAN;
  nothing.ring_number = -1;
  EXPECT_THAT(WatchLine(nothing, 0.1), Not(HasSubstr("cutter_face_up_mm")));
  EXPECT_THAT(WatchLine(nothing, 0.1), Not(HasSubstr("ring=")));
  dds::ShieldPose shield;
  shield.shield = "rear";
  shield.reason = "no_prisms";
  EXPECT_THAT(WatchLine(shield, 0.1), HasSubstr("status=none shield=rear reason=no_prisms"));
  EXPECT_THAT(WatchLine(shield, 0.1), Not(HasSubstr("east_m")));
}

TEST(WatchBoard, ALineIsToldWholeOnlyWhenAllItsPiecesAreThere) {
  WatchBoard board;
  dds::RailLinePiece piece = dds::test::FullRailLinePiece();
  piece.pieces = 2;
  piece.piece = 1;
  board.Add(piece, kSteady);
  const WatchNow now = NowAfter(std::chrono::milliseconds(100));
  EXPECT_EQ(RowOf(board, now, "line machine-20").status, "1 of 2 pieces");
  EXPECT_EQ(RowOf(board, now, "line machine-20").sigma, "");
  piece.piece = 2;
  board.Add(piece, kSteady);
  EXPECT_EQ(RowOf(board, now, "line machine-20").status, "whole");
  EXPECT_THAT(RowOf(board, now, "line machine-20").value, HasSubstr("91.50 m"));
  piece.run_id = "the next";
  board.Add(piece, kSteady);  // nothing of the run before is left
  EXPECT_EQ(RowOf(board, now, "line machine-20").status, "1 of 2 pieces");
}

TEST(WatchBoard, TheTrolleyWithoutAPlaceGivesItsReasonAndSettlementItsAlert) {
  WatchBoard board;
  dds::TrolleyState state = dds::test::FullTrolleyState();
  state.published_at = kUtc;
  board.Add(state, kSteady);
  const WatchNow now = NowAfter(std::chrono::milliseconds(100));
  EXPECT_THAT(RowOf(board, now, "trolley machine-19").value, HasSubstr("804.1000 -805.2000"));
  EXPECT_EQ(RowOf(board, now, "trolley machine-19").status, "open");
  state.status = dds::RailPointStatus::kNone;
  state.reason = "imu_silent";
  board.Add(state, kSteady);
  EXPECT_EQ(RowOf(board, now, "trolley machine-19").status, "none imu_silent");
  EXPECT_EQ(RowOf(board, now, "trolley machine-19").value, "");
  EXPECT_THAT(WatchLine(state, 0.1), Not(HasSubstr("x_m=")));
  dds::SettlementPiece piece = dds::test::FullSettlementPiece();
  piece.pieces = 1;
  piece.piece = 1;
  board.Add(piece, kSteady);
  const WatchRow row = RowOf(board, now, "settlement machine-21");
  EXPECT_EQ(row.status, "ALERT 4, whole");
  EXPECT_EQ(row.style, WatchStyle::kBad);
  EXPECT_THAT(row.value, HasSubstr("-10.70 mm at 10.60 m"));
}

TEST(WatchBoard, ASettlementSaysHowMuchWasComparedAndNothingOfChance) {
  WatchBoard board;
  dds::SettlementPiece piece = dds::test::FullSettlementPiece();
  piece.pieces = 1;
  piece.piece = 1;
  piece.highest_alert = 0;
  piece.level = 0.95;
  piece.points_in_all = 40;
  piece.points.clear();
  for (int i = 0; i < 40; ++i) {
    // One place in twenty is significant by chance, one in eight has not been compared.
    dds::SettlementPoint point;
    point.distance_m = 0.1 * i;
    point.sigma_m = i % 8 == 0 ? dds::kNaN : 4e-4;
    point.dz_m = i % 8 == 0 ? dds::kNaN : i % 20 == 1 ? -1e-3 : 1e-4;
    point.is_significant = i % 20 == 1;
    piece.points.push_back(point);
  }
  board.Add(piece, kSteady);
  const WatchNow now = NowAfter(std::chrono::milliseconds(100));
  EXPECT_THAT(RowOf(board, now, "settlement machine-21").value,
              HasSubstr(": 35 of 40 places compared, nothing moved that chance would not give"));
  piece.points[7].dz_m = -2e-3;
  piece.points[7].is_significant = true;
  board.Add(piece, kSteady);
  EXPECT_THAT(RowOf(board, now, "settlement machine-21").value,
              HasSubstr(": 35 of 40 places compared, -2.00 mm at 0.70 m"));
}

TEST(WatchBoard, ACalibrationThatIsDueIsNotShownAsGood) {
  WatchBoard board;
  dds::CalibrationStatus status = dds::test::FullCalibrationStatus();
  status.published_at = kUtc;
  board.Add(status, kSteady);
  const WatchRow row =
      RowOf(board, NowAfter(std::chrono::milliseconds(100)), "calibration machine-23 imu_mounting");
  EXPECT_EQ(row.status, "due overdue");
  EXPECT_EQ(row.style, WatchStyle::kDegraded);
  EXPECT_THAT(row.value, HasSubstr("116 days old of 90, used by rail_line"));
}

}  // namespace
}  // namespace tbm
