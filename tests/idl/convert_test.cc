#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "idl/cpp/codec.h"
#include "idl/cpp/reason_table.h"
#include "idl/cpp/topics.h"
#include "idl/cpp/wire_type.h"
#include "tests/idl/guidance_samples.h"
#include "tests/idl/rail_samples.h"
#include "tests/idl/samples.h"
#include "tests/support/random.h"

namespace tbm::dds::test {
namespace {

using tbm::test::Random;

template <class Message>
using Wire = typename WireOf<Message>::Type;

template <class Message>
Wire<Message> ToWire(const Message& message) {
  Wire<Message> wire;
  dds::ToWire(message, wire);
  return wire;
}
template <class Message>
Message BackAgain(const Message& message) {
  const Wire<Message> wire = ToWire(message);
  EXPECT_EQ(Check(wire), BoundaryFault::kNone) << FaultText(Check(wire));
  Message back;
  FromWire(wire, back);
  return back;
}

TEST(Convert, KeepsEveryFieldThereAndBack) {
  EXPECT_TRUE(Same(FullFrameFeatures(), BackAgain(FullFrameFeatures())));
  EXPECT_TRUE(Same(FullTiltReading(), BackAgain(FullTiltReading())));
  EXPECT_TRUE(Same(FullRelativePose(), BackAgain(FullRelativePose())));
  EXPECT_TRUE(Same(FullDeviceHealth(), BackAgain(FullDeviceHealth())));
  EXPECT_TRUE(Same(FullEvent(), BackAgain(FullEvent())));
  EXPECT_EQ(FullStationObservation(), BackAgain(FullStationObservation()));
  EXPECT_EQ(FullStationSetUp(), BackAgain(FullStationSetUp()));
  EXPECT_EQ(FullShieldPose(), BackAgain(FullShieldPose()));
  EXPECT_EQ(FullGuidance(), BackAgain(FullGuidance()));
  EXPECT_EQ(FullAlarmStatus(), BackAgain(FullAlarmStatus()));
  EXPECT_EQ(FullCommand(), BackAgain(FullCommand()));
  EXPECT_EQ(FullCommandReply(), BackAgain(FullCommandReply()));
}

TEST(Convert, WritesEachFieldUnderItsOwnName) {
  const auto pose = ToWire(FullRelativePose());
  EXPECT_STREQ(pose.machine_id().c_str(), "machine-9");
  EXPECT_EQ(pose.sensed_at_utc_ns(), 1'700'000'000'000'000'031);
  EXPECT_EQ(pose.published_at_utc_ns(), 1'700'000'000'000'000'032);
  EXPECT_EQ(pose.status(), v1::POSE_STATUS_DEGRADED);
  EXPECT_EQ(pose.reason(), v1::POSE_REASON_LED_EXCLUDED);
  EXPECT_STREQ(pose.reason_code().c_str(), "led_excluded");
  EXPECT_EQ(pose.camera_from_target_qw(), 0.5);
  EXPECT_EQ(pose.camera_from_target_qx(), 0.1);
  EXPECT_EQ(pose.camera_from_target_qy(), -0.7);
  EXPECT_EQ(pose.camera_from_target_qz(), 0.5);
  EXPECT_EQ(pose.camera_from_target_translation_m()[2], 3.43);
  EXPECT_EQ(pose.covariance()[1], FullRelativePose().covariance(0, 1));  // row-major
  EXPECT_EQ(pose.covariance()[6], FullRelativePose().covariance(1, 0));
  EXPECT_EQ(pose.leds_used(), 4u);
  EXPECT_EQ(pose.leds_used_mask(), 0x80000015u);
  EXPECT_EQ(pose.excluded_led_index(), 3);
  EXPECT_TRUE(std::isnan(pose.points()[1].bound_m()));  // nothing limits the error
}

TEST(Convert, EveryReasonHasItsOwnWireNumberAndWord) {
  for (const PoseReason reason : {PoseReason::kNone,
                                  PoseReason::kFrameMissing,
                                  PoseReason::kAmbiguous,
                                  PoseReason::kTiltStale,
                                  PoseReason::kMountingMoved,
                                  PoseReason::kInconsistent}) {
    EXPECT_EQ(ReasonFromWire(WireFromReason(reason)), reason);
    EXPECT_EQ(ReasonFromCode(ReasonCode(reason)), reason);
  }
  for (unsigned i = 0; i <= v1::POSE_REASON_MOUNTING_MOVED; ++i) {
    const auto reason = ReasonFromWire(static_cast<v1::PoseReason>(i));
    ASSERT_TRUE(reason);
    EXPECT_EQ(WireFromReason(*reason), static_cast<v1::PoseReason>(i));
  }
  EXPECT_FALSE(ReasonFromWire(static_cast<v1::PoseReason>(v1::POSE_REASON_MOUNTING_MOVED + 1)));
  EXPECT_FALSE(ReasonFromCode("no_such_word"));
}

TEST(Convert, NothingLeavesAsNaNAndNeverAsZero) {
  RelativePose pose = FullRelativePose();
  pose.status = PoseStatus::kNone;  // with the numbers of the last pose still in it
  pose.reason = PoseReason::kTooFewLeds;
  const RelativePose back = BackAgain(pose);
  EXPECT_EQ(back.status, PoseStatus::kNone);
  EXPECT_EQ(back.reason, PoseReason::kTooFewLeds);
  EXPECT_TRUE(back.camera_from_target.rotation.coeffs().array().isNaN().all());
  EXPECT_TRUE(back.camera_from_target.translation.array().isNaN().all());
  EXPECT_TRUE(back.covariance.array().isNaN().all());
  EXPECT_TRUE(std::isnan(back.chi2));
  EXPECT_TRUE(std::isnan(back.rms_px));
  EXPECT_FALSE(back.dof);
  EXPECT_TRUE(back.points.empty());
  EXPECT_EQ(back.sensed_at, pose.sensed_at);
  EXPECT_EQ(back.sample_number, pose.sample_number);

  TiltReading tilt = FullTiltReading();
  tilt.validity = Validity::kInvalid;
  tilt.reason = "silent";
  const TiltReading tilt_back = BackAgain(tilt);
  EXPECT_TRUE(std::isnan(tilt_back.inclination.beta_rad));
  EXPECT_TRUE(std::isnan(tilt_back.inclination.gamma_rad));
  EXPECT_TRUE(std::isnan(tilt_back.sigma_rad));
  EXPECT_EQ(tilt_back.reason, ReasonText("silent"));
}

TEST(Convert, CutsTextAtAWholeCharacter) {
  EXPECT_EQ(BoundedText<5>("abcdefg").view(), "abcde");
  EXPECT_EQ(BoundedText<5>("abcd\xC3\xBC").view(), "abcd");  // u with dots is two bytes
  EXPECT_EQ(BoundedText<5>(std::string_view("ab\0cd", 5)).view(), "ab");
}

template <class Message>
BoundaryFault After(const Message& full, const std::function<void(Wire<Message>&)>& spoil) {
  auto wire = ToWire(full);
  spoil(wire);
  return Check(wire);
}

TEST(Boundary, RefusesAPoseThatBreaksTheContract) {
  using P = v1::RelativePose;
  const RelativePose full = FullRelativePose();
  const double nan = kNaN;
  const auto after = [&](const std::function<void(P&)>& spoil) { return After(full, spoil); };
  EXPECT_EQ(after([](P& p) { p.machine_id(""); }), BoundaryFault::kNoKey);
  EXPECT_EQ(after([](P& p) { p.sensed_at_utc_ns(0); }), BoundaryFault::kNoTime);
  EXPECT_EQ(after([](P& p) { p.published_at_utc_ns(-1); }), BoundaryFault::kNoTime);
  EXPECT_EQ(after([](P& p) { p.status(static_cast<v1::PoseStatus>(3)); }),
            BoundaryFault::kEnumRange);
  EXPECT_EQ(after([](P& p) { p.reason(static_cast<v1::PoseReason>(99)); }),
            BoundaryFault::kEnumRange);
  EXPECT_EQ(after([](P& p) { p.reason_code("few_leds"); }), BoundaryFault::kContradiction);
  EXPECT_EQ(after([](P& p) { p.status(v1::POSE_STATUS_OK); }), BoundaryFault::kContradiction);
  EXPECT_EQ(after([](P& p) { p.status(v1::POSE_STATUS_NONE); }), BoundaryFault::kContradiction);
  EXPECT_EQ(after([&](P& p) { p.camera_from_target_qy(nan); }), BoundaryFault::kNotFinite);
  EXPECT_EQ(after([](P& p) { p.camera_from_target_qy(0.6); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(after([&](P& p) { p.camera_from_target_translation_m()[1] = nan; }),
            BoundaryFault::kNotFinite);
  EXPECT_EQ(after([&](P& p) { p.covariance()[35] = nan; }), BoundaryFault::kNotFinite);
  EXPECT_EQ(after([](P& p) { p.covariance()[14] = -1e-9; }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(after([](P& p) { p.covariance()[1] += 1e-4; }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(after([](P& p) { p.leds_used(5); }), BoundaryFault::kContradiction);
  EXPECT_EQ(after([](P& p) { p.excluded_led_index(32); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(after([](P& p) { p.chi2(-1.0); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(after([&](P& p) { p.chi2(nan); }), BoundaryFault::kNone);  // no noise model
  EXPECT_EQ(after([](P& p) { p.dof(-2); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(after([&](P& p) { p.rms_px(nan); }), BoundaryFault::kNotFinite);
  EXPECT_EQ(after([](P& p) { p.points().resize(17); }), BoundaryFault::kTooLong);
  EXPECT_EQ(after([](P& p) { p.points()[0].name(""); }), BoundaryFault::kNoKey);
  EXPECT_EQ(after([&](P& p) { p.points()[0].in_camera_m()[0] = nan; }), BoundaryFault::kNotFinite);
  EXPECT_EQ(after([&](P& p) { p.points()[1].sigma_m(nan); }), BoundaryFault::kNotFinite);
  EXPECT_EQ(after([](P& p) { p.points()[0].bound_m(-0.1); }), BoundaryFault::kOutOfRange);
}

TEST(Boundary, RefusesATiltThatBreaksTheContract) {
  using T = v1::Inclination;
  const auto after = [](const std::function<void(T&)>& spoil) {
    return After(FullTiltReading(), spoil);
  };
  EXPECT_EQ(after([](T& t) { t.sensor(""); }), BoundaryFault::kNoKey);
  EXPECT_EQ(after([](T& t) { t.sensed_at_utc_ns(0); }), BoundaryFault::kNoTime);
  EXPECT_EQ(after([](T& t) { t.validity(static_cast<v1::TiltValidity>(7)); }),
            BoundaryFault::kEnumRange);
  EXPECT_EQ(after([](T& t) { t.validity(v1::TILT_VALID); }), BoundaryFault::kContradiction);
  EXPECT_EQ(after([](T& t) { t.reason(""); }), BoundaryFault::kContradiction);
  EXPECT_EQ(after([](T& t) { t.beta_rad(kNaN); }), BoundaryFault::kNotFinite);
  EXPECT_EQ(after([](T& t) { t.gamma_rad(1.6); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(after([](T& t) { t.sigma_rad(-1e-6); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(after([](T& t) { t.validity(v1::TILT_INVALID); }), BoundaryFault::kContradiction);
}

TEST(Boundary, RefusesFeaturesHealthAndEventsThatBreakTheContract) {
  using F = v1::FrameFeatures;
  using H = v1::DeviceHealth;
  using E = v1::Event;
  const auto f = [](const std::function<void(F&)>& s) { return After(FullFrameFeatures(), s); };
  const auto h = [](const std::function<void(H&)>& s) { return After(FullDeviceHealth(), s); };
  const auto e = [](const std::function<void(E&)>& s) { return After(FullEvent(), s); };
  EXPECT_EQ(f([](F& x) { x.reason("no_such_word"); }), BoundaryFault::kEnumRange);
  EXPECT_EQ(f([](F& x) { x.spots().resize(65); }), BoundaryFault::kTooLong);
  EXPECT_EQ(f([](F& x) { x.spots()[0].u_px(kNaN); }), BoundaryFault::kNotFinite);
  EXPECT_EQ(f([](F& x) { x.spots()[2].led_index(-2); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(f([](F& x) { x.spots()[2].elongation(0.5); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(f([](F& x) { x.exposure_s(-0.1); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(f([](F& x) { x.exposure_s(kNaN); }), BoundaryFault::kNone);  // not known
  EXPECT_EQ(h([](H& x) { x.device_id(""); }), BoundaryFault::kNoKey);
  EXPECT_EQ(h([](H& x) { x.state(static_cast<v1::DeviceState>(5)); }), BoundaryFault::kEnumRange);
  EXPECT_EQ(h([](H& x) { x.state_since_utc_ns(0); }), BoundaryFault::kNoTime);
  EXPECT_EQ(e([](E& x) { x.code(""); }), BoundaryFault::kNoKey);
  EXPECT_EQ(e([](E& x) { x.at_utc_ns(0); }), BoundaryFault::kNoTime);
  EXPECT_EQ(e([](E& x) { x.severity(static_cast<v1::EventSeverity>(3)); }),
            BoundaryFault::kEnumRange);
}

TEST(Convert, GuidanceWithoutNumbersSaysNaNAndNeverZero) {
  ShieldPose pose = FullShieldPose();
  pose.validity = Validity::kInvalid;  // with the numbers of the last pose still in it
  const ShieldPose pose_back = BackAgain(pose);
  EXPECT_TRUE(std::isnan(pose_back.heading_rad));
  EXPECT_TRUE(pose_back.covariance.array().isNaN().all());
  EXPECT_EQ(pose_back.reason, pose.reason);
  EXPECT_EQ(pose_back.sample_number, pose.sample_number);

  StationObservation observation = FullStationObservation();
  observation.status = ObservationStatus::kNone;
  const StationObservation none = BackAgain(observation);
  EXPECT_TRUE(std::isnan(none.slope_m));
  EXPECT_FALSE(none.has_position());
  EXPECT_EQ(none.target, observation.target);
  EXPECT_EQ(none.set_up_number, observation.set_up_number);

  Guidance guidance = FullGuidance();
  guidance.points[1].validity = Validity::kInvalid;
  guidance.points[1].reason = "beyond_end";
  const Guidance back = BackAgain(guidance);
  EXPECT_TRUE(std::isnan(back.points[1].deviation_right_m));
  EXPECT_EQ(back.points[1].official_section, -1);
  EXPECT_EQ(back.points[1].name, guidance.points[1].name);
  EXPECT_EQ(back.points[0], guidance.points[0]);
}

TEST(Boundary, RefusesStationAndGuidanceThatBreakTheContract) {
  using O = v1::StationObservation;
  using S = v1::StationSetUp;
  using P = v1::ShieldPose;
  using G = v1::Guidance;
  const auto o = [](const std::function<void(O&)>& s) {
    return After(FullStationObservation(), s);
  };
  const auto u = [](const std::function<void(S&)>& s) { return After(FullStationSetUp(), s); };
  const auto p = [](const std::function<void(P&)>& s) { return After(FullShieldPose(), s); };
  const auto g = [](const std::function<void(G&)>& s) { return After(FullGuidance(), s); };
  EXPECT_EQ(o([](O& x) { x.target(""); }), BoundaryFault::kNoKey);
  EXPECT_EQ(o([](O& x) { x.sensed_at_utc_ns(-1); }), BoundaryFault::kNoTime);
  EXPECT_EQ(o([](O& x) { x.face(static_cast<v1::ObservationFace>(2)); }),
            BoundaryFault::kEnumRange);
  EXPECT_EQ(o([](O& x) { x.reason(""); }), BoundaryFault::kContradiction);
  EXPECT_EQ(o([](O& x) { x.status(v1::OBSERVATION_NONE); }), BoundaryFault::kContradiction);
  EXPECT_EQ(o([](O& x) { x.set_up_number(0); }), BoundaryFault::kContradiction);
  EXPECT_EQ(o([](O& x) { x.slope_m(kNaN); }), BoundaryFault::kContradiction);
  EXPECT_EQ(o([](O& x) { x.slope_m(-1.0); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(o([](O& x) { x.circle_rad(kNaN); }), BoundaryFault::kNotFinite);
  EXPECT_EQ(o([](O& x) { x.by_station()[3] = kNaN; }), BoundaryFault::kNotFinite);
  EXPECT_EQ(o([](O& x) { x.covariance_of_reading_m2()[4] = -1.0; }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(u([](S& x) { x.role(""); }), BoundaryFault::kNoKey);
  EXPECT_EQ(u([](S& x) { x.last_good_check_at_utc_ns(0); }), BoundaryFault::kNoTime);
  EXPECT_EQ(u([](S& x) { x.state(v1::SET_UP_NONE); }), BoundaryFault::kContradiction);
  EXPECT_EQ(u([](S& x) { x.reason(""); }), BoundaryFault::kContradiction);
  EXPECT_EQ(u([](S& x) { x.set_up_number(0); }), BoundaryFault::kContradiction);
  EXPECT_EQ(u([](S& x) { x.covariance()[1] += 1.0; }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(u([](S& x) { x.closure_worst_m(-1.0); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(u([](S& x) { x.references().resize(17); }), BoundaryFault::kTooLong);
  EXPECT_EQ(u([](S& x) { x.references()[1].checked_share(1.1); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(p([](P& x) { x.shield(""); }), BoundaryFault::kNoKey);
  EXPECT_EQ(p([](P& x) { x.validity(v1::GUIDANCE_VALID); }), BoundaryFault::kContradiction);
  EXPECT_EQ(p([](P& x) { x.validity(v1::GUIDANCE_INVALID); }), BoundaryFault::kContradiction);
  EXPECT_EQ(p([](P& x) { x.site_from_shield_qx(0.2); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(p([](P& x) { x.position_in_site_m()[2] = kNaN; }), BoundaryFault::kNotFinite);
  EXPECT_EQ(p([](P& x) { x.covariance()[7] = -1.0; }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(g([](G& x) { x.valid_at_utc_ns(0); }), BoundaryFault::kNoTime);
  EXPECT_EQ(g([](G& x) { x.reason(""); }), BoundaryFault::kContradiction);
  EXPECT_EQ(g([](G& x) { x.stroke_sigma_m(-1.0); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(g([](G& x) { x.lead_right_per_m(kNaN); }), BoundaryFault::kNone);  // not known
  EXPECT_EQ(g([](G& x) { x.points().resize(17); }), BoundaryFault::kTooLong);
  EXPECT_EQ(g([](G& x) { x.points()[0].deviation_right_m(kNaN); }), BoundaryFault::kNotFinite);
  EXPECT_EQ(g([](G& x) { x.points()[0].deviation_up_m(kNaN); }), BoundaryFault::kNone);
  EXPECT_EQ(g([](G& x) { x.points()[0].validity(v1::GUIDANCE_INVALID); }),
            BoundaryFault::kContradiction);
  EXPECT_EQ(g([](G& x) { x.points()[1].right_up_correlation(1.5); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(g([](G& x) { x.ahead()[0].ahead_m(0.0); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(g([](G& x) { x.sources()[0].age_s(kNaN); }), BoundaryFault::kContradiction);
}

TEST(Boundary, RefusesAlarmsAndCommandsThatBreakTheContract) {
  using A = v1::AlarmStatus;
  using C = v1::Command;
  using R = v1::CommandReply;
  const auto a = [](const std::function<void(A&)>& s) { return After(FullAlarmStatus(), s); };
  const auto c = [](const std::function<void(C&)>& s) { return After(FullCommand(), s); };
  const auto r = [](const std::function<void(R&)>& s) { return After(FullCommandReply(), s); };
  EXPECT_EQ(a([](A& x) { x.code(""); }), BoundaryFault::kNoKey);
  EXPECT_EQ(a([](A& x) { x.phase(static_cast<v1::AlarmPhase>(4)); }), BoundaryFault::kEnumRange);
  EXPECT_EQ(a([](A& x) { x.raised_at_utc_ns(-1); }), BoundaryFault::kContradiction);
  EXPECT_EQ(a([](A& x) { x.times_raised(0); }), BoundaryFault::kContradiction);
  EXPECT_EQ(a([](A& x) { x.clear_below(60.0); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(a([](A& x) { x.raise_above(kNaN); }), BoundaryFault::kNotFinite);
  EXPECT_EQ(a([](A& x) { x.shelved_until_utc_ns(0); }), BoundaryFault::kNoTime);
  EXPECT_EQ(a([](A& x) { x.shelved_until_utc_ns(-1); }), BoundaryFault::kContradiction);
  EXPECT_EQ(a([](A& x) { x.shelved_by(""); }), BoundaryFault::kContradiction);
  EXPECT_EQ(a([](A& x) { x.shelved_because(""); }), BoundaryFault::kContradiction);
  EXPECT_EQ(a([](A& x) { x.value(kNaN); }), BoundaryFault::kNone);  // not known
  EXPECT_EQ(c([](C& x) { x.request_id(""); }), BoundaryFault::kNoKey);
  EXPECT_EQ(c([](C& x) { x.by(""); }), BoundaryFault::kNoKey);
  EXPECT_EQ(c([](C& x) { x.expires_at_utc_ns(1); }), BoundaryFault::kContradiction);
  EXPECT_EQ(r([](R& x) { x.outcome(static_cast<v1::CommandOutcome>(4)); }),
            BoundaryFault::kEnumRange);
  EXPECT_EQ(r([](R& x) { x.published_at_utc_ns(0); }), BoundaryFault::kNoTime);
}

TEST(Boundary, RefusesTheRailLineWhereItBreaksTheContract) {
  using T = v1::TrolleyState;
  using L = v1::RailLinePiece;
  using S = v1::SettlementPiece;
  using C = v1::CalibrationStatus;
  const auto t = [](const std::function<void(T&)>& s) { return After(FullTrolleyState(), s); };
  const auto l = [](const std::function<void(L&)>& s) { return After(FullRailLinePiece(), s); };
  const auto s = [](const std::function<void(S&)>& f) { return After(FullSettlementPiece(), f); };
  const auto c = [](const std::function<void(C&)>& f) { return After(FullCalibrationStatus(), f); };
  EXPECT_EQ(t([](T& x) { x.valid_at_utc_ns(0); }), BoundaryFault::kNoTime);
  EXPECT_EQ(t([](T& x) { x.status(static_cast<v1::RailPointStatus>(5)); }),
            BoundaryFault::kEnumRange);
  EXPECT_EQ(t([](T& x) { x.status(v1::RAIL_BRIDGED); }), BoundaryFault::kContradiction);
  EXPECT_EQ(t([](T& x) { x.reason("imu_silent"); }), BoundaryFault::kContradiction);
  EXPECT_EQ(t([](T& x) { x.run_id(""); }), BoundaryFault::kContradiction);
  EXPECT_EQ(t([](T& x) { x.position_world_m()[1] = kNaN; }), BoundaryFault::kNotFinite);
  EXPECT_EQ(t([](T& x) { x.world_from_imu_qw(0.6); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(t([](T& x) { x.sigma_attitude_rad()[2] = -1.0; }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(t([](T& x) { x.tilt_age_s(-0.1); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(t([](T& x) { x.tilt_age_s(kNaN); }), BoundaryFault::kNone);  // never
  const auto none = [](T& x) {
    x.status(v1::RAIL_NONE);
    x.reason("imu_silent");
  };
  EXPECT_EQ(t(none), BoundaryFault::kContradiction);  // with numbers
  EXPECT_EQ(l([](L& x) { x.begins_at_utc_ns(-1); }), BoundaryFault::kNoTime);
  EXPECT_EQ(l([](L& x) { x.piece(0); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(l([](L& x) { x.piece(8); }), BoundaryFault::kContradiction);
  EXPECT_EQ(l([](L& x) { x.piece(7); }), BoundaryFault::kContradiction);  // the last, and not full
  EXPECT_EQ(l([](L& x) { x.points_before(0); }), BoundaryFault::kContradiction);
  EXPECT_EQ(l([](L& x) { x.points().clear(); }), BoundaryFault::kContradiction);
  EXPECT_EQ(l([](L& x) { x.points().resize(129); }), BoundaryFault::kTooLong);
  EXPECT_EQ(l([](L& x) { x.pieces(257); }), BoundaryFault::kTooLong);
  EXPECT_EQ(l([](L& x) { x.line_sha256(""); }), BoundaryFault::kContradiction);
  EXPECT_EQ(l([](L& x) { x.points()[1].distance_m(1.0); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(l([](L& x) { x.points()[1].status(v1::RAIL_NONE); }), BoundaryFault::kContradiction);
  EXPECT_EQ(l([](L& x) { x.points()[0].sigma_world_m()[0] = kNaN; }), BoundaryFault::kNotFinite);
  EXPECT_EQ(s([](S& x) { x.base_run_id(""); }), BoundaryFault::kContradiction);
  EXPECT_EQ(s([](S& x) { x.level(1.0); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(s([](S& x) { x.highest_alert(2); }), BoundaryFault::kContradiction);
  EXPECT_EQ(s([](S& x) { x.points()[0].dz_m(kNaN); }), BoundaryFault::kContradiction);
  EXPECT_EQ(s([](S& x) { x.points()[1].alert(1); }), BoundaryFault::kContradiction);
  const auto not_compared = [](S& x) {
    x.points()[1].dz_m(kNaN);
    x.points()[1].sigma_m(kNaN);
  };
  EXPECT_EQ(s(not_compared), BoundaryFault::kNone);
  EXPECT_EQ(c([](C& x) { x.subject(""); }), BoundaryFault::kNoKey);
  EXPECT_EQ(c([](C& x) { x.calibrated_at_utc_ns(0); }), BoundaryFault::kNoTime);
  EXPECT_EQ(c([](C& x) { x.calibrated_at_utc_ns(-1); }), BoundaryFault::kContradiction);
  EXPECT_EQ(c([](C& x) { x.state(v1::CALIBRATION_VALID); }), BoundaryFault::kContradiction);
  EXPECT_EQ(c([](C& x) { x.state(v1::CALIBRATION_NONE); }), BoundaryFault::kContradiction);
  EXPECT_EQ(c([](C& x) { x.sigmas()[0].sigma(kNaN); }), BoundaryFault::kOutOfRange);
  EXPECT_EQ(c([](C& x) { x.sigmas().resize(9); }), BoundaryFault::kTooLong);
}

TEST(Conversion, ATrolleyWithoutAPlaceKeepsItsAgesAndNoNumbers) {
  TrolleyState state = FullTrolleyState();
  state.status = RailPointStatus::kNone;
  state.reason = "imu_silent";
  const TrolleyState back = BackAgain(state);
  EXPECT_TRUE(std::isnan(back.position_world_m.x()));
  EXPECT_TRUE(std::isnan(back.world_from_imu.w()));
  EXPECT_EQ(back.target_age_s, state.target_age_s);
  EXPECT_EQ(back.came_too_late, state.came_too_late);
  EXPECT_EQ(back.reason, state.reason);
}

template <class Message>
std::vector<char> Encoded(const Message& message) {
  WireSample<Wire<Message>> sample;
  dds::ToWire(message, sample.value);
  WireType<Message> type;
  eprosima::fastrtps::rtps::SerializedPayload_t payload(type.m_typeSize);
  EXPECT_TRUE(type.serialize(&sample, &payload));
  return {reinterpret_cast<char*>(payload.data),
          reinterpret_cast<char*>(payload.data) + payload.length};
}

template <class Message>
class Bytes : public testing::Test {};
struct Fulls {
  static FrameFeatures Of(const FrameFeatures*) { return FullFrameFeatures(); }
  static TiltReading Of(const TiltReading*) { return FullTiltReading(); }
  static RelativePose Of(const RelativePose*) { return FullRelativePose(); }
  static DeviceHealth Of(const DeviceHealth*) { return FullDeviceHealth(); }
  static Event Of(const Event*) { return FullEvent(); }
  static StationObservation Of(const StationObservation*) { return FullStationObservation(); }
  static StationSetUp Of(const StationSetUp*) { return FullStationSetUp(); }
  static ShieldPose Of(const ShieldPose*) { return FullShieldPose(); }
  static Guidance Of(const Guidance*) { return FullGuidance(); }
  static AlarmStatus Of(const AlarmStatus*) { return FullAlarmStatus(); }
  static Command Of(const Command*) { return FullCommand(); }
  static CommandReply Of(const CommandReply*) { return FullCommandReply(); }
  static TrolleyState Of(const TrolleyState*) { return FullTrolleyState(); }
  static RailLinePiece Of(const RailLinePiece*) { return FullRailLinePiece(); }
  static SettlementPiece Of(const SettlementPiece*) { return FullSettlementPiece(); }
  static CalibrationStatus Of(const CalibrationStatus*) { return FullCalibrationStatus(); }
};
using Messages = testing::Types<FrameFeatures,
                                TiltReading,
                                RelativePose,
                                DeviceHealth,
                                Event,
                                StationObservation,
                                StationSetUp,
                                ShieldPose,
                                Guidance,
                                AlarmStatus,
                                Command,
                                CommandReply,
                                TrolleyState,
                                RailLinePiece,
                                SettlementPiece,
                                CalibrationStatus>;
TYPED_TEST_SUITE(Bytes, Messages);

TYPED_TEST(Bytes, CutAtEveryLengthAreRefused) {
  const auto bytes = Encoded(Fulls::Of(static_cast<TypeParam*>(nullptr)));
  WireSample<Wire<TypeParam>> sample;
  ASSERT_TRUE(Decode(bytes.data(), bytes.size(), sample));
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const std::vector<char> cut(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_FALSE(Decode(cut.data(), cut.size(), sample)) << size;
    EXPECT_EQ(Check(sample.value), BoundaryFault::kNoKey);  // nothing of it is left
  }
}

// What a journal holds is what DDS sends, and it comes back whole.
TYPED_TEST(Bytes, OfTheCodecAreThoseOfTheWire) {
  const TypeParam full = Fulls::Of(static_cast<TypeParam*>(nullptr));
  std::vector<std::byte> bytes;
  ASSERT_EQ(EncodeCdr(full, &bytes), BoundaryFault::kNone);
  const auto on_wire = Encoded(full);
  ASSERT_EQ(bytes.size(), on_wire.size());
  EXPECT_EQ(std::memcmp(bytes.data(), on_wire.data(), bytes.size()), 0);
  TypeParam back;
  ASSERT_EQ(DecodeCdr<TypeParam>(bytes, &back), BoundaryFault::kNone);
  EXPECT_TRUE(Same(full, back));
  bytes.pop_back();
  EXPECT_NE(DecodeCdr<TypeParam>(bytes, &back), BoundaryFault::kNone);
  EXPECT_EQ(EncodeCdr(TypeParam{}, &bytes), BoundaryFault::kNoKey);
  EXPECT_TRUE(bytes.empty());
  const std::string_view type = TopicOf<TypeParam>().type;
  const std::string struct_name = "struct " + std::string(type.substr(type.rfind(':') + 1)) + " {";
  EXPECT_NE(IdlTextOf(type).find(struct_name), std::string_view::npos) << struct_name;
}

TYPED_TEST(Bytes, GluedOrWithAFieldMoreAreRefused) {
  auto bytes = Encoded(Fulls::Of(static_cast<TypeParam*>(nullptr)));
  const auto once = bytes;
  WireSample<Wire<TypeParam>> sample;
  bytes.insert(bytes.end(), once.begin(), once.end());
  EXPECT_FALSE(Decode(bytes.data(), bytes.size(), sample));
  bytes = once;
  bytes.insert(bytes.end(), {1, 2, 3, 4});  // a long at the end: the next version of the type
  EXPECT_FALSE(Decode(bytes.data(), bytes.size(), sample));
}

TYPED_TEST(Bytes, InAnotherEncodingAreRefused) {
  auto bytes = Encoded(Fulls::Of(static_cast<TypeParam*>(nullptr)));
  WireSample<Wire<TypeParam>> sample;
  for (const char encoding :
       std::initializer_list<char>{2, 3, 6, 7, 8, 9, 10, 11, 20}) {  // parameter lists, XCDR2
    bytes[1] = encoding;
    EXPECT_FALSE(Decode(bytes.data(), bytes.size(), sample)) << int{encoding};
  }
}

// Whatever bit flips, either the sample is refused or every promise of the contract still holds.
TYPED_TEST(Bytes, WithOneBitFlippedNeverBreakAPromise) {
  const auto bytes = Encoded(Fulls::Of(static_cast<TypeParam*>(nullptr)));
  WireSample<Wire<TypeParam>> sample;
  TypeParam message;
  for (std::size_t bit = 0; bit < bytes.size() * 8; ++bit) {
    auto flipped = bytes;
    flipped[bit / 8] = static_cast<char>(flipped[bit / 8] ^ (1 << (bit % 8)));
    if (!Decode(flipped.data(), flipped.size(), sample)) continue;
    if (Check(sample.value) != BoundaryFault::kNone) continue;
    FromWire(sample.value, message);  // aborts on an enumerator out of range
  }
}

TEST(BytesOfGarbage, AreRefusedWithoutCrash) {
  Random random("BytesOfGarbage");
  WireSample<v1::RelativePose> pose;
  WireSample<v1::FrameFeatures> features;
  for (int draw = 0; draw < 2000; ++draw) {
    std::vector<char> bytes(static_cast<std::size_t>(random.Index(3000)));
    for (char& byte : bytes) byte = static_cast<char>(random.Bits());
    if (bytes.size() >= 4) bytes[0] = 0, bytes[1] = static_cast<char>(draw % 2);
    EXPECT_FALSE(Decode(bytes.data(), bytes.size(), pose));
    EXPECT_FALSE(Decode(bytes.data(), bytes.size(), features));
  }
}

}  // namespace
}  // namespace tbm::dds::test
