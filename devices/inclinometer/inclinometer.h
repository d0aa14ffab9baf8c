#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string_view>

#include "pose/base/result.h"
#include "pose/base/time.h"
#include "pose/geometry/tilt.h"

namespace tbm {

struct TiltSample {
  // When the plate was sensed, as well as a serial line lets one know: the middle between the last
  // bit of the request and the first bit of the reply, less the instrument's configured latency.
  Timestamp sensed_at;
  // In the instrument's own sign convention; the rig file's `sign` has not been applied.
  Inclination raw;
  std::optional<double> temperature_celsius;
};

// Why a read gave no sample. Append only: the codes go out as device health.
enum class InclinometerFailure {
  kNotDue = 1,           // nothing is wrong: the next reading is due after the deadline
  kPortMissing = 2,      // no such device file: the adapter is unplugged
  kPortRefused = 3,      // the port may not be opened, is in use, or refuses its settings
  kHungUp = 4,           // the port was open and is gone
  kNoReply = 5,          // nothing came in time: cable, supply, address or baud rate
  kGarbled = 6,          // checksum, length or digits are wrong: interference, or two talk at once
  kOtherInstrument = 7,  // a reply from an address that was not asked
  kException = 8,        // the instrument understood and refused: register map or function is wrong
  kNotFinite = 9,        // NaN or infinite: a dead channel
  kOutOfRange = 10,      // beyond the range this instrument can have
  kStep = 11,            // moved further than a shield can; believed when the next reading agrees
  kFrozen = 12,          // not one digit has changed for longer than is plausible
  kEnded = 13,           // a recording is over
};

// "no_reply" and so on, as it stands in health and logs.
std::string_view FailureCode(InclinometerFailure failure);

// The life of every device, drawn in devices/README.md.
enum class InclinometerState {
  kClosed,     // no port; tried again every reconnect period
  kOpening,    // the port is open, no good reading yet
  kStreaming,  // good readings come
  kSilent,     // the port is open, no good reading for silent_after
};

std::string_view StateCode(InclinometerState state);

// Counted since the driver was made.
struct InclinometerCounters {
  std::uint64_t requests = 0;  // asked, or frames looked at in automatic output
  std::uint64_t good = 0;
  std::uint64_t no_reply = 0;
  std::uint64_t garbled = 0;      // also replies of other addresses and refusals
  std::uint64_t implausible = 0;  // not finite, out of range, step, frozen
  std::uint64_t stale = 0;        // times that bytes which nobody waited for were thrown away
  std::uint64_t reconnects = 0;   // the port came back
};

struct InclinometerHealth {
  InclinometerState state = InclinometerState::kClosed;
  std::optional<InclinometerFailure> last_failure;  // empty while the last reading was good
  std::optional<Timestamp> last_sensed_at;
  InclinometerCounters counters;
};

// One two-axis inclinometer. Concrete ones come from MakeInclinometers, in an app only.
class Inclinometer {
 public:
  virtual ~Inclinometer() = default;

  // Waits for the next reading and returns it, or why there is none. One thread calls it, in a loop
  // and without waiting of its own: a read that fails at once makes the next one wait, so the loop
  // never spins, also not with the cable pulled. Opening and reopening the port happen in here.
  // Returns at the deadline, or later by at most one response timeout (plus that of another
  // instrument on the same wire) when a request was under way.
  virtual Result<TiltSample, InclinometerFailure> Read(
      std::chrono::steady_clock::time_point deadline) = 0;

  // May be called from any thread.
  virtual InclinometerHealth Health() const = 0;
};

}  // namespace tbm
