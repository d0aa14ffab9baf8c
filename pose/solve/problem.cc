#include "pose/solve/problem.h"

#include "pose/base/check.h"

namespace tbm {

PoseReason ReasonOf(PoseFailure failure) {
  switch (failure) {
    case PoseFailure::kTooFewLeds:
      return PoseReason::kTooFewLeds;
    case PoseFailure::kNotObservable:
      return PoseReason::kNotObservable;
    case PoseFailure::kBehindCamera:
      return PoseReason::kBehindCamera;
    case PoseFailure::kNotConverged:
      return PoseReason::kNotConverged;
    case PoseFailure::kAmbiguous:
      return PoseReason::kAmbiguous;
  }
  TBM_CHECK(false);
  return PoseReason::kNotConverged;
}

}  // namespace tbm
