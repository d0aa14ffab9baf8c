#include <array>

#include "devices/total_station/total_station.h"

namespace tbm {
namespace {

struct FailureRow {
  std::string_view code;
  std::string_view sentence;
};

// In the order of the enumeration, which begins at 1.
constexpr std::array<FailureRow, 27> kFailures = {{
    {"not_connected", "There is no connection to the total station at the moment."},
    {"unreachable",
     "The total station's address or port does not answer: check cable, radio and power."},
    {"refused",
     "The port may not be opened, is in use by another program, or refuses its settings."},
    {"link_lost", "The connection to the total station broke; it is being opened again."},
    {"timeout", "The total station did not answer in time."},
    {"garbled", "An answer was damaged on its way: check cable, radio and baud rate."},
    {"asleep", "The total station sleeps or is switched off."},
    {"busy", "The total station is busy with another measurement."},
    {"not_supported", "This model or firmware does not know the call."},
    {"no_licence", "The robotic functions are not licensed on this total station."},
    {"bad_parameter", "The total station refuses a value that it was sent."},
    {"low_power", "The total station's battery is too low."},
    {"tilted", "The bracket leans more than the compensator can take up: level the total station."},
    {"no_target", "No prism where it was looked for: line of sight blocked, prism dirty or gone."},
    {"several_targets", "More than one prism, or a reflection of one, is in the field of view."},
    {"bad_environment",
     "Dust, vibration or a lamp keeps the total station from finding the prism."},
    {"inaccurate", "The telescope did not reach its position or the prism within the tolerance."},
    {"no_lock", "The prism is not locked, or target recognition is switched off."},
    {"motor", "A drive of the total station does not do what it should."},
    {"angle_sensor", "A circle of the total station cannot be read."},
    {"distance", "The distance could not be measured: weak signal or a broken beam."},
    {"aborted", "The motion was stopped on request or by a key on the instrument."},
    {"not_executed",
     "The telescope stands still, but not where it was told to go; it may be told again."},
    {"outcome_unknown",
     "The answer to a motion was lost; the telescope stands still, its target is unknown."},
    {"implausible", "The total station answered with a value that cannot be."},
    {"instrument", "The total station reports a failure; see its return code."},
    {"setting_not_taken",
     "A setting reads back as another value than was sent: set it on the instrument."},
}};

const FailureRow* RowOf(StationFailure failure) {
  const auto index = static_cast<std::size_t>(failure) - 1;
  return index < kFailures.size() ? &kFailures[index] : nullptr;
}

}  // namespace

std::string_view FailureCode(StationFailure failure) {
  const FailureRow* row = RowOf(failure);
  return row == nullptr ? "unknown" : row->code;
}

std::string_view FailureSentence(StationFailure failure) {
  const FailureRow* row = RowOf(failure);
  return row == nullptr ? "unknown" : row->sentence;
}

std::string_view StateCode(StationState state) {
  switch (state) {
    case StationState::kClosed:
      return "closed";
    case StationState::kOpening:
      return "opening";
    case StationState::kReady:
      return "ready";
    case StationState::kSilent:
      return "silent";
  }
  return "unknown";
}

}  // namespace tbm
