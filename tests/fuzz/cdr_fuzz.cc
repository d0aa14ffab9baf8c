// Arbitrary bytes from the network as a sample of each topic. First byte: which topic; the rest is
// the payload as RTPS delivers it. What the boundary lets through is finite where it promises to
// be, knows its enumerators, and says the same again when it is sent on.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <tuple>
#include <vector>

#include "idl/cpp/codec.h"
#include "idl/cpp/wire_type.h"
#include "pose/rig/rig.h"
#include "tests/idl/guidance_samples.h"
#include "tests/idl/rail_samples.h"
#include "tests/idl/samples.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

namespace tbm::dds {
namespace {

void Expect(bool holds) {
  if (!holds) std::abort();
}
bool IsFinite(double value) { return std::isfinite(value); }
bool IsAbsentOrNotNegative(double value) {
  return std::isnan(value) || (IsFinite(value) && value >= 0.0);
}

void ExpectSound(const FrameFeatures& m) {
  Expect(!m.machine_id.empty() && m.sensed_at.ns > 0 && m.published_at.ns > 0);
  Expect(m.spots.size() <= kMaxSpots && !std::isinf(m.background_dn));
  Expect(IsAbsentOrNotNegative(m.exposure_s) && IsAbsentOrNotNegative(m.noise_dn));
  for (const Spot& spot : m.spots) {
    const Centre& centre = spot.centre;
    Expect(centre.pixel_px.allFinite() && spot.led_index >= -1 && spot.led_index < kMaxLeds);
    Expect(IsAbsentOrNotNegative(centre.sigma_px) && IsAbsentOrNotNegative(centre.peak_dn) &&
           IsAbsentOrNotNegative(centre.spread_px) && IsAbsentOrNotNegative(centre.elongation) &&
           !std::isinf(centre.background_dn) && centre.clipped_pixels >= 0);
  }
}

void ExpectSound(const TiltReading& m) {
  Expect(!m.machine_id.empty() && !m.sensor.empty());
  Expect(m.sensed_at.ns > 0 && m.published_at.ns > 0);
  Expect(m.validity == Validity::kInvalid || m.validity == Validity::kDegraded ||
         m.validity == Validity::kValid);
  const bool has_numbers = m.validity != Validity::kInvalid;
  Expect(IsFinite(m.inclination.beta_rad) == has_numbers);
  Expect(IsFinite(m.inclination.gamma_rad) == has_numbers);
  Expect(IsFinite(m.sigma_rad) == has_numbers);
  Expect(m.reason.empty() == (m.validity == Validity::kValid));
}

void ExpectSound(const RelativePose& m) {
  Expect(!m.machine_id.empty() && m.sensed_at.ns > 0 && m.published_at.ns > 0);
  Expect(!StatusCode(m.status).empty());
  Expect((m.status == PoseStatus::kOk) == (m.reason == PoseReason::kNone));
  Expect(!m.excluded_led || (*m.excluded_led >= 0 && *m.excluded_led < kMaxLeds));
  const bool has_pose = m.status != PoseStatus::kNone;
  for (const double part : m.camera_from_target.rotation.coeffs()) {
    Expect(IsFinite(part) == has_pose);
  }
  Expect(m.camera_from_target.translation.allFinite() == has_pose);
  Expect(m.covariance.allFinite() == has_pose && IsFinite(m.rms_px) == has_pose);
  if (!has_pose) return Expect(m.points.size() == 0);
  Expect(std::abs(m.camera_from_target.rotation.norm() - 1.0) < 1e-5);
  Expect(m.covariance.diagonal().minCoeff() >= 0.0 && IsAbsentOrNotNegative(m.chi2));
  Expect(!m.dof || *m.dof >= 0);
  for (const PosePoint& point : m.points) {
    Expect(!point.name.empty() && point.p_in_camera.allFinite());
    Expect(IsFinite(point.sigma_m) && point.sigma_m >= 0.0);
    Expect(!point.bound_m || (IsFinite(*point.bound_m) && *point.bound_m >= 0.0));
  }
}

void ExpectSound(const DeviceHealth& m) {
  Expect(!m.machine_id.empty() && !m.device_id.empty() && !StateCode(m.state).empty());
  Expect(m.published_at.ns > 0 && m.state_since.ns > 0);
}

void ExpectSound(const Event& m) {
  Expect(!m.machine_id.empty() && !m.source.empty() && !m.code.empty());
  Expect(!SeverityCode(m.severity).empty() && m.at.ns > 0);
}

void ExpectSound(const StationObservation& m) {
  Expect(!m.target.empty() && m.sensed_at.ns > 0);
  Expect((m.status == ObservationStatus::kGood) == m.reason.empty());
  Expect(IsFinite(m.circle_rad) == (m.status != ObservationStatus::kNone));
  if (m.has_position()) Expect(m.by_station.allFinite() && m.set_up_number > 0);
}
void ExpectSound(const StationSetUp& m) {
  const bool is_there = m.state != SetUpState::kNone;
  Expect(!m.role.empty() && m.covariance.allFinite() == is_there);
  if (is_there) Expect(m.covariance.diagonal().minCoeff() >= 0.0);
}
void ExpectSound(const ShieldPose& m) {
  const bool is_there = m.validity != Validity::kInvalid;
  Expect(m.site_from_shield.translation.allFinite() == is_there && IsFinite(m.age_s) == is_there);
  if (is_there) Expect(std::abs(m.site_from_shield.rotation.norm() - 1.0) < 1e-5);
}
void ExpectSound(const Guidance& m) {
  Expect(m.points.size() <= kMaxPoints && m.ahead.size() <= kMaxAhead);
  for (const GuidedPoint& point : m.points) {
    Expect(IsFinite(point.deviation_right_m) == (point.validity != Validity::kInvalid));
    Expect((point.validity == Validity::kValid) == point.reason.empty());
  }
}
void ExpectSound(const AlarmStatus& m) {
  Expect(m.clear_below <= m.raise_above && m.since.ns != 0);
  Expect(m.phase == AlarmPhase::kNormal || m.raised_at != kNever);
}
void ExpectSound(const Command& m) { Expect(!m.verb.empty() && m.expires_at >= m.issued_at); }
void ExpectSound(const CommandReply& m) { Expect(!m.request_id.empty() && m.published_at.ns > 0); }
void ExpectSound(const TrolleyState& m) {
  const bool is_there = m.status != RailPointStatus::kNone;
  Expect(is_there == m.reason.empty() && m.position_world_m.allFinite() == is_there);
  if (is_there) Expect(std::abs(m.world_from_imu.norm() - 1.0) < 1e-5 && m.distance_m >= 0.0);
}
void ExpectSound(const RailLinePiece& m) {
  Expect(m.piece >= 1 && m.piece <= m.pieces && m.points.size() > 0);
  for (const RailLinePoint& point : m.points) {
    Expect(point.status != RailPointStatus::kNone && point.sigma_world_m.minCoeff() >= 0.0);
  }
}
void ExpectSound(const SettlementPiece& m) {
  Expect(m.piece >= 1 && m.piece <= m.pieces && m.points.size() > 0);
  for (const SettlementPoint& point : m.points) {
    Expect(point.alert <= m.highest_alert && (!point.is_significant || IsFinite(point.dz_m)));
  }
}
void ExpectSound(const CalibrationStatus& m) {
  Expect((m.state == CalibrationState::kValid) == m.reason.empty());
  Expect(IsFinite(m.age_days) == (m.calibrated_at != kNever));
}

template <class Message>
void Receive(const char* payload, std::size_t size) {
  using Wire = typename WireOf<Message>::Type;
  static WireSample<Wire> sample;  // one for all, as a reader has it
  if (!Decode(payload, size, sample)) return;
  if (Check(sample.value) != BoundaryFault::kNone) return;
  Message message;
  FromWire(sample.value, message);
  ExpectSound(message);
  Wire again;
  ToWire(message, again);
  Expect(Check(again) == BoundaryFault::kNone);
  Message same;
  FromWire(again, same);
  // NaN is not itself, so bytes are compared.
  std::vector<std::byte> bytes;
  std::vector<std::byte> same_bytes;
  Expect(EncodeCdr(message, &bytes) == BoundaryFault::kNone);
  Expect(EncodeCdr(same, &same_bytes) == BoundaryFault::kNone);
  Expect(bytes == same_bytes);
}

template <class Message>
std::size_t Send(const Message& message, std::uint8_t* to, std::size_t max_size) {
  WireType<Message> type;
  WireSample<typename WireOf<Message>::Type> sample;
  ToWire(message, sample.value);
  eprosima::fastrtps::rtps::SerializedPayload_t payload(type.m_typeSize);
  Expect(type.serialize(&sample, &payload));
  const std::size_t size = std::min<std::size_t>(payload.length, max_size);
  std::memcpy(to, payload.data, size);
  return size;
}

RelativePose NoPose() {
  RelativePose pose = test::FullRelativePose();
  pose.status = PoseStatus::kNone;
  pose.reason = PoseReason::kTooFewLeds;
  return pose;
}
TiltReading NoTilt() {
  TiltReading tilt = test::FullTiltReading();
  tilt.validity = Validity::kInvalid;
  return tilt;
}

const auto kReceivers = std::make_tuple(&Receive<FrameFeatures>,
                                        &Receive<TiltReading>,
                                        &Receive<RelativePose>,
                                        &Receive<DeviceHealth>,
                                        &Receive<Event>,
                                        &Receive<StationObservation>,
                                        &Receive<StationSetUp>,
                                        &Receive<ShieldPose>,
                                        &Receive<Guidance>,
                                        &Receive<AlarmStatus>,
                                        &Receive<Command>,
                                        &Receive<CommandReply>,
                                        &Receive<TrolleyState>,
                                        &Receive<RailLinePiece>,
                                        &Receive<SettlementPiece>,
                                        &Receive<CalibrationStatus>);
constexpr unsigned kTopicCount = std::tuple_size_v<decltype(kReceivers)>;

// A whole sample from which the search goes on.
std::size_t Seed(unsigned which, std::uint8_t* data, std::size_t max_size) {
  const auto sample = [&](std::uint8_t topic, const auto& message) {
    data[0] = topic;
    return 1 + Send(message, data + 1, max_size - 1);
  };
  switch (which % 18) {
    case 0:
      return sample(0, test::FullFrameFeatures());
    case 1:
      return sample(1, test::FullTiltReading());
    case 2:
      return sample(2, test::FullRelativePose());
    case 3:
      return sample(3, test::FullDeviceHealth());
    case 4:
      return sample(4, test::FullEvent());
    case 5:
      return sample(1, NoTilt());
    case 6:
      return sample(5, test::FullStationObservation());
    case 7:
      return sample(6, test::FullStationSetUp());
    case 8:
      return sample(7, test::FullShieldPose());
    case 9:
      return sample(8, test::FullGuidance());
    case 10:
      return sample(9, test::FullAlarmStatus());
    case 11:
      return sample(10, test::FullCommand());
    case 12:
      return sample(11, test::FullCommandReply());
    case 13:
      return sample(12, test::FullTrolleyState());
    case 14:
      return sample(13, test::FullRailLinePiece());
    case 15:
      return sample(14, test::FullSettlementPiece());
    case 16:
      return sample(15, test::FullCalibrationStatus());
    default:
      return sample(2, NoPose());
  }
}

}  // namespace
}  // namespace tbm::dds

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tbm::dds;
  if (size == 0) return 0;
  // Exactly as much memory as was received, so that the sanitizer sees one byte more.
  const std::string payload(reinterpret_cast<const char*>(data + 1), size - 1);
  const unsigned topic = data[0] % kTopicCount;
  std::apply(
      [&](const auto... receivers) {
        unsigned i = 0;
        ((i++ == topic ? receivers(payload.data(), payload.size()) : void()), ...);
      },
      kReceivers);
  return 0;
}

// Without it the search would begin with inputs too short for a whole sample.
extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  static std::string any_length = "-len_control=0";
  static std::vector<char*> arguments(*argv, *argv + *argc);
  arguments.push_back(any_length.data());
  *argc = static_cast<int>(arguments.size());
  arguments.push_back(nullptr);
  *argv = arguments.data();
  return 0;
}

// Whole samples of every topic stand in for a folder of seeds, which would age with the IDL files.
// Besides what the library changes: a number becomes one that a careless reader takes for a number.
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data,
                                               std::size_t size,
                                               std::size_t max_size,
                                               unsigned seed) {
  constexpr std::size_t kBegin = 5;  // behind the topic and RTPS' four bytes: CDR aligns from here
  constexpr std::array kNumbers = {std::numeric_limits<double>::infinity(),
                                   -std::numeric_limits<double>::infinity(),
                                   std::numeric_limits<double>::quiet_NaN(),
                                   -1.0,
                                   0.0,
                                   1e300};
  std::minstd_rand random(seed + 1);
  if (max_size > 1 && (size < 2 || random() % 16 == 0)) {
    size = tbm::dds::Seed(static_cast<unsigned>(random()), data, max_size);
  }
  if (size >= kBegin + sizeof(double) && random() % 2 == 0) {
    const std::size_t slots = (size - kBegin) / sizeof(double);
    const double number = kNumbers[random() % kNumbers.size()];
    std::memcpy(data + kBegin + sizeof(double) * (random() % slots), &number, sizeof(double));
    return size;
  }
  return LLVMFuzzerMutate(data, size, max_size);
}
