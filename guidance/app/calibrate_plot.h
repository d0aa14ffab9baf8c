#pragma once

#include <optional>
#include <string>

#include "guidance/app/calibrate_input.h"
#include "pose/calibrate/camera_calibration.h"

namespace tbm {

// Where in the image points were seen, and which parts have none. Empty when done, else why there
// is no picture.
std::optional<std::string> DrawCoverage(const Coverage& coverage,
                                        const FoundBoards& boards,
                                        const std::string& path,
                                        bool may_replace);

// Residuals as arrows in the image, and each picture's own.
std::optional<std::string> DrawResiduals(const CameraCalibration& found,
                                         const FoundBoards& boards,
                                         const std::string& path,
                                         bool may_replace);

}  // namespace tbm
