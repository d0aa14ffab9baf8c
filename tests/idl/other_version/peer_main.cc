// A writer of relative poses that was built from another version of relative_pose.idl, under the
// same topic and type name, with the type code as generated.
//
//   idl_other_version_peer DOMAIN with-id|without-id
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <string>
#include <thread>

#include "other_version/interface_hash.h"
#include "other_version/relative_pose.h"
#include "other_version/relative_posePubSubTypes.h"
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

namespace {

namespace fdds = eprosima::fastdds::dds;

volatile std::sig_atomic_t is_ending = 0;

fdds::DomainParticipant* Join(int domain_id, const std::string& user_data) {
  fdds::DomainParticipantQos qos;
  qos.name("other_version");
  qos.user_data().data_vec({user_data.begin(), user_data.end()});
  qos.transport().use_builtin_transports = false;
  const auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList = {"127.0.0.1"};
  qos.transport().user_transports.push_back(udp);
  return fdds::DomainParticipantFactory::get_instance()->create_participant(
      static_cast<fdds::DomainId_t>(domain_id), qos);
}

tbm::v1::RelativePose APose() {
  tbm::v1::RelativePose pose;
  pose.machine_id("machine-9");
  pose.sensed_at_utc_ns(1'700'000'000'000'000'031);
  pose.published_at_utc_ns(1'700'000'000'000'000'032);
  pose.inserted(0.25);
  pose.status(tbm::v1::POSE_STATUS_OK);
  pose.camera_from_target_qw(1.0);
  pose.covariance().fill(0.0);
  pose.leds_used(3);
  pose.leds_used_mask(7);
  pose.excluded_led_index(-1);
  pose.chi2(1.0);
  return pose;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  std::signal(SIGTERM, [](int) { is_ending = 1; });
  const bool has_id = std::string(argv[2]) == "with-id";
  auto* participant = Join(std::atoi(argv[1]), has_id ? TBM_INTERFACE_USER_DATA : "");
  if (participant == nullptr) return 4;
  fdds::TypeSupport type(new tbm::v1::RelativePosePubSubType);
  type.register_type(participant);
  auto* topic =
      participant->create_topic("tbm/v1/relative_pose", type.get_type_name(), fdds::TopicQos{});
  fdds::DataWriterQos qos;
  qos.deadline().period = {0, 500'000'000};
  qos.data_sharing().off();
  auto* writer = participant->create_publisher(fdds::PublisherQos{})->create_datawriter(topic, qos);
  tbm::v1::RelativePose pose = APose();
  for (unsigned long long number = 1; is_ending == 0; ++number) {
    pose.sample_number(number);
    writer->write(&pose);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  participant->delete_contained_entities();
  fdds::DomainParticipantFactory::get_instance()->delete_participant(participant);
  return 0;
}
