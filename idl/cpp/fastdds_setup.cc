#include "idl/cpp/fastdds_setup.h"

#include <cstdlib>
#include <memory>
#include <mutex>

#include <fastdds/dds/log/Log.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
#include <fastrtps/xmlparser/XMLProfileManager.h>

namespace tbm::dds {
namespace {

namespace fdds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

std::mutex log_mutex;
LogHandler log_handler;

class LogForwarder final : public fdds::LogConsumer {
 public:
  void Consume(const fdds::Log::Entry& entry) override {
    LogHandler handler;
    {
      const std::lock_guard lock(log_mutex);
      handler = log_handler;
    }
    if (!handler) return;
    const auto level = entry.kind == fdds::Log::Kind::Error ? LogLevel::kError : LogLevel::kWarning;
    handler(level, entry.context.category != nullptr ? entry.context.category : "", entry.message);
  }
};

constexpr std::chrono::milliseconds kHeartbeat{200};  // a lost sample is asked for again after this

eprosima::fastrtps::Duration_t DdsDuration(std::chrono::milliseconds span) {
  return {static_cast<std::int32_t>(span.count() / 1000),
          static_cast<std::uint32_t>(span.count() % 1000 * 1'000'000)};
}

// What writer and reader of a class share, so that they always match.
template <class Qos>
void SetCommon(const QosRule& rule, Qos& qos) {
  qos.reliability().kind = fdds::RELIABLE_RELIABILITY_QOS;
  qos.durability().kind =
      rule.transient_local ? fdds::TRANSIENT_LOCAL_DURABILITY_QOS : fdds::VOLATILE_DURABILITY_QOS;
  qos.history().kind = fdds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = rule.depth;
  qos.resource_limits().max_instances = rule.max_keys;
  qos.resource_limits().max_samples_per_instance = rule.depth;
  qos.resource_limits().max_samples = rule.depth * rule.max_keys;
  qos.resource_limits().allocated_samples = std::min(rule.depth * rule.max_keys, 64);
  qos.endpoint().history_memory_policy = rtps::PREALLOCATED_MEMORY_MODE;
  qos.data_sharing().off();
}

}  // namespace

void PrepareProcess() {
  static std::once_flag once;
  std::call_once(once, [] {
    // Each of these lets a file or a variable that nobody remembers change how we talk.
    for (const char* variable : {"FASTRTPS_DEFAULT_PROFILES_FILE",
                                 "FASTDDS_ENVIRONMENT_FILE",
                                 "ROS_DISCOVERY_SERVER",
                                 "FASTDDS_STATISTICS"}) {
      unsetenv(variable);
    }
    setenv(
        "SKIP_DEFAULT_XML_FILE", "1", 1);  // DEFAULT_FASTRTPS_PROFILES.xml in the working directory

    eprosima::fastrtps::LibrarySettingsAttributes settings;
    settings.intraprocess_delivery = eprosima::fastrtps::INTRAPROCESS_OFF;
    eprosima::fastrtps::xmlparser::XMLProfileManager::library_settings(settings);

    fdds::Log::ClearConsumers();
    fdds::Log::RegisterConsumer(std::make_unique<LogForwarder>());
    fdds::Log::SetVerbosity(fdds::Log::Kind::Warning);
  });
}

void SetLogHandler(LogHandler on_log) {
  const std::lock_guard lock(log_mutex);
  log_handler = std::move(on_log);
}

fdds::DomainParticipantQos ParticipantQosFor(const ParticipantConfig& config,
                                             const std::vector<std::string>& addresses) {
  fdds::DomainParticipantQos qos;
  qos.name(config.name.c_str());
  const std::string_view id = InterfaceId();
  qos.user_data().data_vec({id.begin(), id.end()});

  const auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList = addresses;
  udp->sendBufferSize = static_cast<std::uint32_t>(config.socket_buffer_bytes);
  udp->receiveBufferSize = static_cast<std::uint32_t>(config.socket_buffer_bytes);
  udp->maxInitialPeersRange = kPeerRange;
  qos.transport().use_builtin_transports = false;  // they would bring shared memory
  qos.transport().user_transports.push_back(udp);

  auto& builtin = qos.wire_protocol().builtin;
  builtin.discovery_config.leaseDuration = {5,
                                            0};  // a process that vanished is forgotten after this
  builtin.discovery_config.leaseDuration_announcementperiod = {1, 0};
  builtin.typelookup_config.use_client = false;
  builtin.typelookup_config.use_server = false;
  if (!config.peers.empty()) {
    // An explicit unicast locator keeps Fast DDS from adding the multicast one.
    rtps::Locator_t any_port;
    builtin.metatrafficUnicastLocatorList.push_back(any_port);
    for (const std::string& peer : config.peers) {
      rtps::Locator_t locator;
      rtps::IPLocator::setIPv4(locator, peer);
      builtin.initialPeersList.push_back(locator);
    }
  }
  return qos;
}

fdds::DataWriterQos WriterQosFor(QosClass qos_class) {
  const QosRule rule = RuleOf(qos_class);
  fdds::DataWriterQos qos;
  SetCommon(rule, qos);
  qos.publish_mode().kind = fdds::SYNCHRONOUS_PUBLISH_MODE;
  qos.reliable_writer_qos().times.heartbeatPeriod = DdsDuration(kHeartbeat);
  if (rule.deadline.count() > 0) qos.deadline().period = DdsDuration(rule.deadline);
  return qos;
}

fdds::DataReaderQos ReaderQosFor(QosClass qos_class, std::chrono::milliseconds silent_after) {
  const QosRule rule = RuleOf(qos_class);
  fdds::DataReaderQos qos;
  SetCommon(rule, qos);
  const auto deadline = silent_after.count() > 0 ? silent_after : rule.deadline;
  if (deadline.count() > 0) qos.deadline().period = DdsDuration(deadline);
  return qos;
}

std::string PolicyName(fdds::QosPolicyId_t policy) {
  switch (policy) {
    case fdds::DURABILITY_QOS_POLICY_ID:
      return "DURABILITY";
    case fdds::DEADLINE_QOS_POLICY_ID:
      return "DEADLINE";
    case fdds::LATENCYBUDGET_QOS_POLICY_ID:
      return "LATENCY_BUDGET";
    case fdds::LIVELINESS_QOS_POLICY_ID:
      return "LIVELINESS";
    case fdds::OWNERSHIP_QOS_POLICY_ID:
      return "OWNERSHIP";
    case fdds::RELIABILITY_QOS_POLICY_ID:
      return "RELIABILITY";
    case fdds::DESTINATIONORDER_QOS_POLICY_ID:
      return "DESTINATION_ORDER";
    case fdds::PRESENTATION_QOS_POLICY_ID:
      return "PRESENTATION";
    case fdds::PARTITION_QOS_POLICY_ID:
      return "PARTITION";
    case fdds::DATAREPRESENTATION_QOS_POLICY_ID:
      return "DATA_REPRESENTATION";
    default:
      return "policy number " + std::to_string(static_cast<int>(policy));
  }
}

}  // namespace tbm::dds
