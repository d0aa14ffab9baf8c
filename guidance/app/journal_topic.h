#pragma once

#include <string>
#include <vector>

#include "guidance/app/journal.h"
#include "idl/cpp/codec.h"
#include "idl/cpp/topics.h"

namespace tbm {

// The channel of a DDS topic: its name, and its IDL text for whoever reads the journal without us.
inline JournalChannel JournalChannelOf(const dds::TopicRow& topic) {
  return {std::string(topic.name),
          "cdr",
          {std::string(topic.type), "omgidl", std::string(dds::IdlTextOf(topic.type))}};
}

// When the sender sent it, as far as the message tells.
template <class Message>
Timestamp SentAt(const Message& message) {
  if constexpr (requires { message.published_at; }) {
    return message.published_at;
  } else if constexpr (requires { message.issued_at; }) {
    return message.issued_at;
  } else {
    return message.at;
  }
}

// One topic's way into a journal. One thread at a time.
template <class Message>
class JournalTopic {
 public:
  explicit JournalTopic(Journal& journal)
      : journal_(journal),
        channel_(journal.AddChannel(JournalChannelOf(dds::TopicOf<Message>()))) {}

  // Encodes it as DDS sends it. False when it breaks the contract, or was dropped.
  bool Add(const Message& message, Timestamp log_time) {
    return dds::EncodeCdr(message, &bytes_) == dds::BoundaryFault::kNone &&
           journal_.Add(channel_, bytes_, log_time, SentAt(message));
  }

  // Size of what was added last.
  std::size_t encoded_bytes() const { return bytes_.size(); }

 private:
  Journal& journal_;
  Journal::Channel channel_;
  std::vector<std::byte> bytes_;
};

}  // namespace tbm
