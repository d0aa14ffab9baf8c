#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>

namespace tbm {

// Puts the camera's own time stamps on this computer's steady clock, which nobody sets.
//
// A camera counts ticks since it was powered: an origin that nobody knows, and a crystal that is
// off by up to 100 ppm. A packet arrives at the true instant plus a delay that is never negative
// and usually small, so the smallest difference (arrival - stamp) of the last kWindow frames is the
// offset between the clocks plus the smallest delay, and the camera's stamp plus that offset is
// free of the network's jitter. The price is the drift within the window: 6.4 s at 10 frames/s and
// 100 ppm give 0.64 ms at worst.
//
// A difference that jumps by more than kStep means that the camera started anew or its clock was
// set. Down is believed at once (a delay cannot be negative), up after kStepFrames in a row (it
// might be congestion).
class CameraClock {
 public:
  static constexpr std::size_t kWindow = 64;
  static constexpr int kStepFrames = 5;
  static constexpr std::int64_t kStepNs = 50'000'000;

  // `stamp_ns`: what the camera wrote, in ns of its clock. `received_at`: arrival of the frame's
  // first packet. Returns the stamped instant plus the smallest delay, never later than
  // received_at.
  using SteadyTime = std::chrono::steady_clock::time_point;
  SteadyTime ToHost(std::int64_t stamp_ns, SteadyTime received_at);

  void Restart();

 private:
  void Keep(std::int64_t difference_ns);
  std::int64_t Smallest() const;

  std::array<std::int64_t, kWindow> differences_ns_{};
  std::size_t count_ = 0;
  std::size_t next_ = 0;
  std::int64_t smallest_of_high_ns_ = 0;
  int high_in_a_row_ = 0;
};

}  // namespace tbm
