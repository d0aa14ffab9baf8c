#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "pose/app/box_messages.h"

namespace tbm {

// Takes the frame path's messages at once and hands them to another sink in a thread of its own: a
// DDS write allocates ten small closures and may meet a lock, and neither belongs into the frame
// path. Bounded: the oldest message gives way and is counted. All memory is taken when it is made.
//
// Tilts, health and events go straight through: they come from threads that may wait.
class QueuedSink final : public MessageSink {
 public:
  explicit QueuedSink(MessageSink& sink);
  ~QueuedSink() override;  // what is queued still goes out
  QueuedSink(const QueuedSink&) = delete;
  QueuedSink& operator=(const QueuedSink&) = delete;

  void Publish(const dds::FrameFeatures& message) override;
  void Publish(const dds::RelativePose& message) override;
  void Publish(const dds::TiltReading& message) override { sink_.Publish(message); }
  void Publish(const dds::DeviceHealth& message) override { sink_.Publish(message); }
  void Publish(const dds::Event& message) override { sink_.Publish(message); }

  std::uint64_t dropped() const;

 private:
  static constexpr std::size_t kCapacity = 8;

  // A ring of messages; with mutex_ held.
  template <class Message>
  struct Ring {
    std::vector<Message> slots = std::vector<Message>(kCapacity);
    std::size_t first = 0;
    std::size_t count = 0;

    bool Push(const Message& message) {
      const bool is_full = count == kCapacity;
      if (is_full) {
        first = (first + 1) % kCapacity;
        --count;
      }
      slots[(first + count) % kCapacity] = message;
      ++count;
      return !is_full;
    }
    bool Pop(Message* message) {
      if (count == 0) return false;
      *message = slots[first];
      first = (first + 1) % kCapacity;
      --count;
      return true;
    }
  };

  void Run();

  MessageSink& sink_;
  mutable std::mutex mutex_;
  std::condition_variable news_;
  Ring<dds::RelativePose> poses_;
  Ring<dds::FrameFeatures> features_;
  std::uint64_t dropped_ = 0;
  bool is_ending_ = false;
  std::thread thread_;
};

}  // namespace tbm
