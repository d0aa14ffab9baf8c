#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <string_view>
#include <vector>

#include "devices/bus/byte_link.h"
#include "devices/bus/pty_server.h"
#include "devices/imu/stim_encoder.h"
#include "pose/base/clock.h"

namespace tbm {

// What an emulated unit can be told to do wrong with its next datagrams.
enum class StimFaultKind {
  kDrop,        // not sent; the counter goes on
  kFlippedBit,  // one bit of it, another one each time
  kCut,         // second half missing
  kNoise,       // bytes of interference before it
  kFrozen,      // the values of the one before; the counter goes on
  kSaturated,   // gyro x at the end of its converter, with the overload bit
  kStartUp,     // with the start-up bit in every cluster
  kFaulty,      // with the bit for a fault of a channel
};

// "drop" and so on; what the simulator's command line accepts.
std::optional<StimFaultKind> StimFaultFromWord(std::string_view word);

// Filled by a test or a simulator's console, emptied by the emulator's thread.
class StimFaultQueue {
 public:
  void Add(StimFaultKind kind, int datagrams = 1);
  // A fault for every datagram from now on, after the queued ones; empty for none.
  void SetLasting(std::optional<StimFaultKind> kind);
  std::optional<StimFaultKind> Take();

 private:
  std::mutex mutex_;
  std::deque<StimFaultKind> queue_;
  std::optional<StimFaultKind> lasting_;
};

std::vector<std::uint8_t> SpoilStim(std::vector<std::uint8_t> bytes,
                                    StimFaultKind kind,
                                    std::size_t turn);

// Rate and specific force at an instant, in the unit's axes. May be called from any thread.
using StimTruth = std::function<StimReading(Timestamp)>;

struct StimEmulatorSettings {
  StimFamily family = StimFamily::kStim300;
  std::uint8_t id = 0xA5;
  StimScales scales;
  double counter_hz = 2000.0;
  double clock_error_ppm = 0.0;  // + samples more slowly than it should
  bool has_terminator = false;
  Duration latency = std::chrono::microseconds(300);  // told where the datagram has a place for it
  Duration start_up{0};  // after power on every status has the start-up bit; the real ones 10 s
};

// A Sensonor unit on a pseudo-terminal: sends from power on, at its own pace, whether anybody
// listens or not. It samples at even instants; what comes late is the thread's own jitter.
class StimEmulator final : private PtyInstrument {
 public:
  // `line.path` becomes a symbolic link to the terminal; its rate is the pace of the bytes.
  StimEmulator(SerialSettings line,
               StimEmulatorSettings settings,
               StimTruth truth,
               const Clock& clock);

  bool IsUp() const { return server_.IsUp(); }
  void Unplug() { server_.Unplug(); }
  // The unit has lost power too: its counter begins at 0, and it starts up again.
  void Replug() { server_.Replug(); }
  StimFaultQueue& faults() { return faults_; }
  std::uint64_t sampled() const { return sampled_; }

 private:
  void OnPlug() override { power_on_.reset(); }
  void OnBytes(std::span<const std::uint8_t>, SteadyTime, PtyOutbox&) override {}
  std::optional<SteadyTime> OnTurn(SteadyTime now, PtyOutbox& outbox) override;
  SteadyTime SampleInstant() const;
  StimDatagram Sense(Timestamp at, bool is_starting_up) const;
  void Send(SteadyTime sensed, SteadyTime now, PtyOutbox& outbox);

  const SerialSettings line_;
  const StimEmulatorSettings settings_;
  const StimTruth truth_;
  const Clock& clock_;
  StimFaultQueue faults_;
  std::atomic<std::uint64_t> sampled_ = 0;
  std::optional<SteadyTime> power_on_;
  std::uint64_t sample_ = 0;  // since power on
  StimDatagram last_;
  PtyServer server_;  // last: its thread uses all of the above
};

}  // namespace tbm
