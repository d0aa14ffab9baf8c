#include "idl/cpp/participant.h"

#include <algorithm>
#include <chrono>
#include <sstream>
#include <utility>

#include "tbm_idl/interface_hash.h"
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "idl/cpp/fastdds_setup.h"
#include "idl/cpp/network_addresses.h"
#include "idl/cpp/participant_core.h"
#include "pose/base/check.h"

namespace tbm::dds {
namespace {

constexpr std::chrono::milliseconds kWatchPeriod{250};
constexpr std::string_view kIdPrefix = "tbm-interface=";
constexpr std::string_view kInterfaceUserData = TBM_INTERFACE_USER_DATA;

// What a process says about its IDL files; empty when it says nothing (another vendor, a foreign
// tool).
std::string_view InterfaceIn(std::string_view user_data) {
  if (user_data.substr(0, kIdPrefix.size()) != kIdPrefix) return {};
  return user_data.substr(kIdPrefix.size());
}

// Two processes may have one name.
std::string ProcessText(const rtps::GuidPrefix_t& process) {
  std::ostringstream text;
  text << process;
  return text.str();
}

}  // namespace

std::string_view InterfaceId() { return kInterfaceUserData; }

std::vector<std::string> Problems(const ParticipantConfig& config) {
  std::vector<std::string> problems;
  if (config.domain_id < 0 || config.domain_id > 232) {
    problems.push_back(fmt::format("dds.domain_id: {} is not in 0 .. 232", config.domain_id));
  }
  if (config.name.empty())
    problems.push_back("dds.name: is empty; a word like camera_box is needed");
  if (config.interfaces.empty()) {
    problems.push_back(
        "dds.interfaces: is empty; addresses or names of network interfaces are needed, "
        "[127.0.0.1] for this machine alone");
  }
  for (const std::string& name : config.interfaces) {
    if (name.empty()) problems.push_back("dds.interfaces: an entry is empty");
  }
  for (const std::string& peer : config.peers) {
    if (!IsIpv4(peer)) {
      problems.push_back(
          fmt::format("dds.peers: \"{}\" is not an IPv4 address like 192.168.1.10", peer));
    }
  }
  if (config.socket_buffer_bytes < 65536 || config.socket_buffer_bytes > (64 << 20)) {
    problems.push_back(fmt::format("dds.socket_buffer_bytes: {} is not in 65536 .. 67108864",
                                   config.socket_buffer_bytes));
  }
  return problems;
}

// What is told is told in the order in which it became so: it is found and put in line under one
// lock. The handler is called without that lock, because it may wait for somebody who waits for
// DDS; who comes meanwhile leaves its news to the thread that tells. Nothing is told to whoever is
// about to go.
template <class NewsOf>
void ParticipantCore::Tell(const NewsOf& news_of) {
  std::unique_lock lock(alarm_mutex_);
  for (Alarm& news : news_of(causes_)) untold_.push_back(std::move(news));
  if (is_telling_) return;
  is_telling_ = true;
  while (!untold_.empty()) {
    const Alarm alarm = untold_.front();
    untold_.pop_front();
    lock.unlock();
    if (on_alarm_ && !is_silent_) on_alarm_(alarm);
    lock.lock();
  }
  is_telling_ = false;
}

ParticipantCore::ParticipantCore(const ParticipantConfig& config, AlarmHandler on_alarm)
    : config_(config), on_alarm_(std::move(on_alarm)) {
  TBM_CHECK(Problems(config).empty());
  PrepareProcess();
  {
    const std::lock_guard lock(mutex_);
    FollowAddresses();
  }
  watcher_ = std::thread([this] { Watch(); });
}

ParticipantCore::~ParticipantCore() {
  {
    const std::lock_guard lock(mutex_);
    TBM_CHECK(endpoints_.empty());
    is_ending_ = true;
  }
  ending_.notify_all();
  watcher_.join();
  is_silent_ = true;
  Stop();
}

void ParticipantCore::Watch() {
  std::unique_lock lock(mutex_);
  while (!ending_.wait_for(lock, kWatchPeriod, [this] { return is_ending_; })) {
    FollowAddresses();
    for (Endpoint* endpoint : endpoints_) endpoint->Poll();
    lock.unlock();
    Tell([](AlarmCauses& causes) { return causes.Expire(std::chrono::steady_clock::now()); });
    lock.lock();
  }
}

void ParticipantCore::FollowAddresses() {
  const std::vector<std::string> addresses = AddressesOf(config_.interfaces);
  const bool runs = entities_.participant != nullptr;
  if (runs && addresses == addresses_) return;
  if (runs) Stop();
  if (addresses.empty()) {
    if (!is_waiting_) {
      Raise({AlarmKind::kNoNetwork,
             true,
             "",
             "",
             fmt::format("none of the interfaces [{}] has an IPv4 address; waiting",
                         fmt::join(config_.interfaces, ", "))});
    }
    is_waiting_ = true;
    return;
  }
  if (!Start(addresses)) {
    Stop();
    if (!has_failed_) {
      Raise({AlarmKind::kStartFailed,
             true,
             "",
             "",
             fmt::format("DDS does not start on {} in domain {}; trying again",
                         fmt::join(addresses, ", "),
                         config_.domain_id)});
    }
    has_failed_ = true;
    return;
  }
  const std::string now_on = fmt::format("DDS runs on {}", fmt::join(addresses, ", "));
  if (is_waiting_) Raise({AlarmKind::kNoNetwork, false, "", "", now_on});
  if (has_failed_) Raise({AlarmKind::kStartFailed, false, "", "", now_on});
  is_waiting_ = false;
  has_failed_ = false;
}

bool ParticipantCore::Start(const std::vector<std::string>& addresses) {
  auto* factory = fdds::DomainParticipantFactory::get_instance();
  entities_.participant =
      factory->create_participant(static_cast<fdds::DomainId_t>(config_.domain_id),
                                  ParticipantQosFor(config_, addresses),
                                  this,
                                  fdds::StatusMask::none());
  if (entities_.participant == nullptr) return false;
  entities_.publisher = entities_.participant->create_publisher(fdds::PublisherQos{});
  entities_.subscriber = entities_.participant->create_subscriber(fdds::SubscriberQos{});
  if (entities_.publisher == nullptr || entities_.subscriber == nullptr) return false;
  addresses_ = addresses;
  ++starts_;
  for (Endpoint* endpoint : endpoints_) endpoint->Open(entities_);
  return true;
}

void ParticipantCore::Stop() {
  if (entities_.participant == nullptr) return;
  for (Endpoint* endpoint : endpoints_) endpoint->Close();
  entities_.participant->delete_contained_entities();
  fdds::DomainParticipantFactory::get_instance()->delete_participant(entities_.participant);
  entities_ = {};
  {
    const std::lock_guard lock(foreign_mutex_);
    foreign_.clear();
  }
  Tell([](AlarmCauses& causes) { return causes.EndOfNetwork(); });
}

void ParticipantCore::Attach(Endpoint& endpoint) {
  const std::lock_guard lock(mutex_);
  endpoints_.push_back(&endpoint);
  if (entities_.participant != nullptr) endpoint.Open(entities_);
}

void ParticipantCore::Detach(Endpoint& endpoint) {
  const std::lock_guard lock(mutex_);
  endpoint.Close();
  endpoints_.erase(std::remove(endpoints_.begin(), endpoints_.end(), &endpoint), endpoints_.end());
}

void ParticipantCore::Raise(Alarm alarm) {
  Tell([&](AlarmCauses& causes) {
    std::vector<Alarm> news;
    auto told = causes.Told(std::move(alarm), std::chrono::steady_clock::now());
    if (told) news.push_back(std::move(*told));
    return news;
  });
}

bool ParticipantCore::IsForeign(const rtps::GuidPrefix_t& process) const {
  const std::lock_guard lock(foreign_mutex_);
  return foreign_.count(process) > 0;
}

bool ParticipantCore::IsRunning() const {
  const std::lock_guard lock(mutex_);
  return entities_.participant != nullptr;
}

int ParticipantCore::starts() const {
  const std::lock_guard lock(mutex_);
  return starts_;
}

void ParticipantCore::on_participant_discovery(fdds::DomainParticipant*,
                                               rtps::ParticipantDiscoveryInfo&& info) {
  const rtps::GuidPrefix_t process = info.info.m_guid.guidPrefix;
  const std::string name = info.info.m_participantName.c_str();
  if (info.status == rtps::ParticipantDiscoveryInfo::REMOVED_PARTICIPANT ||
      info.status == rtps::ParticipantDiscoveryInfo::DROPPED_PARTICIPANT) {
    bool was_foreign = false;
    {
      const std::lock_guard lock(foreign_mutex_);
      was_foreign = foreign_.erase(process) > 0;
    }
    if (was_foreign) {
      Raise({AlarmKind::kInterfaceMismatch,
             false,
             "",
             ProcessText(process),
             fmt::format("\"{}\" has left", name)});
    }
    return;
  }
  const auto& bytes = info.info.m_userData.data_vec();
  const std::string user_data(bytes.begin(), bytes.end());
  const std::string_view theirs = InterfaceIn(user_data);
  if (theirs.empty() || theirs == InterfaceIn(InterfaceId())) return;
  bool is_new = false;
  {
    const std::lock_guard lock(foreign_mutex_);
    is_new = foreign_.insert(process).second;
  }
  if (!is_new) return;
  Raise(
      {AlarmKind::kInterfaceMismatch,
       true,
       "",
       ProcessText(process),
       fmt::format("\"{}\" was built from other IDL files ({}) than this process ({}); its samples "
                   "are refused: bring both to the same version",
                   name,
                   theirs,
                   InterfaceIn(InterfaceId()))});
}

fdds::Topic* TopicIn(fdds::DomainParticipant& participant,
                     std::string_view name,
                     const fdds::TypeSupport& type) {
  const std::string topic_name(name);
  if (auto* known = participant.lookup_topicdescription(topic_name)) {
    return static_cast<fdds::Topic*>(known);
  }
  if (participant.find_type(type.get_type_name()).empty() &&
      participant.register_type(type) != eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
    return nullptr;
  }
  return participant.create_topic(topic_name, type.get_type_name(), fdds::TopicQos{});
}

Participant::Participant(const ParticipantConfig& config,
                         AlarmHandler on_alarm,
                         LogHandler on_log) {
  if (on_log) SetLogHandler(std::move(on_log));
  core_ = std::make_unique<ParticipantCore>(config, std::move(on_alarm));
}
Participant::~Participant() = default;
bool Participant::IsRunning() const { return core_->IsRunning(); }
int Participant::starts() const { return core_->starts(); }

}  // namespace tbm::dds
