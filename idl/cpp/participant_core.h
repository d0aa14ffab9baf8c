#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

#include "idl/cpp/alarm_causes.h"
#include "idl/cpp/participant.h"

// Inside of idl/cpp: what participant, publisher and subscriber share. Nobody else includes it.
namespace tbm::dds {

namespace fdds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

// What a publisher or subscriber needs to make its writer or reader.
struct Entities {
  fdds::DomainParticipant* participant = nullptr;
  fdds::Publisher* publisher = nullptr;
  fdds::Subscriber* subscriber = nullptr;
};

// A publisher or subscriber, as the participant sees it. All three are called with the core's lock
// held, one at a time.
class Endpoint {
 public:
  virtual ~Endpoint() = default;
  virtual void Open(const Entities& entities) = 0;
  virtual void Close() = 0;
  virtual void Poll() = 0;  // about four times a second
};

class ParticipantCore final : private fdds::DomainParticipantListener {
 public:
  ParticipantCore(const ParticipantConfig& config, AlarmHandler on_alarm);
  ~ParticipantCore() override;

  void Attach(Endpoint& endpoint);
  void Detach(Endpoint& endpoint);
  void Raise(Alarm alarm);

  // Whether the writer belongs to a process that was built from other IDL files.
  bool IsForeign(const rtps::GuidPrefix_t& process) const;

  bool IsRunning() const;
  int starts() const;

 private:
  void Watch();
  void FollowAddresses();  // with mutex_ held
  bool Start(const std::vector<std::string>& addresses);
  void Stop();
  template <class NewsOf>
  void Tell(const NewsOf& news_of);
  void on_participant_discovery(fdds::DomainParticipant* participant,
                                rtps::ParticipantDiscoveryInfo&& info) override;

  const ParticipantConfig config_;
  const AlarmHandler on_alarm_;

  mutable std::mutex mutex_;  // guards all down to the next mutex
  std::vector<Endpoint*> endpoints_;
  Entities entities_;
  std::vector<std::string> addresses_;  // that the running participant was made for
  bool is_waiting_ = false;
  bool has_failed_ = false;
  int starts_ = 0;
  bool is_ending_ = false;
  std::condition_variable ending_;

  mutable std::mutex foreign_mutex_;  // taken inside DDS callbacks, never while asking for mutex_
  std::set<rtps::GuidPrefix_t> foreign_;

  std::atomic<bool> is_silent_ = false;  // it ends: its handler may be gone
  std::mutex alarm_mutex_;               // guards all below; the handler is called without it
  AlarmCauses causes_;
  std::deque<Alarm> untold_;
  bool is_telling_ = false;

  std::thread watcher_;
};

// The topic of that name and type in this participant, made on first use. Null when DDS refuses.
fdds::Topic* TopicIn(fdds::DomainParticipant& participant,
                     std::string_view name,
                     const fdds::TypeSupport& type);

}  // namespace tbm::dds
