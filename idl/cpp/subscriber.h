#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>

#include "idl/cpp/boundary.h"
#include "idl/cpp/guidance_messages.h"
#include "idl/cpp/messages.h"
#include "idl/cpp/participant.h"

namespace tbm::dds {

// What is known about a sample beside its content.
struct SampleFacts {
  std::chrono::steady_clock::time_point received_at;  // ages are judged by this machine's own clock
  std::array<std::uint8_t, 16> writer{};              // GUID of the writer
  // Two writers are alive for this key: take neither of them for granted.
  bool contested = false;
};

struct SubscriberOptions {
  std::size_t queue_capacity = 16;  // for Take; the oldest makes room and is counted
  // How long a key may stay silent. 0: the class' deadline (qos.h). Shorter than that never matches
  // and is refused (checked); for topics without deadline it is what this reader alone watches.
  std::chrono::milliseconds silent_after{0};
};

struct SubscriberCounters {
  std::uint64_t delivered = 0;
  std::uint64_t rejected = 0;              // did not pass the boundary
  std::uint64_t from_other_interface = 0;  // writer was built from other IDL files
  std::uint64_t dropped = 0;               // the queue was full: Take came too late
  std::uint64_t lost = 0;                  // by DDS: the writer had moved on before it came through
  BoundaryFault rejected_because = BoundaryFault::kNone;  // the last one
};

// Reads one topic; topic and QoS follow from Message as with Publisher. What breaks the contract is
// counted and reported by alarm and never delivered.
template <class Message>
class Subscriber {
 public:
  // Called from a DDS thread, one sample at a time, in each writer's order. Brief: while it runs,
  // the process receives nothing.
  using Handler = std::function<void(const Message&, const SampleFacts&)>;

  // Hands every sample to `handler`.
  Subscriber(Participant& participant, Handler handler, const SubscriberOptions& options = {});
  // Keeps samples for Take.
  explicit Subscriber(Participant& participant, const SubscriberOptions& options = {});
  ~Subscriber();
  Subscriber(const Subscriber&) = delete;
  Subscriber& operator=(const Subscriber&) = delete;

  // The oldest sample in the queue; false when none came in time.
  bool Take(Message& message, SampleFacts& facts, std::chrono::milliseconds timeout);

  int matched_writers() const;
  SubscriberCounters counters() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tbm::dds
