#pragma once

#include <array>
#include <string_view>

#include "idl/cpp/guidance_messages.h"
#include "idl/cpp/messages.h"
#include "idl/cpp/qos.h"
#include "idl/cpp/rail_messages.h"

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
inline constexpr TopicRow kStationObservationTopic{
    "tbm/v1/station_observation", "tbm::v1::StationObservation", QosClass::kRecord};
inline constexpr TopicRow kStationSetUpTopic{
    "tbm/v1/station_set_up", "tbm::v1::StationSetUp", QosClass::kHealth};
inline constexpr TopicRow kShieldPoseTopic{
    "tbm/v1/shield_pose", "tbm::v1::ShieldPose", QosClass::kMeasurement};
inline constexpr TopicRow kGuidanceTopic{
    "tbm/v1/guidance", "tbm::v1::Guidance", QosClass::kMeasurement};
inline constexpr TopicRow kAlarmStatusTopic{
    "tbm/v1/alarm", "tbm::v1::AlarmStatus", QosClass::kHealth};
inline constexpr TopicRow kCommandTopic{"tbm/v1/command", "tbm::v1::Command", QosClass::kRequest};
inline constexpr TopicRow kCommandReplyTopic{
    "tbm/v1/command_reply", "tbm::v1::CommandReply", QosClass::kRequest};
inline constexpr TopicRow kTrolleyStateTopic{
    "tbm/v1/trolley_state", "tbm::v1::TrolleyState", QosClass::kMeasurement};
inline constexpr TopicRow kRailLineTopic{
    "tbm/v1/rail_line", "tbm::v1::RailLinePiece", QosClass::kResult};
inline constexpr TopicRow kSettlementTopic{
    "tbm/v1/settlement", "tbm::v1::SettlementPiece", QosClass::kResult};
inline constexpr TopicRow kCalibrationStatusTopic{
    "tbm/v1/calibration_status", "tbm::v1::CalibrationStatus", QosClass::kHealth};

inline constexpr std::array kTopics{kFrameFeaturesTopic,
                                    kInclinationTopic,
                                    kRelativePoseTopic,
                                    kDeviceHealthTopic,
                                    kEventTopic,
                                    kStationObservationTopic,
                                    kStationSetUpTopic,
                                    kShieldPoseTopic,
                                    kGuidanceTopic,
                                    kAlarmStatusTopic,
                                    kCommandTopic,
                                    kCommandReplyTopic,
                                    kTrolleyStateTopic,
                                    kRailLineTopic,
                                    kSettlementTopic,
                                    kCalibrationStatusTopic};

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
template <>
constexpr TopicRow TopicOf<StationObservation>() {
  return kStationObservationTopic;
}
template <>
constexpr TopicRow TopicOf<StationSetUp>() {
  return kStationSetUpTopic;
}
template <>
constexpr TopicRow TopicOf<ShieldPose>() {
  return kShieldPoseTopic;
}
template <>
constexpr TopicRow TopicOf<Guidance>() {
  return kGuidanceTopic;
}
template <>
constexpr TopicRow TopicOf<AlarmStatus>() {
  return kAlarmStatusTopic;
}
template <>
constexpr TopicRow TopicOf<Command>() {
  return kCommandTopic;
}
template <>
constexpr TopicRow TopicOf<CommandReply>() {
  return kCommandReplyTopic;
}
template <>
constexpr TopicRow TopicOf<TrolleyState>() {
  return kTrolleyStateTopic;
}
template <>
constexpr TopicRow TopicOf<RailLinePiece>() {
  return kRailLineTopic;
}
template <>
constexpr TopicRow TopicOf<SettlementPiece>() {
  return kSettlementTopic;
}
template <>
constexpr TopicRow TopicOf<CalibrationStatus>() {
  return kCalibrationStatusTopic;
}

}  // namespace tbm::dds
