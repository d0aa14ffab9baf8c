#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "devices/replay/csv.h"
#include "guidance/app/console.h"
#include "pose/base/result.h"
#include "pose/rig/rig.h"

namespace tbm {

// A drawing of the LED board: the columns led, x_mm, y_mm, z_mm in the target frame. All faults are
// collected.
Result<std::vector<Led>, FileFaults> ParseLedDrawing(std::string text, const std::string& file);

// The LEDs of such a table (.csv), of a rig file or of a part of one. What is wrong is said.
std::optional<std::vector<Led>> LoadNominalLeds(const std::string& path, const Console& console);

// What a total station measured of the board in one placement.
struct PlacementPoints {
  std::vector<std::optional<Eigen::Vector3d>> led_in_site_m;  // side by side with the LEDs
  std::vector<std::string> others;                            // names of points that are no LED
};

// A table of stamp_ns, point, x_mm, y_mm, z_mm, or a Leica GSI file. Names compare without leading
// zeros. A point that stands twice is the mean of both, if they are no further apart than
// `most_apart_mm`. Errors name the line, and where no LED is among the points, what is.
Result<PlacementPoints, FileFaults> ParsePlacement(std::string text,
                                                   const std::string& file,
                                                   const std::vector<Led>& leds,
                                                   double most_apart_mm);

}  // namespace tbm
