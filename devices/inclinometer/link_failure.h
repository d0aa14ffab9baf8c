#pragma once

#include "devices/bus/byte_link.h"
#include "devices/inclinometer/inclinometer.h"

namespace tbm {

inline InclinometerFailure FailureFromLink(LinkFailure failure) {
  switch (failure) {
    case LinkFailure::kMissing:
      return InclinometerFailure::kPortMissing;
    case LinkFailure::kDenied:
    case LinkFailure::kBusy:
    case LinkFailure::kBadSettings:
      return InclinometerFailure::kPortRefused;
    case LinkFailure::kHungUp:
      return InclinometerFailure::kHungUp;
    case LinkFailure::kTimeout:
      return InclinometerFailure::kNoReply;
  }
  return InclinometerFailure::kHungUp;
}

}  // namespace tbm
