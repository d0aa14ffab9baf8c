#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <string_view>
#include <vector>

namespace tbm {

// What an emulated total station can be told to do wrong with a call.
enum class GeocomFaultKind {
  kLate,           // the reply comes `delay` later; the instrument is free meanwhile
  kLostReply,      // carried out, no reply
  kLostRequest,    // not carried out, no reply
  kMissingValues,  // return code 0 and none of the values
  kGarbageBefore,  // noise in front of the reply, in its line
  kBitError,       // one bit of the reply flipped
  kLostFirst,      // the reply without its first character
  kSplit,          // the reply in two halves, `delay` between them
  kGlued,          // the reply of the call before once more, in the same line
  kTwice,          // the reply two times
  kCloses,         // the connection is closed instead of a reply; carried out. On a pty: no reply
  kReturnCode,     // not carried out: `code` is returned. Warnings are carried out and returned
  kComCode,        // refused by the transport with `code`
  kWrongPrism,     // carried out; recognition goes to the second nearest prism
};

// "late" and so on; what the simulator's command line accepts.
std::optional<GeocomFaultKind> GeocomFaultFromWord(std::string_view word);

struct GeocomFault {
  GeocomFaultKind kind = GeocomFaultKind::kLate;
  int rpc = -1;  // only calls of this number; any when negative
  int skip = 0;  // so many calls that fit go by first
  std::chrono::nanoseconds delay{0};
  int code = 0;
};

// Faults waiting for a call. Filled by a test or a simulator's console, emptied by the emulator's
// thread.
class GeocomFaultQueue {
 public:
  void Add(const GeocomFault& fault, int calls = 1);
  void Clear();
  // After the queue: this fault with this probability for every call that it fits, by draws of the
  // seed. Several may last; the first that strikes counts.
  void AddLasting(const GeocomFault& fault, double ratio = 1.0, unsigned seed = 1);

  std::optional<GeocomFault> Take(int rpc);
  int taken() const;

 private:
  struct Lasting {
    GeocomFault fault;
    double ratio;
    std::uint64_t seed;
    std::uint64_t draws;
  };
  mutable std::mutex mutex_;
  std::deque<GeocomFault> queue_;
  std::vector<Lasting> lasting_;
  int taken_ = 0;
};

}  // namespace tbm
