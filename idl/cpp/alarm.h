#pragma once

#include <functional>
#include <string>
#include <string_view>

namespace tbm::dds {

// What the DDS side of a process finds wrong. Each cause is told with active = true and, when it is
// gone, once more with active = false. A process may be in several troubles of one kind: the kind
// is over when nothing of it stands.
enum class AlarmKind {
  kNoNetwork,          // none of the configured interfaces has an address
  kStartFailed,        // DDS refused to start or to make a reader or writer; tried again
  kInterfaceMismatch,  // a process with other IDL files is on the domain; its samples are refused
  kIncompatibleQos,    // a reader or writer of one of our topics asks for what is not offered;
                       // DDS does not tell when it has left: stands until the network is lost
  kSilent,             // a key has not been heard within its deadline, or a writer sends nothing
  kRejected,           // a sample did not pass the boundary; at most one alarm a second and topic;
                       // over when none was refused for a minute
  kSecondWriter,       // two writers are alive for one key
};

struct Alarm {
  AlarmKind kind = AlarmKind::kStartFailed;
  bool active = true;
  std::string topic;    // empty when it concerns the whole process
  std::string subject;  // of the topic: its key; else a process. Empty when it is just one
  std::string text;     // a sentence for the log or the foreman
  // Whether this kind stands, for this or another cause. Filled in by the participant.
  bool kind_stands = true;

  // Whoever keeps one state for each kind passes over the end of one cause of several.
  bool ChangesKind() const { return active || !kind_stands; }
};

// The code as it stands in events and logs: "interface_mismatch".
constexpr std::string_view AlarmCode(AlarmKind kind) {
  switch (kind) {
    case AlarmKind::kNoNetwork:
      return "no_network";
    case AlarmKind::kStartFailed:
      return "dds_start_failed";
    case AlarmKind::kInterfaceMismatch:
      return "interface_mismatch";
    case AlarmKind::kIncompatibleQos:
      return "incompatible_qos";
    case AlarmKind::kSilent:
      return "silent";
    case AlarmKind::kRejected:
      return "sample_rejected";
    case AlarmKind::kSecondWriter:
      return "second_writer";
  }
  return "";
}

// Called from DDS threads and from the participant's own, one call at a time: brief, and without
// making or destroying participants, publishers or subscribers.
using AlarmHandler = std::function<void(const Alarm&)>;

enum class LogLevel { kError, kWarning };

// What the DDS library itself has to say. Same rules as AlarmHandler.
using LogHandler = std::function<void(LogLevel, std::string_view category, std::string_view text)>;

}  // namespace tbm::dds
