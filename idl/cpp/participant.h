#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "idl/cpp/alarm.h"

namespace tbm::dds {

// How a process takes part in DDS. The defaults send nothing to any network but the machine's own
// loopback: the owner says so in the config before it talks to others.
struct ParticipantConfig {
  int domain_id = 25;  // 0 .. 232; a number of our own keeps foreign tools out
  std::string name = "tbm";

  // IPv4 addresses or names of interfaces. A name follows its address when that changes.
  std::vector<std::string> interfaces = {"127.0.0.1"};

  // IPv4 addresses of machines to look for. Empty: found by multicast. Otherwise unicast only: no
  // multicast packet is sent, and each address is asked for up to kPeerRange participants.
  std::vector<std::string> peers;

  // Of each socket; the kernel's net.core.rmem_max and wmem_max cut it.
  int socket_buffer_bytes = 1 << 20;
};

inline constexpr unsigned kPeerRange =
    32;  // participants on one machine that unicast discovery finds

// One sentence per wrong key, with key, value and range. Empty: the config is fine.
std::vector<std::string> Problems(const ParticipantConfig& config);

// What this process tells others about its IDL files: "tbm-interface=v1:" and a digest of their
// texts.
std::string_view InterfaceId();

class ParticipantCore;

// The process' membership of a DDS domain: UDPv4 only, no shared memory, no settings from files or
// environment. Waits until one of its interfaces has an address, and begins anew, publishers and
// subscribers included, when the set of addresses changes. Compares its InterfaceId with that of
// every process it meets.
//
// Outlives its publishers and subscribers (checked). The config must have no Problems (checked).
class Participant {
 public:
  explicit Participant(const ParticipantConfig& config,
                       AlarmHandler on_alarm = {},
                       LogHandler on_log = {});
  ~Participant();
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  // Whether there is an address and DDS runs on it. False is no failure: it is waiting.
  bool IsRunning() const;

  // How often it has begun, for health: 1 after an undisturbed start.
  int starts() const;

  ParticipantCore& core() const { return *core_; }

 private:
  std::unique_ptr<ParticipantCore> core_;
};

}  // namespace tbm::dds
