#pragma once

#include <optional>
#include <string>
#include <vector>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"
#include "guidance/axis/design_axis.h"
#include "guidance/config/axis_file.h"

namespace tbm {

// What every `tbm axis` command reads.
struct AxisSource {
  std::string file;  // LandXML or the tunneller's table
  AxisFileOptions options;
};

struct AxisCheckRequest {
  AxisSource source;
  bool as_json = false;
};

struct AxisEvalRequest {
  AxisSource source;
  std::vector<double> at_m;
  std::optional<double> from_m;
  std::optional<double> to_m;
  double step_m = 10.0;
  bool is_official = false;  // at, from and to are what stands on the wall
  std::string out = "-";
  bool force = false;
};

struct AxisProjectRequest {
  AxisSource source;
  std::string points;  // CSV: east_m, north_m, up_m and, both optional, point and near_m
  std::optional<double> near_m;
  double reach_m = DesignAxis::kReach_m;
  std::string out = "-";
  bool force = false;
};

struct AxisPlotRequest {
  AxisSource source;
  std::string out;
  bool force = false;
};

// What is odd in the file, with place and size. kBadInput when no axis can be made of it.
ExitCode RunAxisCheck(const AxisCheckRequest& request, const Console& console);

// Point, direction, curvature, gradient and cant at chainages: one CSV row each.
ExitCode RunAxisEval(const AxisEvalRequest& request, const Console& console);

// Chainage and deviations of points: one CSV row for each row of the file, in order.
ExitCode RunAxisProject(const AxisProjectRequest& request, const Console& console);

// Plan, profile and curvature as a PNG.
ExitCode RunAxisPlot(const AxisPlotRequest& request, const Console& console);

// The axis of a file; complains, and is empty, when there is none.
std::optional<DesignAxis> LoadAxis(const AxisSource& source, const Console& console);

}  // namespace tbm
