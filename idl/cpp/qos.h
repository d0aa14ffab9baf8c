#pragma once

#include <chrono>

namespace tbm::dds {

// The kinds of topic that there are. A topic names its class in topics.h and nothing else about
// QoS.
enum class QosClass {
  kMeasurement,  // a stream that is worth what its newest sample is worth
  kHealth,       // a standing state with a heartbeat
  kEvents,       // things that must not be missed
  kRecord,       // single readings: each counts, and none is worth anything later
  kRequest,      // the same for what anybody may ask, and the answers
  kResult,       // what a finished piece of work has come to
};

// What a class means. The same for writer and reader, so they always match.
//
// Common to all, with the reason:
//   RELIABLE            a lost pose is a gap in the record; over UDP with KEEP_LAST a slow or
//   frozen
//                       reader blocks neither the writer nor another reader (tested)
//   KEEP_LAST           old samples make room for new ones, so nobody waits
//   SHARED ownership    two writers of one key are a fault to be shown, not to be hidden: samples
//   of
//                       both arrive, marked `contested`, and an alarm is raised
//   no LIFESPAN         machines without a common clock would throw away good samples
//   liveliness default  AUTOMATIC does not notice a killed writer; the reader's DEADLINE does
//   XCDR1, no TypeObject, no data sharing: what all vendors understand and what never crashed a
//   peer
struct QosRule {
  bool transient_local;                // a late reader gets the last samples of each key
  int depth;                           // samples kept per key
  int max_keys;                        // keys one reader or writer has room for
  std::chrono::milliseconds deadline;  // offered by writers and asked for by readers; 0: none
  bool one_writer = true;              // for each key; a second one is a fault
};

constexpr QosRule RuleOf(QosClass qos_class) {
  switch (qos_class) {
    // Volatile: a pose of a minute ago must never look like one of now. Five deep: a reader that is
    // busy for four periods loses nothing. 500 ms: two and a half periods of the slowest camera
    // (5 Hz), and still shorter than a foreman's reaction.
    case QosClass::kMeasurement:
      return {false, 5, 16, std::chrono::milliseconds(500)};
    // A console that starts later sees at once how each device is. One per key: only the present
    // state matters. 3 s: three heartbeats.
    case QosClass::kHealth:
      return {true, 1, 64, std::chrono::milliseconds(3000)};
    // A console that starts later sees the last eight of each kind. No deadline: no news is normal.
    case QosClass::kEvents:
      return {true, 8, 256, std::chrono::milliseconds(0)};
    // Volatile: a command or a reading of an hour ago must not come to a process that starts now.
    // 32 deep: two rounds of readings over prisms and references. No deadline: they come when they
    // come; that the instrument lives is said by its health.
    case QosClass::kRecord:
      return {false, 32, 16, std::chrono::milliseconds(0)};
    case QosClass::kRequest:
      return {false, 32, 16, std::chrono::milliseconds(0), false};
    // A reader that starts later sees the last result whole: each of its pieces is a key. No
    // deadline: one is enough, and the next may be a month away.
    case QosClass::kResult:
      return {true, 1, 256, std::chrono::milliseconds(0)};
  }
  return {};
}

}  // namespace tbm::dds
