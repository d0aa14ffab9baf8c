#pragma once

#include <functional>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "idl/cpp/alarm.h"
#include "idl/cpp/messages.h"
#include "idl/cpp/participant.h"
#include "pose/rig/dds_network.h"

// What every process that speaks DDS does alike.
namespace tbm::dds {

ParticipantConfig ParticipantOf(const DdsNetwork& network, const std::string& name);

// One line on standard error; what the DDS library has to say, and an event.
void LogDds(LogLevel level, std::string_view category, std::string_view text);
void LogEvent(const Event& event);

// Alarms of the DDS side go to whoever reports them as soon as that is made; until then they wait.
// Outlives the participant whose handler it gives.
class AlarmRelay {
 public:
  using Receiver = std::function<void(const Alarm&)>;

  AlarmHandler Handler();
  // An empty one ends it: the receiver before is not called after the return.
  void SendTo(Receiver receiver);

 private:
  std::mutex mutex_;  // guards all below
  Receiver receiver_;
  std::vector<Alarm> waiting_;
};

}  // namespace tbm::dds
