#pragma once

#include <cstdint>
#include <memory>

#include "idl/cpp/boundary.h"
#include "idl/cpp/guidance_messages.h"
#include "idl/cpp/messages.h"
#include "idl/cpp/participant.h"

namespace tbm::dds {

enum class WriteOutcome {
  kWritten,    // handed to the sockets; how many readers there are is another question
  kNoNetwork,  // the participant waits for an address; health and events go out when it has one
  kRefused,    // breaks the contract: see refused_because
  kFailed,     // DDS would not take it: more keys than the class has room for
};

struct PublisherCounters {
  std::uint64_t written = 0;
  std::uint64_t without_network = 0;
  std::uint64_t refused = 0;
  std::uint64_t failed = 0;
  BoundaryFault refused_because = BoundaryFault::kNone;  // the last one
};

// Writes one topic. Message is a struct of messages.h or guidance_messages.h; topic and QoS follow
// from it. One thread at a time writes; the others wait.
//
// Write keeps no reference and does not wait for readers. Our own part takes no heap after the
// first sample. Fast DDS 2.9.1 makes and drops up to ten closures of 32 bytes in each call,
// whatever the sample (measured in tests/idl/publisher_heap_test.cc): a thread that must not touch
// the heap hands its messages to another one.
template <class Message>
class Publisher {
 public:
  explicit Publisher(Participant& participant);
  ~Publisher();
  Publisher(const Publisher&) = delete;
  Publisher& operator=(const Publisher&) = delete;

  WriteOutcome Write(const Message& message);

  int matched_readers() const;
  PublisherCounters counters() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tbm::dds
