#pragma once

#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <cstring>
#include <mutex>
#include <vector>

#include "devices/camera/camera.h"
#include "pose/base/check.h"

namespace tbm {

// A frame in memory of its own.
struct OwnedFrame {
  std::vector<std::uint8_t> pixels;
  Frame frame;  // its image points into `pixels`

  // No allocation once the buffer has seen a frame of this size.
  void CopyFrom(const Frame& source) {
    frame = source;
    if (source.image.pixels == nullptr) return;
    const auto row_bytes =
        static_cast<std::size_t>(source.image.width_px * source.image.bytes_per_pixel);
    const auto rows = static_cast<std::size_t>(source.image.height_px);
    pixels.resize(row_bytes * rows);
    const auto* from = static_cast<const std::uint8_t*>(source.image.pixels);
    for (std::size_t row = 0; row < rows; ++row) {
      std::memcpy(pixels.data() + row * row_bytes,
                  from + static_cast<std::ptrdiff_t>(row) * source.image.stride_bytes,
                  row_bytes);
    }
    frame.image.pixels = pixels.data();
    frame.image.stride_bytes = static_cast<std::ptrdiff_t>(row_bytes);
  }
};

// Hands frames from the grabber to the solver. Three buffers: one being filled, one waiting, one
// being solved. The newest wins: a frame that still waits when the next one comes is dropped and
// counted.
class FrameMailbox {
 public:
  // Grabber: copies `frame` in.
  void Put(const Frame& frame) {
    buffers_[filling_].CopyFrom(frame);
    const std::lock_guard lock(mutex_);
    if (has_waiting_) ++dropped_;
    std::swap(filling_, waiting_);
    has_waiting_ = true;
    news_.notify_one();
  }

  // Solver: the newest frame, valid until the next call. nullptr at the timeout.
  const OwnedFrame* Take(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    news_.wait_for(lock, timeout, [this] { return has_waiting_; });
    if (!has_waiting_) return nullptr;
    std::swap(waiting_, solving_);
    has_waiting_ = false;
    return &buffers_[solving_];
  }

  std::uint64_t dropped() const {
    const std::lock_guard lock(mutex_);
    return dropped_;
  }

 private:
  mutable std::mutex mutex_;
  std::condition_variable news_;
  std::array<OwnedFrame, 3> buffers_;
  std::size_t filling_ = 0;  // grabber's
  std::size_t waiting_ = 1;
  std::size_t solving_ = 2;  // solver's
  bool has_waiting_ = false;
  std::uint64_t dropped_ = 0;
};

}  // namespace tbm
