#include "guidance/app/check_report.h"

#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "guidance/app/gnuplot.h"
#include "guidance/app/output_file.h"

namespace tbm {
namespace {

constexpr std::array<const char*, 4> kQuantities = {"dx", "dy", "dz", "distance"};
constexpr std::array<const char*, 4> kColours = {"#c0392b", "#27803f", "#1f5fa8", "#333333"};

ReportFolder FolderOf(const CheckRequest& request) {
  return {request.report, "check", request.force};
}

}  // namespace

Spreads::Spreads(const std::vector<Eigen::Vector3d>& differences_mm) {
  std::array<std::vector<double>, 4> values_mm;
  for (const Eigen::Vector3d& d : differences_mm) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      values_mm[axis].push_back(d(static_cast<Eigen::Index>(axis)));
    }
    values_mm[3].push_back(d.norm());
  }
  for (std::size_t i = 0; i < of.size(); ++i) of[i] = SpreadOf(std::move(values_mm[i]));
}

std::string Spreads::Text() const {
  std::string text =
      fmt::format("\n{:>10} {:>9} {:>9} {:>9} {:>9}\n", "mm", "mean", "RMS", "95 %", "max");
  for (std::size_t i = 0; i < of.size(); ++i) {
    text += fmt::format("{:>10} {:>9.3f} {:>9.3f} {:>9.3f} {:>9.3f}\n",
                        kQuantities[i],
                        of[i].mean_mm,
                        of[i].rms_mm,
                        of[i].p95_mm,
                        of[i].max_mm);
  }
  return text;
}

void Spreads::AddTo(nlohmann::ordered_json* json) const {
  for (std::size_t i = 0; i < of.size(); ++i) {
    (*json)[kQuantities[i]] = {{"mean_mm", of[i].mean_mm},
                               {"rms_mm", of[i].rms_mm},
                               {"p95_mm", of[i].p95_mm},
                               {"max_mm", of[i].max_mm}};
  }
}

std::string_view PanelStyle(std::size_t observations) {
  return observations > 100 ? "with points pt 7 ps 0.4" : "with impulses lw 3";
}

std::string PanelsScript(const Spreads& spreads,
                         std::size_t observations,
                         int panels,
                         std::string_view title) {
  std::string script =
      fmt::format("set multiplot layout {},1 title '{}' offset 0,-0.2\n", panels, title);
  script += fmt::format(
      "set grid\nset key outside right top\nset xrange [0.5:{}.5]\nset xtics format '%g'\n"
      "set lmargin 10\nset rmargin 26\nset zeroaxis lt -1 lc rgb '#888888'\n"
      "set offsets 0,0,graph 0.08,graph 0.08\n",
      observations);
  for (std::size_t i = 0; i < spreads.of.size(); ++i) {
    const Spread& s = spreads.of[i];
    const bool is_distance = i == 3;
    script += fmt::format("set ylabel '{} mm'\n", kQuantities[i]);
    if (is_distance) script += "set yrange [0:*]\n";
    if (static_cast<int>(i) + 1 == panels) script += "set xlabel 'observation'\n";
    script += fmt::format(
        "plot $data using 1:{} {} lc rgb '{}' title '{}', {:.5f} lc rgb '{}' dt 2 title 'mean "
        "{:.2f}', {:.5f} lc rgb '#e08000' dt 3 title 'RMS {:.2f}'",
        i + 2,
        PanelStyle(observations),
        kColours[i],
        kQuantities[i],
        s.mean_mm,
        kColours[i],
        s.mean_mm,
        s.rms_mm,
        s.rms_mm);
    if (is_distance) {
      script +=
          fmt::format(", {:.5f} lc rgb '#8030a0' dt 4 title '95 % {:.2f}'", s.p95_mm, s.p95_mm);
    }
    script += fmt::format(", NaN lc rgb '#ffffff' title 'max {:.2f}'\n", s.max_mm);
  }
  return script;
}

std::optional<std::string> ReportObstacle(const CheckRequest& request) {
  return FolderOf(request).Obstacle({"csv", "json", "png"});
}

ExitCode WriteReport(const CheckReport& report,
                     const CheckRequest& request,
                     const Console& console) {
  const ReportFolder folder = FolderOf(request);
  for (const auto& [ending, text] :
       {std::pair("csv", &report.csv), std::pair("json", &report.json)}) {
    if (const auto fault = folder.File(ending).Write(*text)) {
      Complain(console, *fault);
      return ExitCode::kBadInput;
    }
  }
  // The figures are complete without the picture.
  if (const auto fault = DrawPicture(
          report.plot, 1000, report.height_px, folder.File("png").path(), request.force)) {
    Complain(console, *fault);
  }
  return ExitCode::kDone;
}

}  // namespace tbm
