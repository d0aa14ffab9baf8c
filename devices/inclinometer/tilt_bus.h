#pragma once

#include <memory>
#include <mutex>

#include "devices/bus/sleeper.h"
#include "devices/inclinometer/tilt_wire.h"
#include "pose/base/clock.h"

namespace tbm {

// When a wire may be used: one question at a time, silence after every error, reconnecting.
//
// Serial instruments number neither questions nor answers. A reply that comes after its time-out
// would be taken as the answer to the next question, and then every answer is one question old. So
// after any error nothing is asked for quiet_time, which is longer than the slowest reply; what
// came in meanwhile is thrown away.
class TiltBus {
 public:
  using SteadyTime = std::chrono::steady_clock::time_point;

  struct Timing {
    std::chrono::nanoseconds quiet_time;
    std::chrono::nanoseconds reconnect_period;
    std::chrono::nanoseconds reopen_after;  // 0 never
  };

  TiltBus(std::unique_ptr<TiltWire> wire, Timing timing, const Clock& clock, Sleeper& sleeper)
      : wire_(std::move(wire)), timing_(timing), clock_(clock), sleeper_(sleeper) {}

  struct Turn {
    Result<WireReading, InclinometerFailure> result = Failure{InclinometerFailure::kNotDue};
    bool was_asked = false;
    std::size_t stale_bytes = 0;
    int openings = 0;      // how often the port has been opened so far
    SteadyTime sent{};     // just before the question
    SteadyTime done{};     // just after the answer
    Timestamp done_utc{};  // the same instant
  };

  // Asks as soon as the wire may be used, not before `earliest`. When that is after the deadline it
  // waits until the deadline and says kNotDue. Any thread.
  Turn Ask(const InclinometerConfig& instrument, SteadyTime earliest, SteadyTime deadline);

 private:
  void CloseWhenDead(SteadyTime now);
  Turn AskNow(const InclinometerConfig& instrument);
  SteadyTime FreeAt() const;

  std::unique_ptr<TiltWire> wire_;
  const Timing timing_;
  const Clock& clock_;
  Sleeper& sleeper_;

  mutable std::mutex mutex_;
  SteadyTime free_at_{};
  SteadyTime alive_at_{};  // last good answer of any instrument, or the opening
  int openings_ = 0;
};

}  // namespace tbm
