#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <string_view>
#include <vector>

#include "devices/bus/byte_link.h"
#include "devices/bus/pty_server.h"

namespace tbm {

// What an emulated inclinometer can be told to do wrong with its next replies.
enum class EmulatorFaultKind {
  kDrop,        // no reply
  kWrongCheck,  // last byte wrong
  kTruncated,   // second half missing
  kNoise,       // bytes of interference before the reply
  kOtherId,     // a sound reply under another address
  kLate,        // a sound reply, `delay` later
  kFrozen,      // the angles of the reply before
  kOutOfRange,  // the largest angles the format can say
};

// "drop" and so on; what the simulator's command line accepts.
std::optional<EmulatorFaultKind> EmulatorFaultFromWord(std::string_view word);

struct EmulatorFault {
  EmulatorFaultKind kind = EmulatorFaultKind::kDrop;
  std::chrono::nanoseconds delay{0};  // kLate only
};

// Faults waiting for a reply to spoil. Filled by a test or a simulator's console, emptied by the
// emulator's thread.
class FaultQueue {
 public:
  void Add(EmulatorFault fault, int replies = 1);
  void Clear();
  // A fault for every reply from now on, after the queued ones; empty for none.
  void SetLasting(std::optional<EmulatorFault> fault);

  std::optional<EmulatorFault> Take();
  int taken() const;

 private:
  mutable std::mutex mutex_;
  std::deque<EmulatorFault> queue_;
  std::optional<EmulatorFault> lasting_;
  int taken_ = 0;
};

// What the fault does to the bytes of a sound reply. Empty: nothing is sent.
std::vector<std::uint8_t> SpoilBytes(std::vector<std::uint8_t> reply, const EmulatorFault& fault);

// Says `reply`, spoiled where there is a fault, from `begin` on over a line of this speed.
void SayReply(std::vector<std::uint8_t> reply,
              const std::optional<EmulatorFault>& fault,
              PtyOutbox::SteadyTime begin,
              const SerialSettings& line,
              PtyOutbox& outbox);

}  // namespace tbm
