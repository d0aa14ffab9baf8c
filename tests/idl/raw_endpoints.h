#pragma once

#include <functional>
#include <string>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>

#include "idl/cpp/fastdds_setup.h"
#include "idl/cpp/wire_type.h"

namespace tbm::dds::test {

namespace fdds = eprosima::fastdds::dds;

// A participant that keeps none of the house's rules: for what a stranger or a faulty program might
// send. Loopback only.
class RawParticipant {
 public:
  explicit RawParticipant(int domain_id, const std::string& user_data = "") {
    PrepareProcess();
    ParticipantConfig config;
    config.name = "stranger";
    auto qos = ParticipantQosFor(config, {"127.0.0.1"});
    qos.user_data().data_vec({user_data.begin(), user_data.end()});
    participant_ = fdds::DomainParticipantFactory::get_instance()->create_participant(
        static_cast<fdds::DomainId_t>(domain_id), qos);
  }
  ~RawParticipant() {
    participant_->delete_contained_entities();
    fdds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
  }
  RawParticipant(const RawParticipant&) = delete;
  RawParticipant& operator=(const RawParticipant&) = delete;

  template <class Message>
  fdds::DataWriter* Writer(const std::function<void(fdds::DataWriterQos&)>& change = {}) {
    auto qos = WriterQosFor(TopicOf<Message>().qos);
    if (change) change(qos);
    return participant_->create_publisher(fdds::PublisherQos{})
        ->create_datawriter(Topic<Message>(), qos);
  }
  template <class Message>
  fdds::DataReader* Reader(const std::function<void(fdds::DataReaderQos&)>& change = {}) {
    auto qos = ReaderQosFor(TopicOf<Message>().qos, {});
    if (change) change(qos);
    return participant_->create_subscriber(fdds::SubscriberQos{})
        ->create_datareader(Topic<Message>(), qos);
  }

 private:
  template <class Message>
  fdds::Topic* Topic() {
    fdds::TypeSupport type(new WireType<Message>);
    type.register_type(participant_);
    return participant_->create_topic(
        std::string(TopicOf<Message>().name), type.get_type_name(), fdds::TopicQos{});
  }

  fdds::DomainParticipant* participant_ = nullptr;
};

}  // namespace tbm::dds::test
