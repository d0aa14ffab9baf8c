#pragma once

#include <chrono>
#include <cstdint>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>

#include "pose/base/face.h"
#include "pose/base/result.h"
#include "pose/base/time.h"

namespace tbm {

// Why a call gave nothing. Append only: the codes go out as device health and events.
enum class StationFailure {
  kNotConnected = 1,      // no connection now; Connect opens it
  kUnreachable = 2,       // no such address or port: cable, power, radio
  kRefused = 3,           // the port may not be opened, is in use, or refuses its settings
  kLinkLost = 4,          // the connection was there and broke
  kTimeout = 5,           // nothing came in time; nothing is known about what the instrument did
  kGarbled = 6,           // an answer came, but damaged, or without the values it must have
  kAsleep = 7,            // the instrument sleeps or is switched off
  kBusy = 8,              // another call or a measurement is under way
  kNotSupported = 9,      // this model or firmware does not know the call
  kNoLicence = 10,        // robotic functions are not licensed on this instrument
  kBadParameter = 11,     // the instrument refuses a value
  kLowPower = 12,         // battery too low for the call
  kTilted = 13,           // the bracket leans more than the compensator can take up
  kNoTarget = 14,         // no prism in the field of view or the window
  kSeveralTargets = 15,   // more than one prism in the field of view
  kBadEnvironment = 16,   // dust, vibration, a light source: target recognition does not settle
  kInaccurate = 17,       // positioning or target recognition missed its tolerance
  kNoLock = 18,           // the prism is not locked, or target recognition is off
  kMotor = 19,            // a drive does not do what it should
  kAngleSensor = 20,      // a circle cannot be read
  kDistance = 21,         // the distance meter failed: signal, beam broken, setting
  kAborted = 22,          // RequestAbort, or a key on the instrument
  kNotExecuted = 23,      // it stands still and is not where it was told to go: may be told again
  kOutcomeUnknown = 24,   // it stands still; whether it has found its target nobody knows
  kImplausible = 25,      // a sound answer with a value that cannot be
  kInstrument = 26,       // any other failure that the instrument reports; see the return code
  kSettingNotTaken = 27,  // a setting reads back as another value
};

// "no_target" and so on, as it stands in health and logs; and a sentence that says what to do.
std::string_view FailureCode(StationFailure failure);
std::string_view FailureSentence(StationFailure failure);

struct StationFault {
  StationFailure why = StationFailure::kNotConnected;
  // The instrument's own code that led to it; 0 when there is none.
  int return_code = 0;

  bool operator==(const StationFault&) const = default;
};

// A call that has nothing to say but that it was carried out.
struct Done {};

// A direction as the circles count it: clockwise from the zero of the horizontal circle, and down
// from the zenith; beyond pi in face two. [rad]
struct CircleReading {
  double horizontal_rad = 0.0;
  double zenith_rad = 0.0;
};
inline Face FaceOf(const CircleReading& reading) {
  return reading.zenith_rad > std::numbers::pi ? Face::kTwo : Face::kOne;
}

enum class ObservationQuality {
  kFull,
  kNotFullyCorrected,  // 1283, 1288: tilt or another error is not corrected for, see the switches
  kNoAccuracy,         // 1284, 1289: the instrument does not vouch for its specified accuracy
};

// One pointing: what the instrument measured, not corrected for anything that the instrument has
// not corrected for. Circle errors that remain, refraction and earth curvature are in it.
struct PolarObservation {
  // Middle of the time in which it was measured, and half its length: from the command to the
  // answer. Default distance measurement takes a good second.
  Timestamp sensed_at;
  Duration sensed_within{0};

  CircleReading circles;  // as read, in the face it was read
  Face face = Face::kOne;
  // Between the tilting axis and the prism, with prism constant and ppm already applied.
  // Absent when only angles were measured.
  std::optional<double> slope_m;
  ObservationQuality quality = ObservationQuality::kFull;
  int return_code = 0;

  // What the instrument has added to the distance and by how much it has scaled it. Absent when the
  // model does not tell.
  std::optional<double> prism_constant_m;
  std::optional<double> ppm;
  // How the standing axis leans along and across the line of sight; already taken out of the
  // circles when the compensator is on. Absent when the model does not tell.
  std::optional<double> tilt_length_rad;
  std::optional<double> tilt_cross_rad;
  // Standard deviation of the angles by the instrument's own account.
  std::optional<double> angle_sigma_rad;
};

struct CompensatorReading {
  Timestamp sensed_at;
  double length_rad = 0.0;  // along the line of sight
  double cross_rad = 0.0;   // across it
  ObservationQuality quality = ObservationQuality::kFull;
};

struct StationIdentity {
  std::string model;
  std::int64_t serial_number = 0;
  std::string firmware;  // "5.60.1"

  bool operator==(const StationIdentity&) const = default;
};

struct StationPower {
  int capacity_percent = 0;
  bool is_external = false;
};

// What a motion aims at.
enum class Aim {
  kDirection,  // the given circle readings, whatever is there
  kPrism,      // the prism next to them, found by target recognition
};

// Full width of a search window around where the telescope points now.
struct SearchWindow {
  double horizontal_rad = 0.0;
  double zenith_rad = 0.0;
};

enum class LockState {
  kNone,
  kLocked,
  kPredicting,  // the prism is gone from view; the telescope follows where it should be
};

// The life of the connection, drawn in devices/README.md.
enum class StationState {
  kClosed,   // no connection; Connect tries again after a back-off
  kOpening,  // connected, the instrument has not answered yet
  kReady,    // the last call was answered
  kSilent,   // the last call was not answered; after three in a row the connection is closed
};
std::string_view StateCode(StationState state);

// Counted since the driver was made.
struct StationCounters {
  std::uint64_t calls = 0;
  std::uint64_t answered = 0;
  std::uint64_t timeouts = 0;
  std::uint64_t garbled = 0;     // damaged answers, and answers without their values
  std::uint64_t stale = 0;       // late answers to earlier calls, thrown away
  std::uint64_t noise = 0;       // lines that are no answer at all
  std::uint64_t reconnects = 0;  // openings after the first that succeeded
};

struct StationHealth {
  StationState state = StationState::kClosed;
  std::optional<StationFault> last_fault;  // empty while the last call succeeded
  std::optional<StationIdentity> identity;
  std::optional<StationPower> power;  // as last read
  bool has_checksum = false;          // lines carry one, so a flipped bit cannot pass
  std::optional<Timestamp> last_answer_at;
  StationCounters counters;
};

// A motorised total station as the one thread of its process uses it. Every call waits for the
// instrument and ends within its own time limit. Concrete ones come from MakeTotalStation, in an
// app only.
//
// A motion or a measurement is told once. When its answer does not come, the driver asks for the
// instrument's state until it stands still and reports what is then known: kNotExecuted and
// kOutcomeUnknown both say that a new command is safe.
class TotalStation {
 public:
  using SteadyTime = std::chrono::steady_clock::time_point;

  virtual ~TotalStation() = default;

  // Opens the connection unless it is open, wakes the instrument and restores the settings made so
  // far. Waits out the back-off after a failure, so a loop around it does not spin; returns at
  // `until`, or later by at most one opening. Compare the identity with the one before: another
  // instrument has another orientation.
  virtual Result<StationIdentity, StationFault> Connect(SteadyTime until) = 0;
  virtual void Close() = 0;
  virtual bool IsConnected() const = 0;

  virtual Result<StationPower, StationFault> ReadPower() = 0;
  virtual Result<double, StationFault> ReadTemperatureCelsius() = 0;

  // What the instrument adds to each distance. Read back; kSettingNotTaken when it differs.
  virtual Result<Done, StationFault> SetPrismConstant(double constant_m) = 0;
  // By how much it scales each distance for pressure, temperature and humidity.
  virtual Result<Done, StationFault> SetAtmosphere(double ppm) = 0;

  virtual Result<Done, StationFault> TurnTo(const CircleReading& target, Aim aim) = 0;
  virtual Result<Done, StationFault> ChangeFace(Aim aim) = 0;
  // Looks for a prism in the window and points at it.
  virtual Result<Done, StationFault> Search(const SearchWindow& window) = 0;
  // Points exactly at a prism that is nearly aimed at.
  virtual Result<Done, StationFault> FineAdjust(const SearchWindow& window) = 0;

  virtual Result<Done, StationFault> LockIn() = 0;
  virtual Result<Done, StationFault> ReleaseLock() = 0;
  virtual Result<LockState, StationFault> ReadLock() = 0;

  // Angles and distance where the telescope points. An observation without slope_m is a good one of
  // its angles: the beam is broken or meets no prism.
  virtual Result<PolarObservation, StationFault> Measure() = 0;
  // At once, without a distance.
  virtual Result<PolarObservation, StationFault> MeasureAngles() = 0;
  virtual Result<CompensatorReading, StationFault> ReadCompensator() = 0;

  // Stops the motion under way, if there is one; its call returns kAborted. From any thread.
  virtual void RequestAbort() = 0;
  // From any thread.
  virtual StationHealth Health() const = 0;
};

}  // namespace tbm
