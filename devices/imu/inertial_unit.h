#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string_view>

#include <Eigen/Core>

#include "pose/base/result.h"
#include "pose/base/time.h"

namespace tbm {

// Mean rate and mean specific force over the interval that ends at `ends_at`, in the axes of the
// unit (frame `imu`, right-handed, as engraved on its housing). At rest the specific force points
// up and is 9.8 long.
struct InertialSample {
  // By the unit's own counter, put on this computer's clock (counter_clock.h): the distance from
  // one sample to the next is the unit's, free of the port's jitter.
  Timestamp ends_at;
  double interval_s = 0.0;  // > 0, of this sample alone
  // Samples between the last one handed out and this one that were lost or refused. 0 after the
  // clock was set anew, where the stamps tell how long nothing came.
  std::uint32_t missing_before = 0;

  Eigen::Vector3d rate_rad_s = Eigen::Vector3d::Zero();
  // Empty when the unit has gyros only, or is set up to send nothing else.
  std::optional<Eigen::Vector3d> specific_force_m_s2;
  // The same by the unit's inclinometers, where it has them: narrow range, slow, steady bias.
  std::optional<Eigen::Vector3d> tilt_force_m_s2;

  std::optional<double> gyro_temperature_celsius;  // mean of the three axes
  std::optional<double> accel_temperature_celsius;

  // The unit works outside of the conditions that its data sheet is for (temperature, supply): the
  // values are real, their accuracy is not promised.
  bool is_outside_conditions = false;
};

// Why a read gave no sample. Append only: the codes go out as device health.
enum class InertialFailure {
  kNotDue = 1,       // nothing is wrong: the next sample is due after the deadline
  kPortMissing = 2,  // no such device file: the adapter is unplugged
  kPortRefused = 3,  // the port may not be opened, is in use, or refuses its settings
  kHungUp = 4,       // the port was open and is gone
  kNoData = 5,       // nothing comes: cable, supply, or the unit is in its service mode
  kGarbled = 6,      // a wrong checksum; or bytes that are no datagrams: baud rate, model
  kStartingUp = 7,   // the unit says that it is not ready; up to ten seconds after power on
  kSettling = 8,     // good values, but their instants are not known yet
  kWrongRate = 9,    // counter or pace do not fit sample_rate_hz: the unit is set to another rate
  kOverload = 10,    // an axis is beyond its range: jolt, loose mount, or the wrong range
  kFaulty = 11,      // the unit reports a fault of its own: integrity, or a measurement channel
  kFrozen = 12,      // the counter runs and not one digit of any value changes
  kEnded = 13,       // a recording is over
};

// "no_data" and so on, as it stands in health and logs.
std::string_view FailureCode(InertialFailure failure);

// The life of every device, drawn in devices/README.md.
enum class InertialState {
  kClosed,     // no port; tried again every reconnect period
  kOpening,    // datagrams may come, but there is no sample yet (or none for silent_after)
  kStreaming,  // samples come
  kSilent,     // the port is open, no datagram for silent_after
};

std::string_view StateCode(InertialState state);

// Counted since the driver was made.
struct InertialCounters {
  std::uint64_t datagrams = 0;  // whole, with a right checksum
  std::uint64_t good = 0;       // handed out
  std::uint64_t garbled = 0;    // wrong checksums, and reads that brought noise only
  std::uint64_t lost = 0;       // by jumps of the unit's counter
  std::uint64_t skipped_bytes = 0;
  std::uint64_t starting_up = 0;
  std::uint64_t untimed = 0;  // settling or of a wrong rate
  std::uint64_t overloads = 0;
  std::uint64_t faulty = 0;
  std::uint64_t frozen = 0;
  std::uint64_t clock_restarts = 0;
  std::uint64_t reconnects = 0;  // the port came back
};

struct InertialHealth {
  InertialState state = InertialState::kClosed;
  std::optional<InertialFailure> last_failure;  // empty while the last sample was good
  std::optional<Timestamp> last_ends_at;
  InertialCounters counters;
};

// One inertial unit: three gyros, with or without three accelerometers.
class InertialUnit {
 public:
  virtual ~InertialUnit() = default;

  // Waits for the next sample and returns it, or why there is none. None is skipped: a caller that
  // is late gets them one after the other. One thread calls it, in a loop and without waiting of
  // its own: while nothing comes it sleeps until `deadline`, also with the cable pulled. Opening
  // and reopening the port happen in here.
  virtual Result<InertialSample, InertialFailure> Read(
      std::chrono::steady_clock::time_point deadline) = 0;

  // May be called from any thread.
  virtual InertialHealth Health() const = 0;
};

}  // namespace tbm
