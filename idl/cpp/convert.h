#pragma once

#include "tbm_idl/alarm.h"
#include "tbm_idl/calibration_status.h"
#include "tbm_idl/command.h"
#include "tbm_idl/device_health.h"
#include "tbm_idl/event.h"
#include "tbm_idl/frame_features.h"
#include "tbm_idl/guidance.h"
#include "tbm_idl/inclination.h"
#include "tbm_idl/rail_line.h"
#include "tbm_idl/relative_pose.h"
#include "tbm_idl/settlement.h"
#include "tbm_idl/station_observation.h"
#include "tbm_idl/station_set_up.h"

#include "idl/cpp/boundary.h"
#include "idl/cpp/guidance_messages.h"
#include "idl/cpp/messages.h"
#include "idl/cpp/rail_messages.h"

// The one translation between the words of the house (tbm::dds) and the generated types (tbm::v1).
// Names in snake_case functions are generated ones. Only idl/cpp and its tests include this header.
namespace tbm::dds {

// What a message becomes on the wire. Reuses the memory of `wire`: no heap once its sequences have
// had their capacity.
void ToWire(const FrameFeatures& message, v1::FrameFeatures& wire);
void ToWire(const TiltReading& message, v1::Inclination& wire);
void ToWire(const RelativePose& message, v1::RelativePose& wire);
void ToWire(const DeviceHealth& message, v1::DeviceHealth& wire);
void ToWire(const Event& message, v1::Event& wire);
void ToWire(const StationObservation& message, v1::StationObservation& wire);
void ToWire(const StationSetUp& message, v1::StationSetUp& wire);
void ToWire(const ShieldPose& message, v1::ShieldPose& wire);
void ToWire(const Guidance& message, v1::Guidance& wire);
void ToWire(const AlarmStatus& message, v1::AlarmStatus& wire);
void ToWire(const Command& message, v1::Command& wire);
void ToWire(const CommandReply& message, v1::CommandReply& wire);
void ToWire(const TrolleyState& message, v1::TrolleyState& wire);
void ToWire(const RailLinePiece& message, v1::RailLinePiece& wire);
void ToWire(const SettlementPiece& message, v1::SettlementPiece& wire);
void ToWire(const CalibrationStatus& message, v1::CalibrationStatus& wire);

// Every rule of the contract that a compiler cannot see. Asked before a sample goes out and before
// one is let in, so a writer learns of its mistake first.
BoundaryFault Check(const v1::FrameFeatures& wire);
BoundaryFault Check(const v1::Inclination& wire);
BoundaryFault Check(const v1::RelativePose& wire);
BoundaryFault Check(const v1::DeviceHealth& wire);
BoundaryFault Check(const v1::Event& wire);
BoundaryFault Check(const v1::StationObservation& wire);
BoundaryFault Check(const v1::StationSetUp& wire);
BoundaryFault Check(const v1::ShieldPose& wire);
BoundaryFault Check(const v1::Guidance& wire);
BoundaryFault Check(const v1::AlarmStatus& wire);
BoundaryFault Check(const v1::Command& wire);
BoundaryFault Check(const v1::CommandReply& wire);
BoundaryFault Check(const v1::TrolleyState& wire);
BoundaryFault Check(const v1::RailLinePiece& wire);
BoundaryFault Check(const v1::SettlementPiece& wire);
BoundaryFault Check(const v1::CalibrationStatus& wire);

// Back again. Only for samples that passed Check.
void FromWire(const v1::FrameFeatures& wire, FrameFeatures& message);
void FromWire(const v1::Inclination& wire, TiltReading& message);
void FromWire(const v1::RelativePose& wire, RelativePose& message);
void FromWire(const v1::DeviceHealth& wire, DeviceHealth& message);
void FromWire(const v1::Event& wire, Event& message);
void FromWire(const v1::StationObservation& wire, StationObservation& message);
void FromWire(const v1::StationSetUp& wire, StationSetUp& message);
void FromWire(const v1::ShieldPose& wire, ShieldPose& message);
void FromWire(const v1::Guidance& wire, Guidance& message);
void FromWire(const v1::AlarmStatus& wire, AlarmStatus& message);
void FromWire(const v1::Command& wire, Command& message);
void FromWire(const v1::CommandReply& wire, CommandReply& message);
void FromWire(const v1::TrolleyState& wire, TrolleyState& message);
void FromWire(const v1::RailLinePiece& wire, RailLinePiece& message);
void FromWire(const v1::SettlementPiece& wire, SettlementPiece& message);
void FromWire(const v1::CalibrationStatus& wire, CalibrationStatus& message);

}  // namespace tbm::dds
