// An independent vendor reads and writes our topics on loopback, its types made from the same IDL
// files.
#include <map>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "idl/cpp/publisher.h"
#include "idl/cpp/subscriber.h"
#include "tests/idl/dds_support.h"
#include "tests/idl/samples.h"
#include "tests/support/process.h"

namespace tbm::dds::test {
namespace {

using ::tbm::test::Process;

const std::string kPeer = TBM_CYCLONE_PEER;
const std::vector<std::string> kOnLoopback = {
    "CYCLONEDDS_URI=<CycloneDDS><Domain><General><Interfaces><NetworkInterface name=\"lo\" "
    "multicast=\"true\"/></Interfaces></General></Domain></CycloneDDS>"};

// The lines that the peer prints for a message, made here from the message itself.
class Lines {
 public:
  void Text(const std::string& field, std::string_view value) {
    lines_.push_back(fmt::format("{}={}", field, value));
  }
  void Whole(const std::string& field, std::int64_t value) { Text(field, std::to_string(value)); }
  void Number(const std::string& field, double value) {
    std::array<char, 64> text{};
    std::snprintf(text.data(), text.size(), "%.17g", value);
    Text(field, std::isnan(value) ? "nan" : text.data());
  }
  void End(const std::string& topic) { lines_.push_back(topic + ".end"); }
  std::vector<std::string> lines_;
};

void Describe(const FrameFeatures& m, Lines& lines) {
  lines.Text("features.machine_id", m.machine_id);
  lines.Whole("features.sensed_at_utc_ns", m.sensed_at.ns);
  lines.Whole("features.published_at_utc_ns", m.published_at.ns);
  lines.Whole("features.frame_number", static_cast<std::int64_t>(m.frame_number));
  lines.Number("features.exposure_s", m.exposure_s);
  lines.Text("features.reason", ReasonCode(m.reason));
  lines.Number("features.background_dn", m.background_dn);
  lines.Number("features.noise_dn", m.noise_dn);
  lines.Whole("features.rejected_spots", m.rejected_spots);
  lines.Whole("features.dropped_spots", m.dropped_spots);
  lines.Whole("features.frames_received", static_cast<std::int64_t>(m.frames_received));
  lines.Whole("features.frames_lost", static_cast<std::int64_t>(m.frames_lost));
  lines.Whole("features.frames_damaged", static_cast<std::int64_t>(m.frames_damaged));
  lines.Whole("features.frames_skipped", static_cast<std::int64_t>(m.frames_skipped));
  for (std::size_t i = 0; i < m.spots.size(); ++i) {
    const std::string spot = fmt::format("features.spot{}.", i);
    lines.Number(spot + "u_px", m.spots[i].centre.pixel_px.x());
    lines.Number(spot + "v_px", m.spots[i].centre.pixel_px.y());
    lines.Number(spot + "sigma_px", m.spots[i].centre.sigma_px);
    lines.Number(spot + "peak_dn", m.spots[i].centre.peak_dn);
    lines.Number(spot + "background_dn", m.spots[i].centre.background_dn);
    lines.Number(spot + "spread_px", m.spots[i].centre.spread_px);
    lines.Number(spot + "elongation", m.spots[i].centre.elongation);
    lines.Whole(spot + "clipped_pixels", m.spots[i].centre.clipped_pixels);
    lines.Whole(spot + "led_index", m.spots[i].led_index);
  }
  lines.End("features");
}

void Describe(const TiltReading& m, Lines& lines) {
  lines.Text("inclination.machine_id", m.machine_id);
  lines.Text("inclination.sensor", m.sensor);
  lines.Whole("inclination.sensed_at_utc_ns", m.sensed_at.ns);
  lines.Whole("inclination.published_at_utc_ns", m.published_at.ns);
  lines.Whole("inclination.sample_number", static_cast<std::int64_t>(m.sample_number));
  lines.Whole("inclination.validity", m.validity == Validity::kDegraded ? 1 : -1);
  lines.Text("inclination.reason", m.reason);
  lines.Number("inclination.beta_rad", m.inclination.beta_rad);
  lines.Number("inclination.gamma_rad", m.inclination.gamma_rad);
  lines.Number("inclination.sigma_rad", m.sigma_rad);
  lines.End("inclination");
}

void Describe(const RelativePose& m, Lines& lines) {
  lines.Text("pose.machine_id", m.machine_id);
  lines.Whole("pose.sensed_at_utc_ns", m.sensed_at.ns);
  lines.Whole("pose.published_at_utc_ns", m.published_at.ns);
  lines.Whole("pose.sample_number", static_cast<std::int64_t>(m.sample_number));
  lines.Text("pose.rig_hash", m.rig_hash);
  lines.Whole("pose.status", m.status == PoseStatus::kDegraded ? 1 : -1);
  lines.Whole("pose.reason", m.reason == PoseReason::kLedExcluded ? 16 : -1);
  lines.Text("pose.reason_code", ReasonCode(m.reason));
  lines.Number("pose.qw", m.camera_from_target.rotation.w());
  lines.Number("pose.qx", m.camera_from_target.rotation.x());
  lines.Number("pose.qy", m.camera_from_target.rotation.y());
  lines.Number("pose.qz", m.camera_from_target.rotation.z());
  for (int i = 0; i < 3; ++i) {
    lines.Number(fmt::format("pose.t{}_m", i), m.camera_from_target.translation[i]);
  }
  for (int i = 0; i < 36; ++i) {
    lines.Number(fmt::format("pose.covariance{}", i), m.covariance(i / 6, i % 6));
  }
  lines.Whole("pose.leds_used", 4);
  lines.Whole("pose.leds_used_mask", m.leds_used);
  lines.Whole("pose.excluded_led_index", m.excluded_led.value_or(-1));
  lines.Whole("pose.tilts_used", m.tilts_used);
  lines.Number("pose.chi2", m.chi2);
  lines.Whole("pose.dof", m.dof.value_or(-1));
  lines.Number("pose.rms_px", m.rms_px);
  for (std::size_t i = 0; i < m.points.size(); ++i) {
    const std::string point = fmt::format("pose.point{}.", i);
    lines.Text(point + "name", m.points[i].name);
    lines.Number(point + "x_m", m.points[i].p_in_camera.x());
    lines.Number(point + "y_m", m.points[i].p_in_camera.y());
    lines.Number(point + "z_m", m.points[i].p_in_camera.z());
    lines.Number(point + "sigma_m", m.points[i].sigma_m);
    lines.Number(point + "bound_m", m.points[i].bound_m.value_or(kNaN));
  }
  lines.End("pose");
}

void Describe(const DeviceHealth& m, Lines& lines) {
  lines.Text("health.machine_id", m.machine_id);
  lines.Text("health.device_id", m.device_id);
  lines.Whole("health.published_at_utc_ns", m.published_at.ns);
  lines.Whole("health.state", m.state == DeviceState::kSilent ? 3 : -1);
  lines.Whole("health.state_since_utc_ns", m.state_since.ns);
  lines.Whole("health.samples_good", static_cast<std::int64_t>(m.samples_good));
  lines.Whole("health.samples_lost", static_cast<std::int64_t>(m.samples_lost));
  lines.Whole("health.errors", static_cast<std::int64_t>(m.errors));
  lines.Whole("health.reconnects", static_cast<std::int64_t>(m.reconnects));
  lines.Text("health.detail", m.detail);
  lines.End("health");
}

void Describe(const Event& m, Lines& lines) {
  lines.Text("event.machine_id", m.machine_id);
  lines.Text("event.source", m.source);
  lines.Text("event.code", m.code);
  lines.Whole("event.at_utc_ns", m.at.ns);
  lines.Whole("event.sample_number", static_cast<std::int64_t>(m.sample_number));
  lines.Whole("event.severity", m.severity == Severity::kWarning ? 1 : -1);
  lines.Whole("event.active", m.active);
  lines.Text("event.text", m.text);
  lines.End("event");
}

// The lines about one topic, in the order in which they came.
std::vector<std::string> About(const std::vector<std::string>& lines, const std::string& topic) {
  std::vector<std::string> about;
  for (const std::string& line : lines) {
    if (line.rfind(topic + ".", 0) == 0) about.push_back(line);
  }
  return about;
}

TEST(Cyclone, ReadsEveryFieldOfEveryTopicWeWrite) {
  AlarmLog alarms;
  Participant writing(OnLoopback(130, "writing"), alarms.Handler());
  Publisher<FrameFeatures> features(writing);
  Publisher<TiltReading> tilts(writing);
  Publisher<RelativePose> poses(writing);
  Publisher<DeviceHealth> health(writing);
  Publisher<Event> events(writing);
  Process reader({kPeer, "read", "130"}, kOnLoopback);
  ASSERT_TRUE(Eventually(
      [&] {
        return features.matched_readers() == 1 && tilts.matched_readers() == 1 &&
               poses.matched_readers() == 1 && health.matched_readers() == 1 &&
               events.matched_readers() == 1;
      },
      15s))
      << reader.Output() << alarms.All();
  health.Write(FullDeviceHealth());
  events.Write(FullEvent());
  // Streams are volatile: repeated until the other side has made its own match.
  ASSERT_TRUE(Eventually(
      [&] {
        features.Write(FullFrameFeatures());
        tilts.Write(FullTiltReading());
        poses.Write(FullRelativePose());
        std::this_thread::sleep_for(100ms);
        return reader.HasLine("features.end") && reader.HasLine("inclination.end") &&
               reader.HasLine("pose.end") && reader.HasLine("health.end") &&
               reader.HasLine("event.end");
      },
      15s))
      << reader.Output() << alarms.All();
  EXPECT_EQ(reader.Wait(), 0);
  Lines expected;
  Describe(FullFrameFeatures(), expected);
  Describe(FullTiltReading(), expected);
  Describe(FullRelativePose(), expected);
  Describe(FullDeviceHealth(), expected);
  Describe(FullEvent(), expected);
  for (const char* topic : {"features", "inclination", "pose", "health", "event"}) {
    EXPECT_EQ(About(reader.Lines(), topic), About(expected.lines_, topic));
  }
  EXPECT_EQ(alarms.All(), "");
}

template <class Message>
void ExpectFromPeer(Subscriber<Message>& subscriber, const Message& full) {
  Message received;
  SampleFacts facts;
  ASSERT_TRUE(subscriber.Take(received, facts, 15s));
  EXPECT_TRUE(Same(full, received));
  EXPECT_EQ(subscriber.counters().rejected, 0u);
}

TEST(Cyclone, WritesEveryFieldOfEveryTopicForUs) {
  AlarmLog alarms;
  Participant reading(OnLoopback(131, "reading"), alarms.Handler());
  Subscriber<FrameFeatures> features(reading);
  Subscriber<TiltReading> tilts(reading);
  Subscriber<RelativePose> poses(reading);
  Subscriber<DeviceHealth> health(reading);
  Subscriber<Event> events(reading);
  Process writer({kPeer, "write", "131"}, kOnLoopback);
  ExpectFromPeer(features, FullFrameFeatures());
  ExpectFromPeer(tilts, FullTiltReading());
  ExpectFromPeer(poses, FullRelativePose());
  ExpectFromPeer(health, FullDeviceHealth());
  ExpectFromPeer(events, FullEvent());
  EXPECT_EQ(alarms.Count(AlarmKind::kIncompatibleQos), 0) << alarms.All() << writer.Output();
  EXPECT_EQ(alarms.Count(AlarmKind::kInterfaceMismatch),
            0);  // another vendor says nothing about it
}

}  // namespace
}  // namespace tbm::dds::test
