#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "guidance/app/accuracy.h"
#include "guidance/app/check_command.h"

namespace tbm {

// What is the same in both reports of `tbm check`: of poses in the camera's frame, and of the whole
// chain's points in site.

struct Spreads {
  explicit Spreads(const std::vector<Eigen::Vector3d>& differences_mm);

  std::string Text() const;  // the table under the observations
  void AddTo(nlohmann::ordered_json* json) const;

  std::array<Spread, 4> of;  // dx dy dz distance
};

// The beginning of gnuplot's script, behind the block $data: one panel for each quantity, with
// mean, RMS and 95 %. Columns of $data: number of the observation from 1 on, dx, dy, dz, distance.
// The caller may draw panels of its own, as many as `panels` leaves room for, and ends with
// kPanelsEnd.
std::string PanelsScript(const Spreads& spreads,
                         std::size_t observations,
                         int panels,
                         std::string_view title);
// Of the quantities' panels, for the caller's own.
std::string_view PanelStyle(std::size_t observations);
inline constexpr std::string_view kPanelsEnd = "unset multiplot\n";

// Everything that would stop the report is found before anything of it is written.
std::optional<std::string> ReportObstacle(const CheckRequest& request);

struct CheckReport {
  std::string csv;
  std::string json;
  std::string plot;  // for gnuplot
  int height_px = 900;
};
ExitCode WriteReport(const CheckReport& report,
                     const CheckRequest& request,
                     const Console& console);

}  // namespace tbm
