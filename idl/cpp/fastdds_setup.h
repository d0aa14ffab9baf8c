#pragma once

#include <string>
#include <vector>

#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>
#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>

#include "idl/cpp/participant.h"
#include "idl/cpp/qos.h"

// Inside of idl/cpp: our rules in Fast DDS' own words.
namespace tbm::dds {

// Once per process, before Fast DDS is touched: no settings from files or environment, every sample
// goes over the wire (also inside one process), the library's log comes to us.
void PrepareProcess();
void SetLogHandler(LogHandler on_log);

eprosima::fastdds::dds::DomainParticipantQos ParticipantQosFor(
    const ParticipantConfig& config, const std::vector<std::string>& addresses);
eprosima::fastdds::dds::DataWriterQos WriterQosFor(QosClass qos_class);
// `silent_after`: the reader's deadline, at least that of the class; 0 takes the class' own.
eprosima::fastdds::dds::DataReaderQos ReaderQosFor(QosClass qos_class,
                                                   std::chrono::milliseconds silent_after);

// "DEADLINE", "RELIABILITY", ...
std::string PolicyName(eprosima::fastdds::dds::QosPolicyId_t policy);

}  // namespace tbm::dds
