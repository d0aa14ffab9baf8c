#pragma once

#include <cstdint>

namespace tbm {

// Turns the block id of GigE Vision into a number that only grows. The id has 16 bits and skips 0
// (..., 65534, 65535, 1, 2, ...); ids above 65535 are taken as the 64-bit ids of newer cameras.
//
// Steps of up to half the circle count forward, larger ones backward: at 10 frames/s that is a hole
// of 54 minutes, long after the watchdog has opened the camera anew.
class FrameIdCounter {
 public:
  struct Step {
    std::uint64_t frame_number = 0;
    std::uint64_t lost = 0;  // ids that should have come between the last one and this
    bool is_late = false;    // repeats or precedes one that was already counted
  };

  Step Count(std::uint64_t id);

  // The camera was opened anew: its ids start anywhere, so nothing is known about the gap. The
  // frame number goes on by one.
  void Restart() { has_last_ = false; }

 private:
  bool has_last_ = false;
  std::uint64_t last_id_ = 0;
  std::uint64_t number_ = 0;
};

}  // namespace tbm
