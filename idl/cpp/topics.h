#pragma once

#include <array>
#include <string_view>

#include "idl/cpp/messages.h"
#include "idl/cpp/qos.h"

namespace tbm::dds {

// One topic of the public contract. The name carries the contract's major version.
struct TopicRow {
  std::string_view name;
  std::string_view type;  // as DDS knows it; C++ and C names of the generated code follow from it
  QosClass qos;
};

inline constexpr TopicRow kFrameFeaturesTopic{
    "tbm/v1/frame_features", "tbm::v1::FrameFeatures", QosClass::kMeasurement};
inline constexpr TopicRow kInclinationTopic{
    "tbm/v1/inclination", "tbm::v1::Inclination", QosClass::kMeasurement};
inline constexpr TopicRow kRelativePoseTopic{
    "tbm/v1/relative_pose", "tbm::v1::RelativePose", QosClass::kMeasurement};
inline constexpr TopicRow kDeviceHealthTopic{
    "tbm/v1/device_health", "tbm::v1::DeviceHealth", QosClass::kHealth};
inline constexpr TopicRow kEventTopic{"tbm/v1/event", "tbm::v1::Event", QosClass::kEvents};

inline constexpr std::array kTopics{
    kFrameFeaturesTopic, kInclinationTopic, kRelativePoseTopic, kDeviceHealthTopic, kEventTopic};

// The topic that carries a message type.
template <class Message>
constexpr TopicRow TopicOf() = delete;
template <>
constexpr TopicRow TopicOf<FrameFeatures>() {
  return kFrameFeaturesTopic;
}
template <>
constexpr TopicRow TopicOf<TiltReading>() {
  return kInclinationTopic;
}
template <>
constexpr TopicRow TopicOf<RelativePose>() {
  return kRelativePoseTopic;
}
template <>
constexpr TopicRow TopicOf<DeviceHealth>() {
  return kDeviceHealthTopic;
}
template <>
constexpr TopicRow TopicOf<Event>() {
  return kEventTopic;
}

}  // namespace tbm::dds
