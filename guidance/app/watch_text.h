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
std::string ClockText(Timestamp at);                           // "14:05 UTC"
std::string Mm(double value_m);                                // right-aligned, hundredths
std::string StatusText(PoseStatus status, PoseReason reason);  // "degraded few_leds"

// Text from the wire for a terminal: control characters, which could redraw the screen, become '?'.
std::string Harmless(std::string_view text);

// Of a line for a pipe: machine, stamp and age, then the status: stale when it is, whatever the
// sender said.
std::string LineHead(std::string_view topic,
                     std::string_view machine,
                     Timestamp at,
                     double age_s,
                     bool is_stale,
                     const std::string& status);
// " name=1.25"; empty for what is no number.
std::string Number(std::string_view name, double value, int decimals);
// Quoted, with quotes inside doubled, so that a line splits at blanks outside quotes.
std::string QuotedText(std::string_view text);

}  // namespace tbm::watch
