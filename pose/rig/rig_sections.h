#pragma once

#include <string_view>
#include <vector>

#include "pose/rig/camera_section.h"
#include "pose/rig/rig.h"
#include "pose/rig/rig_yaml.h"

namespace tbm {

// The sections of a rig file, one by one: a calibration's files hold some of them. What is wrong
// stands in the node's list of faults.

// `camera`: the camera itself, residual_px, intrinsics_sigma_px, gain and noise of the sensor.
void ReadCameraSection(const YamlNode& camera, const KnownKeys& known, Rig* rig);
// `target`, with its list of LEDs.
void ReadTargetSection(const YamlNode& target, const KnownKeys& known, std::vector<Led>* leds);
// One member of `inclinometers`.
void ReadTiltMount(const YamlNode& node, const KnownKeys& known, TiltMount* mount);
inline constexpr std::string_view kTiltMountRule = "{rotation: [nine numbers], sigma_deg: 0.005}";
// `points`, which may be missing.
void ReadPointsSection(const YamlNode& points,
                       const KnownKeys& known,
                       std::vector<NamedPoint>* list);

// Names of LEDs and points become CSV column names and field values, so they stay free of commas,
// quotes and blanks.
bool IsRigName(std::string_view text);
inline constexpr std::string_view kRigNameRule =
    "must be 1 to 32 letters, digits, '_', '-' or '.' because it becomes part of column names";

}  // namespace tbm
