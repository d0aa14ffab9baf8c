#pragma once

#include <string>
#include <string_view>

#include "idl/cpp/messages.h"

// Words and limits that the screen and the plain lines of `tbm watch` share.
namespace tbm::watch {

// Older is stale: the deadlines of the topics' QoS classes (idl/cpp/qos.h).
extern const double kStalePoseS;
extern const double kStaleHealthS;

std::string AgeText(double age_s);                             // "0.12 s", "3 min", "2 h"
std::string Mm(double value_m);                                // right-aligned, hundredths
std::string StatusText(PoseStatus status, PoseReason reason);  // "degraded few_leds"

// Text from the wire for a terminal: control characters, which could redraw the screen, become '?'.
std::string Harmless(std::string_view text);

}  // namespace tbm::watch
