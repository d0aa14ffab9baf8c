#pragma once

#include <string>

#include "devices/sim/world.h"
#include "pose/base/result.h"

namespace tbm {

// Faults of the simulated world as they stand on a command line. Each may end in "@FROM-TO", world
// seconds; without it the fault lasts. The error says what would be right.
//
//   P3@10-20                          an LED is hidden
//   U,V,SPREAD,PEAK@FROM-TO           a lamp: image point [px], sigma [px], peak [DN]
//   MIRROR_U,DU,DV,STRENGTH@FROM-TO   reflections about a column, shifted; MIRROR_U "-": only
//   shifted target|camera,BETA,GAMMA@FROM-TO  added to an inclinometer [deg]
Result<sim::HiddenLed, std::string> ParseHiddenLed(const std::string& text, const Rig& rig);
Result<sim::Lamp, std::string> ParseLamp(const std::string& text);
Result<sim::Reflection, std::string> ParseReflection(const std::string& text);
Result<sim::TiltFault, std::string> ParseTiltFault(const std::string& text);

}  // namespace tbm
