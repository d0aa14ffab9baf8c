#pragma once

#include <string>
#include <vector>

#include "pose/rig/rig.h"

namespace tbm {

// A rig as the text that ParseRig reads, every sigma written out: coordinates to a tenth of a
// micrometre, rotations and angles to a billionth, all else to the last bit. `name` is quoted, so
// it may be any text.
std::string RigYaml(const Rig& rig);

// Its parts, as a calibration's files hold them too. Each ends with a new line.
std::string CameraSectionYaml(const Rig& rig);
std::string TargetYaml(const std::vector<Led>& leds);
// The members only, to stand under a section's name.
std::string LensYaml(const CameraModel& lens);
std::string TiltMountYaml(const TiltMount& mount);
std::string PointsYaml(const std::vector<NamedPoint>& points);

// Text as YAML takes it in one line, whatever it holds.
std::string YamlText(const std::string& text);

}  // namespace tbm
