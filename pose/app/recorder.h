#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>

#include "devices/replay/run_writer.h"
#include "pose/app/frame_mailbox.h"
#include "pose/base/fixed_vector.h"

namespace tbm {

// The recorder's thread: takes readings and frames in the solver's order and writes them with a
// RunWriter. The solver never waits for the disk. When the queue is full, a frame is not recorded;
// it is counted, and the next run begins after the gap with the solver's state written down, so
// that every run replays bit for bit.
class Recorder {
 public:
  explicit Recorder(const RecorderOptions& options);
  ~Recorder();  // writes what is queued and closes the run
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  // All calls from the solver's thread.
  //
  // True when a run should begin now. The caller then calls Begin with the solver's state, and adds
  // the readings that the solver still remembers.
  bool WantsNewRun() const { return wants_new_run_; }
  void Begin(Timestamp now, std::string solver_state);
  void Add(const TiltReading& reading);
  void Add(const OwnedFrame& frame, PoseReason image_fault);

  struct Status {
    RecorderStatus writer;
    std::uint64_t frames_dropped = 0;  // the queue was full: the disk is too slow
  };
  Status status() const;  // any thread

 private:
  enum class Kind { kBegin, kTilt, kFrame };
  struct Item {
    Kind kind = Kind::kTilt;
    TiltReading reading;
    Timestamp at;
    PoseReason image_fault = PoseReason::kNone;
    std::size_t buffer = 0;
  };
  static constexpr std::size_t kBuffers = 4;
  static constexpr std::size_t kQueue = 1024;
  // After a run that could not begin. Each attempt costs the solver its monitor's window.
  static constexpr std::chrono::seconds kTryAgain{60};

  void Push(const Item& item);
  void Run();
  void Write(const Item& item);
  void Gap();

  RunWriter writer_;                                // the thread's
  std::chrono::steady_clock::time_point next_try_;  // the thread's
  std::array<OwnedFrame, kBuffers> buffers_;
  std::atomic<bool> wants_new_run_{true};
  bool is_in_gap_ = true;  // solver's: nothing is queued until the next Begin

  mutable std::mutex mutex_;  // guards all below
  std::condition_variable news_;
  FixedVector<Item, kQueue> queue_;
  FixedVector<std::size_t, kBuffers> free_buffers_;
  std::string begin_state_;
  RecorderStatus status_;
  std::uint64_t frames_dropped_ = 0;
  bool is_ending_ = false;

  std::thread thread_;
};

}  // namespace tbm
