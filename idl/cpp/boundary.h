#pragma once

#include <string_view>

namespace tbm::dds {

// Why a sample is not let through, neither out nor in. Counted, reported as an alarm, never
// delivered.
enum class BoundaryFault {
  kNone,
  kMalformed,      // the bytes are not the type: cut, too long, or another version of it
  kNoKey,          // machine, sensor, device, source or code is empty
  kNoTime,         // a time stamp is zero or negative
  kNotFinite,      // a number that its validity promises is NaN or infinite
  kOutOfRange,     // a number outside what it can be: negative sigma, quaternion not of unit length
  kEnumRange,      // an enumerator or reason code that the contract does not know
  kTooLong,        // more spots or points than the contract allows
  kContradiction,  // fields that cannot be true together: status ok with a reason, a number in
                   // "none"
};

constexpr std::string_view FaultText(BoundaryFault fault) {
  switch (fault) {
    case BoundaryFault::kNone:
      return "";
    case BoundaryFault::kMalformed:
      return "bytes are not of this type";
    case BoundaryFault::kNoKey:
      return "a key field is empty";
    case BoundaryFault::kNoTime:
      return "a time stamp is not set";
    case BoundaryFault::kNotFinite:
      return "a number that must be finite is not";
    case BoundaryFault::kOutOfRange:
      return "a number is outside its range";
    case BoundaryFault::kEnumRange:
      return "an enumerator or reason code is unknown";
    case BoundaryFault::kTooLong:
      return "a sequence is longer than the contract allows";
    case BoundaryFault::kContradiction:
      return "fields contradict each other";
  }
  return "";
}

}  // namespace tbm::dds
