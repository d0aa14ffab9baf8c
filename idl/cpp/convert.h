#pragma once

#include "tbm_idl/device_health.h"
#include "tbm_idl/event.h"
#include "tbm_idl/frame_features.h"
#include "tbm_idl/inclination.h"
#include "tbm_idl/relative_pose.h"

#include "idl/cpp/boundary.h"
#include "idl/cpp/messages.h"

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

// Every rule of the contract that a compiler cannot see. Asked before a sample goes out and before
// one is let in, so a writer learns of its mistake first.
BoundaryFault Check(const v1::FrameFeatures& wire);
BoundaryFault Check(const v1::Inclination& wire);
BoundaryFault Check(const v1::RelativePose& wire);
BoundaryFault Check(const v1::DeviceHealth& wire);
BoundaryFault Check(const v1::Event& wire);

// Back again. Only for samples that passed Check.
void FromWire(const v1::FrameFeatures& wire, FrameFeatures& message);
void FromWire(const v1::Inclination& wire, TiltReading& message);
void FromWire(const v1::RelativePose& wire, RelativePose& message);
void FromWire(const v1::DeviceHealth& wire, DeviceHealth& message);
void FromWire(const v1::Event& wire, Event& message);

}  // namespace tbm::dds
