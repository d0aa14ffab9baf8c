#pragma once

#include <optional>
#include <string>
#include <vector>

#include "guidance/app/calibrate_command.h"
#include "pose/calibrate/target_calibration.h"
#include "pose/rig/rig.h"

namespace tbm {

// All that `tbm calibrate target` found, with the names that the numbers belong to.
struct TargetResult {
  CalibrateTargetRequest request;
  std::vector<Led> nominal;
  std::vector<std::string> files;  // of the placements
  std::vector<TargetPlacement> placements;
  TargetCalibration found;
};

// The target's part of a rig file, and below it, under `calibrated`, what it rests on.
std::string TargetPartYaml(const TargetResult& result);
// For the person who waits: each LED, each placement, the inclinometer.
std::string TargetSummary(const TargetResult& result);
// One row for each measured LED; and all there is.
std::string TargetCsv(const TargetResult& result);
std::string TargetJson(const TargetResult& result);

// What the inclinometer lacks, as a motion to make; for kNoRotation and kDoesNotFit, what
// contradicts.
std::string MissingForMounting(const TiltRotationFailure& failure, std::size_t readings);

}  // namespace tbm
