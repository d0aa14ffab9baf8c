#pragma once

#include "idl/cpp/messages.h"

// One message of each topic in which every field has a value of its own, so that a field that is
// forgotten, doubled or swapped with another shows.
namespace tbm::dds::test {

inline FrameFeatures FullFrameFeatures() {
  FrameFeatures m;
  m.machine_id = "machine-7";
  m.sensed_at.ns = 1'700'000'000'000'000'001;
  m.published_at.ns = 1'700'000'000'000'000'002;
  m.frame_number = 3'000'000'000'003;
  m.exposure_s = 0.004;
  m.reason = PoseReason::kFrameSaturated;
  m.background_dn = 5.5;
  m.noise_dn = 6.25;
  m.rejected_spots = 7;
  m.dropped_spots = 8;
  m.frames_received = 9'000'000'000'009;
  m.frames_lost = 10;
  m.frames_damaged = 11;
  m.frames_skipped = 12;
  for (int i = 0; i < 3; ++i) {
    Spot spot;
    spot.centre.pixel_px = {100.125 + 20 * i, 101.25 + 20 * i};
    spot.centre.sigma_px = 0.102 + i;
    spot.centre.peak_dn = 103.0 + 20 * i;
    spot.centre.background_dn = 104.0 + 20 * i;
    spot.centre.spread_px = 105.5 + 20 * i;
    spot.centre.elongation = 106.5 + 20 * i;
    spot.centre.clipped_pixels = 107 + 20 * i;
    spot.led_index = i == 1 ? -1 : 8 + i;
    m.spots.push_back(spot);
  }
  return m;
}

inline TiltReading FullTiltReading() {
  TiltReading m;
  m.machine_id = "machine-8";
  m.sensor = "camera";
  m.sensed_at.ns = 1'700'000'000'000'000'021;
  m.published_at.ns = 1'700'000'000'000'000'022;
  m.sample_number = 23'000'000'000;
  m.validity = Validity::kDegraded;
  m.reason = "vibration";
  m.inclination = {0.0241, -0.0252};
  m.sigma_rad = 0.000263;
  return m;
}

inline RelativePose FullRelativePose() {
  RelativePose m;
  m.machine_id = "machine-9";
  m.sensed_at.ns = 1'700'000'000'000'000'031;
  m.published_at.ns = 1'700'000'000'000'000'032;
  m.sample_number = 33'000'000'000;
  m.rig_hash = "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef";
  m.status = PoseStatus::kDegraded;
  m.reason = PoseReason::kLedExcluded;
  m.camera_from_target.rotation = Eigen::Quaterniond(0.5, 0.1, -0.7, 0.5);
  m.camera_from_target.translation = {0.341, -0.342, 3.43};
  // Thirty-six different numbers: below the rounding that the boundary allows, a transposed matrix
  // still shows.
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      m.covariance(i, j) = (i == j ? 1e-3 * (i + 1) : 1e-5 * (i + j)) + 1e-11 * (6 * i + j);
    }
  }
  m.leds_used = 0x80000015u;  // LEDs 0, 2, 4 and 31
  m.excluded_led = 3;
  m.tilts_used = true;
  m.chi2 = 35.5;
  m.dof = 36;
  m.rms_px = 0.037;
  for (int i = 0; i < 2; ++i) {
    PosePoint point;
    point.name = i == 0 ? "shield_head" : "shield_tail";
    point.p_in_camera = {40.1 + 10 * i, 40.2 + 10 * i, 40.3 + 10 * i};
    point.sigma_m = 0.0404 + i;
    if (i == 0) point.bound_m = 0.0405;
    m.points.push_back(point);
  }
  return m;
}

inline DeviceHealth FullDeviceHealth() {
  DeviceHealth m;
  m.machine_id = "machine-10";
  m.device_id = "inclinometer_target";
  m.published_at.ns = 1'700'000'000'000'000'051;
  m.state = DeviceState::kSilent;
  m.state_since.ns = 1'700'000'000'000'000'049;
  m.samples_good = 52'000'000'000;
  m.samples_lost = 53;
  m.errors = 54;
  m.reconnects = 55;
  m.detail = "no answer on the serial line for 1.2 s; is the plug in?";
  return m;
}

inline Event FullEvent() {
  Event m;
  m.machine_id = "machine-11";
  m.source = "camera_box";
  m.code = "mounting_moved";
  m.at.ns = 1'700'000'000'000'000'061;
  m.sample_number = 62'000'000'000;
  m.severity = Severity::kWarning;
  m.active = true;
  m.text = "the target's inclinometer no longer agrees with the image: 0.05 degree";
  return m;
}

// Equal bit for bit; NaN equals NaN.
inline bool Same(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }
template <class A, class B>
bool SameAll(const A& a, const B& b) {
  if (a.rows() != b.rows() || a.cols() != b.cols()) return false;
  for (Eigen::Index i = 0; i < a.size(); ++i) {
    if (!Same(a(i / a.cols(), i % a.cols()), b(i / b.cols(), i % b.cols()))) return false;
  }
  return true;
}

inline bool Same(const Spot& a, const Spot& b) {
  return SameAll(a.centre.pixel_px, b.centre.pixel_px) &&
         Same(a.centre.sigma_px, b.centre.sigma_px) && Same(a.centre.peak_dn, b.centre.peak_dn) &&
         Same(a.centre.background_dn, b.centre.background_dn) &&
         Same(a.centre.spread_px, b.centre.spread_px) &&
         Same(a.centre.elongation, b.centre.elongation) &&
         a.centre.clipped_pixels == b.centre.clipped_pixels && a.led_index == b.led_index;
}
inline bool Same(const PosePoint& a, const PosePoint& b) {
  return a.name == b.name && SameAll(a.p_in_camera, b.p_in_camera) && Same(a.sigma_m, b.sigma_m) &&
         a.bound_m == b.bound_m;
}
template <class T, std::size_t N>
bool SameItems(const FixedVector<T, N>& a, const FixedVector<T, N>& b) {
  if (a.size() != b.size()) return false;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!Same(a[i], b[i])) return false;
  }
  return true;
}

inline bool Same(const FrameFeatures& a, const FrameFeatures& b) {
  return a.machine_id == b.machine_id && a.sensed_at == b.sensed_at &&
         a.published_at == b.published_at && a.frame_number == b.frame_number &&
         Same(a.exposure_s, b.exposure_s) && a.reason == b.reason &&
         Same(a.background_dn, b.background_dn) && Same(a.noise_dn, b.noise_dn) &&
         a.rejected_spots == b.rejected_spots && a.dropped_spots == b.dropped_spots &&
         a.frames_received == b.frames_received && a.frames_lost == b.frames_lost &&
         a.frames_damaged == b.frames_damaged && a.frames_skipped == b.frames_skipped &&
         SameItems(a.spots, b.spots);
}
inline bool Same(const TiltReading& a, const TiltReading& b) {
  return a.machine_id == b.machine_id && a.sensor == b.sensor && a.sensed_at == b.sensed_at &&
         a.published_at == b.published_at && a.sample_number == b.sample_number &&
         a.validity == b.validity && a.reason == b.reason &&
         Same(a.inclination.beta_rad, b.inclination.beta_rad) &&
         Same(a.inclination.gamma_rad, b.inclination.gamma_rad) && Same(a.sigma_rad, b.sigma_rad);
}
inline bool Same(const RelativePose& a, const RelativePose& b) {
  return a.machine_id == b.machine_id && a.sensed_at == b.sensed_at &&
         a.published_at == b.published_at && a.sample_number == b.sample_number &&
         a.rig_hash == b.rig_hash && a.status == b.status && a.reason == b.reason &&
         SameAll(a.camera_from_target.rotation.coeffs(), b.camera_from_target.rotation.coeffs()) &&
         SameAll(a.camera_from_target.translation, b.camera_from_target.translation) &&
         SameAll(a.covariance, b.covariance) && a.leds_used == b.leds_used &&
         a.excluded_led == b.excluded_led && a.tilts_used == b.tilts_used && Same(a.chi2, b.chi2) &&
         a.dof == b.dof && Same(a.rms_px, b.rms_px) && SameItems(a.points, b.points);
}
inline bool Same(const DeviceHealth& a, const DeviceHealth& b) {
  return a.machine_id == b.machine_id && a.device_id == b.device_id &&
         a.published_at == b.published_at && a.state == b.state && a.state_since == b.state_since &&
         a.samples_good == b.samples_good && a.samples_lost == b.samples_lost &&
         a.errors == b.errors && a.reconnects == b.reconnects && a.detail == b.detail;
}
inline bool Same(const Event& a, const Event& b) {
  return a.machine_id == b.machine_id && a.source == b.source && a.code == b.code && a.at == b.at &&
         a.sample_number == b.sample_number && a.severity == b.severity && a.active == b.active &&
         a.text == b.text;
}

}  // namespace tbm::dds::test
