#include "idl/cpp/convert.h"

#include <bit>

#include "idl/cpp/reason_table.h"
#include "pose/base/check.h"

namespace tbm::dds {
namespace {

v1::PoseStatus WireFrom(PoseStatus status) {
  switch (status) {
    case PoseStatus::kOk:
      return v1::POSE_STATUS_OK;
    case PoseStatus::kDegraded:
      return v1::POSE_STATUS_DEGRADED;
    case PoseStatus::kNone:
      return v1::POSE_STATUS_NONE;
  }
  TBM_CHECK(false);
  return v1::POSE_STATUS_NONE;
}

PoseStatus HouseFrom(v1::PoseStatus status) {
  switch (status) {
    case v1::POSE_STATUS_OK:
      return PoseStatus::kOk;
    case v1::POSE_STATUS_DEGRADED:
      return PoseStatus::kDegraded;
    case v1::POSE_STATUS_NONE:
      return PoseStatus::kNone;
  }
  TBM_CHECK(false);
  return PoseStatus::kNone;
}

v1::TiltValidity WireFrom(Validity validity) {
  switch (validity) {
    case Validity::kInvalid:
      return v1::TILT_INVALID;
    case Validity::kDegraded:
      return v1::TILT_DEGRADED;
    case Validity::kValid:
      return v1::TILT_VALID;
  }
  TBM_CHECK(false);
  return v1::TILT_INVALID;
}

Validity HouseFrom(v1::TiltValidity validity) {
  switch (validity) {
    case v1::TILT_INVALID:
      return Validity::kInvalid;
    case v1::TILT_DEGRADED:
      return Validity::kDegraded;
    case v1::TILT_VALID:
      return Validity::kValid;
  }
  TBM_CHECK(false);
  return Validity::kInvalid;
}

v1::DeviceState WireFrom(DeviceState state) {
  switch (state) {
    case DeviceState::kClosed:
      return v1::DEVICE_CLOSED;
    case DeviceState::kOpening:
      return v1::DEVICE_OPENING;
    case DeviceState::kStreaming:
      return v1::DEVICE_STREAMING;
    case DeviceState::kSilent:
      return v1::DEVICE_SILENT;
    case DeviceState::kFault:
      return v1::DEVICE_FAULT;
  }
  TBM_CHECK(false);
  return v1::DEVICE_FAULT;
}

DeviceState HouseFrom(v1::DeviceState state) {
  switch (state) {
    case v1::DEVICE_CLOSED:
      return DeviceState::kClosed;
    case v1::DEVICE_OPENING:
      return DeviceState::kOpening;
    case v1::DEVICE_STREAMING:
      return DeviceState::kStreaming;
    case v1::DEVICE_SILENT:
      return DeviceState::kSilent;
    case v1::DEVICE_FAULT:
      return DeviceState::kFault;
  }
  TBM_CHECK(false);
  return DeviceState::kFault;
}

v1::EventSeverity WireFrom(Severity severity) {
  switch (severity) {
    case Severity::kInfo:
      return v1::EVENT_INFO;
    case Severity::kWarning:
      return v1::EVENT_WARNING;
    case Severity::kAlarm:
      return v1::EVENT_ALARM;
  }
  TBM_CHECK(false);
  return v1::EVENT_ALARM;
}

Severity HouseFrom(v1::EventSeverity severity) {
  switch (severity) {
    case v1::EVENT_INFO:
      return Severity::kInfo;
    case v1::EVENT_WARNING:
      return Severity::kWarning;
    case v1::EVENT_ALARM:
      return Severity::kAlarm;
  }
  TBM_CHECK(false);
  return Severity::kAlarm;
}

// Through the constructor from a C string: the one from pointer and length leaves the end open.
template <std::size_t N>
eprosima::fastrtps::fixed_string<N> WireFrom(const BoundedText<N>& text) {
  return text.c_str();
}

}  // namespace

void ToWire(const FrameFeatures& message, v1::FrameFeatures& wire) {
  wire.machine_id(WireFrom(message.machine_id));
  wire.sensed_at_utc_ns(message.sensed_at.ns);
  wire.published_at_utc_ns(message.published_at.ns);
  wire.frame_number(message.frame_number);
  wire.exposure_s(message.exposure_s);
  wire.reason(WireFrom(ReasonText(ReasonCode(message.reason))));
  wire.background_dn(message.background_dn);
  wire.noise_dn(message.noise_dn);
  wire.rejected_spots(message.rejected_spots);
  wire.dropped_spots(message.dropped_spots);
  wire.frames_received(message.frames_received);
  wire.frames_lost(message.frames_lost);
  wire.frames_damaged(message.frames_damaged);
  wire.frames_skipped(message.frames_skipped);
  wire.spots().resize(message.spots.size());
  for (std::size_t i = 0; i < message.spots.size(); ++i) {
    const Spot& spot = message.spots[i];
    v1::Spot& to = wire.spots()[i];
    to.u_px(spot.centre.pixel_px.x());
    to.v_px(spot.centre.pixel_px.y());
    to.sigma_px(spot.centre.sigma_px);
    to.peak_dn(spot.centre.peak_dn);
    to.background_dn(spot.centre.background_dn);
    to.spread_px(spot.centre.spread_px);
    to.elongation(spot.centre.elongation);
    to.clipped_pixels(spot.centre.clipped_pixels);
    to.led_index(spot.led_index);
  }
}

void FromWire(const v1::FrameFeatures& wire, FrameFeatures& message) {
  message.machine_id = wire.machine_id().c_str();
  message.sensed_at.ns = wire.sensed_at_utc_ns();
  message.published_at.ns = wire.published_at_utc_ns();
  message.frame_number = wire.frame_number();
  message.exposure_s = wire.exposure_s();
  message.reason = ReasonFromCode(wire.reason().c_str()).value_or(PoseReason::kNone);
  message.background_dn = wire.background_dn();
  message.noise_dn = wire.noise_dn();
  message.rejected_spots = wire.rejected_spots();
  message.dropped_spots = wire.dropped_spots();
  message.frames_received = wire.frames_received();
  message.frames_lost = wire.frames_lost();
  message.frames_damaged = wire.frames_damaged();
  message.frames_skipped = wire.frames_skipped();
  message.spots.clear();
  for (const v1::Spot& from : wire.spots()) {
    Spot spot;
    spot.centre.pixel_px = {from.u_px(), from.v_px()};
    spot.centre.sigma_px = from.sigma_px();
    spot.centre.peak_dn = from.peak_dn();
    spot.centre.background_dn = from.background_dn();
    spot.centre.spread_px = from.spread_px();
    spot.centre.elongation = from.elongation();
    spot.centre.clipped_pixels = from.clipped_pixels();
    spot.led_index = from.led_index();
    message.spots.push_back(spot);
  }
}

void ToWire(const TiltReading& message, v1::Inclination& wire) {
  const bool has_numbers = message.validity != Validity::kInvalid;
  wire.machine_id(WireFrom(message.machine_id));
  wire.sensor(WireFrom(message.sensor));
  wire.sensed_at_utc_ns(message.sensed_at.ns);
  wire.published_at_utc_ns(message.published_at.ns);
  wire.sample_number(message.sample_number);
  wire.validity(WireFrom(message.validity));
  wire.reason(WireFrom(message.reason));
  wire.beta_rad(has_numbers ? message.inclination.beta_rad : kNaN);
  wire.gamma_rad(has_numbers ? message.inclination.gamma_rad : kNaN);
  wire.sigma_rad(has_numbers ? message.sigma_rad : kNaN);
}

void FromWire(const v1::Inclination& wire, TiltReading& message) {
  message.machine_id = wire.machine_id().c_str();
  message.sensor = wire.sensor().c_str();
  message.sensed_at.ns = wire.sensed_at_utc_ns();
  message.published_at.ns = wire.published_at_utc_ns();
  message.sample_number = wire.sample_number();
  message.validity = HouseFrom(wire.validity());
  message.reason = wire.reason().c_str();
  message.inclination = {wire.beta_rad(), wire.gamma_rad()};
  message.sigma_rad = wire.sigma_rad();
}

void ToWire(const RelativePose& message, v1::RelativePose& wire) {
  static const RelativePose
      kNoPose;  // all NaN: whatever stands in a message without a pose stays here
  const bool has_pose = message.status != PoseStatus::kNone;
  const RelativePose& pose = has_pose ? message : kNoPose;

  wire.machine_id(WireFrom(message.machine_id));
  wire.sensed_at_utc_ns(message.sensed_at.ns);
  wire.published_at_utc_ns(message.published_at.ns);
  wire.sample_number(message.sample_number);
  wire.rig_hash(WireFrom(message.rig_hash));
  wire.status(WireFrom(message.status));
  wire.reason(WireFromReason(message.reason));
  wire.reason_code(WireFrom(ReasonText(ReasonCode(message.reason))));
  wire.camera_from_target_qw(pose.camera_from_target.rotation.w());
  wire.camera_from_target_qx(pose.camera_from_target.rotation.x());
  wire.camera_from_target_qy(pose.camera_from_target.rotation.y());
  wire.camera_from_target_qz(pose.camera_from_target.rotation.z());
  for (Eigen::Index i = 0; i < 3; ++i) {
    wire.camera_from_target_translation_m()[static_cast<std::size_t>(i)] =
        pose.camera_from_target.translation[i];
  }
  for (Eigen::Index i = 0; i < 36; ++i) {
    wire.covariance()[static_cast<std::size_t>(i)] = pose.covariance(i / 6, i % 6);
  }
  wire.leds_used(static_cast<std::uint32_t>(std::popcount(pose.leds_used)));
  wire.leds_used_mask(pose.leds_used);
  wire.excluded_led_index(message.excluded_led.value_or(-1));
  wire.tilts_used(pose.tilts_used);
  wire.chi2(pose.chi2);
  wire.dof(pose.dof.value_or(-1));
  wire.rms_px(pose.rms_px);
  wire.points().resize(pose.points.size());
  for (std::size_t i = 0; i < pose.points.size(); ++i) {
    const PosePoint& point = pose.points[i];
    v1::PosePoint& to = wire.points()[i];
    to.name(WireFrom(point.name));
    to.in_camera_m({point.p_in_camera.x(), point.p_in_camera.y(), point.p_in_camera.z()});
    to.sigma_m(point.sigma_m);
    to.bound_m(point.bound_m.value_or(kNaN));
  }
}

void FromWire(const v1::RelativePose& wire, RelativePose& message) {
  message.machine_id = wire.machine_id().c_str();
  message.sensed_at.ns = wire.sensed_at_utc_ns();
  message.published_at.ns = wire.published_at_utc_ns();
  message.sample_number = wire.sample_number();
  message.rig_hash = wire.rig_hash().c_str();
  message.status = HouseFrom(wire.status());
  message.reason = ReasonFromWire(wire.reason()).value_or(PoseReason::kNone);
  message.camera_from_target.rotation = Eigen::Quaterniond(wire.camera_from_target_qw(),
                                                           wire.camera_from_target_qx(),
                                                           wire.camera_from_target_qy(),
                                                           wire.camera_from_target_qz());
  const auto& translation_m = wire.camera_from_target_translation_m();
  message.camera_from_target.translation = {translation_m[0], translation_m[1], translation_m[2]};
  for (Eigen::Index i = 0; i < 36; ++i) {
    message.covariance(i / 6, i % 6) = wire.covariance()[static_cast<std::size_t>(i)];
  }
  message.leds_used = wire.leds_used_mask();
  message.excluded_led.reset();
  if (wire.excluded_led_index() >= 0) message.excluded_led = wire.excluded_led_index();
  message.tilts_used = wire.tilts_used();
  message.chi2 = wire.chi2();
  message.dof.reset();
  if (wire.dof() >= 0) message.dof = wire.dof();
  message.rms_px = wire.rms_px();
  message.points.clear();
  for (const v1::PosePoint& from : wire.points()) {
    PosePoint point;
    point.name = from.name().c_str();
    point.p_in_camera = {from.in_camera_m()[0], from.in_camera_m()[1], from.in_camera_m()[2]};
    point.sigma_m = from.sigma_m();
    if (!std::isnan(from.bound_m())) point.bound_m = from.bound_m();
    message.points.push_back(point);
  }
}

void ToWire(const DeviceHealth& message, v1::DeviceHealth& wire) {
  wire.machine_id(WireFrom(message.machine_id));
  wire.device_id(WireFrom(message.device_id));
  wire.published_at_utc_ns(message.published_at.ns);
  wire.state(WireFrom(message.state));
  wire.state_since_utc_ns(message.state_since.ns);
  wire.samples_good(message.samples_good);
  wire.samples_lost(message.samples_lost);
  wire.errors(message.errors);
  wire.reconnects(message.reconnects);
  wire.detail(WireFrom(message.detail));
}

void FromWire(const v1::DeviceHealth& wire, DeviceHealth& message) {
  message.machine_id = wire.machine_id().c_str();
  message.device_id = wire.device_id().c_str();
  message.published_at.ns = wire.published_at_utc_ns();
  message.state = HouseFrom(wire.state());
  message.state_since.ns = wire.state_since_utc_ns();
  message.samples_good = wire.samples_good();
  message.samples_lost = wire.samples_lost();
  message.errors = wire.errors();
  message.reconnects = wire.reconnects();
  message.detail = wire.detail().c_str();
}

void ToWire(const Event& message, v1::Event& wire) {
  wire.machine_id(WireFrom(message.machine_id));
  wire.source(WireFrom(message.source));
  wire.code(WireFrom(message.code));
  wire.at_utc_ns(message.at.ns);
  wire.sample_number(message.sample_number);
  wire.severity(WireFrom(message.severity));
  wire.active(message.active);
  wire.text(WireFrom(message.text));
}

void FromWire(const v1::Event& wire, Event& message) {
  message.machine_id = wire.machine_id().c_str();
  message.source = wire.source().c_str();
  message.code = wire.code().c_str();
  message.at.ns = wire.at_utc_ns();
  message.sample_number = wire.sample_number();
  message.severity = HouseFrom(wire.severity());
  message.active = wire.active();
  message.text = wire.text().c_str();
}

}  // namespace tbm::dds
