#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "guidance/app/axis_command.h"
#include "guidance/app/gnuplot.h"
#include "guidance/app/output_file.h"

namespace tbm {
namespace {

constexpr int kWidth_px = 1100;
constexpr int kHeight_px = 1000;

// Every joint of elements, and enough places between them for smooth lines.
std::vector<InternalChainage> PlottedChainages(const DesignAxis& axis) {
  constexpr int kPlaces = 2000;
  std::vector<InternalChainage> places;
  const double length_m = axis.end().m - axis.start().m;
  for (int i = 0; i <= kPlaces; ++i) {
    places.push_back({axis.start().m + length_m * i / kPlaces});
  }
  constexpr std::size_t kMostElements = 2000;  // the intervals of a table are no elements to see
  if (axis.plan().element_count() <= kMostElements) {
    for (std::size_t i = 0; i <= axis.plan().element_count(); ++i) {
      places.push_back(axis.plan().element_start(i));
    }
  }
  std::sort(places.begin(), places.end());
  return places;
}

std::string DataBlock(const DesignAxis& axis) {
  std::string script = "$data << EOD\n";
  for (const InternalChainage chainage : PlottedChainages(axis)) {
    const auto point = axis.At(chainage);
    if (!point) continue;
    script += fmt::format(
        "{:.4f} {:.4f} {:.4f} {:.9f} {} {}\n",
        chainage.m,
        point->p_plan_in_site.x(),
        point->p_plan_in_site.y(),
        1e3 * point->curvature_right_per_m,
        point->up_m ? fmt::format("{:.5f}", *point->up_m) : "NaN",
        point->cant ? fmt::format("{:.3f}", 1e3 * point->cant->left_over_right_m) : "NaN");
  }
  return script + "EOD\n";
}

bool HasCant(const DesignAxis& axis) {
  const auto chainages = PlottedChainages(axis);
  return std::any_of(chainages.begin(), chainages.end(), [&](InternalChainage chainage) {
    const auto point = axis.At(chainage);
    return point && point->cant;
  });
}

// Joints in plan and profile: few enough to be told apart.
std::string JointBlock(const DesignAxis& axis) {
  std::string script = "$joints << EOD\n";
  constexpr std::size_t kMostJoints = 200;
  const std::size_t count = axis.plan().element_count();
  for (std::size_t i = 0; i <= count; ++i) {
    if (count > kMostJoints && i != 0 && i != count) continue;
    const auto point = axis.At(axis.plan().element_start(i));
    if (!point) continue;
    script += fmt::format("{:.4f} {:.4f} {:.4f} {} {:.3f}\n",
                          point->chainage.m,
                          point->p_plan_in_site.x(),
                          point->p_plan_in_site.y(),
                          point->up_m ? fmt::format("{:.5f}", *point->up_m) : "NaN",
                          point->official.m);
  }
  return script + "EOD\n";
}

std::string EquationMarks(const DesignAxis& axis) {
  std::string script;
  for (const StationEquation& equation : axis.equations().equations()) {
    script += fmt::format(
        "set arrow from {0:.3f}, graph 0 to {0:.3f}, graph 1 nohead dt 3 lc rgb '#8030a0'\n"
        "set label '= {1:.2f}' at {0:.3f}, graph 0.94 offset 0.4,0 textcolor rgb '#8030a0'\n",
        equation.at.m,
        equation.ahead_m);
  }
  return script;
}

// A name out of a file, inside a quoted string of the script: it must not end it.
std::string Title(const std::string& name) {
  std::string title;
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    title += byte < 0x20 || byte == 0x7f || c == '\'' || c == '\\' ? '?' : c;
  }
  return title.empty() ? "axis" : title;
}

std::string PlotScript(const DesignAxis& axis) {
  std::string script = DataBlock(axis) + JointBlock(axis);
  script += fmt::format(
      "set multiplot title '{}   {:.8}..'\nset grid\nset key above right horizontal\nset lmargin "
      "12\n"
      "set rmargin 12\n",
      Title(axis.name()),
      axis.file_sha256());
  script +=
      "set origin 0,0.52\nset size 1,0.44\nset size ratio -1\nset xlabel 'east m'\n"
      "set ylabel 'north m'\nset format '%.0f'\n"
      "plot $data using 2:3 with lines lw 2 lc rgb '#1f5fa8' title 'plan', "
      "$joints using 2:3 with points pt 7 ps 0.6 lc rgb '#c0392b' title 'elements, on the wall', "
      "'' using 2:3:(sprintf('%.1f', $5)) with labels left offset 0.8,0 font ',8' notitle\n"
      "set size noratio\n";
  script += fmt::format("set xrange [{:.3f}:{:.3f}]\n", axis.start().m, axis.end().m);
  script += EquationMarks(axis);
  script += "set xlabel ''\nset format y '%.1f'\nset origin 0,0.27\nset size 1,0.25\n";
  if (axis.profile().exists()) {
    script +=
        "set ylabel 'height m'\nplot $data using 1:5 with lines lw 2 lc rgb '#27803f' title "
        "'gradient line', $joints using 1:4 with points pt 7 ps 0.5 lc rgb '#c0392b' notitle\n";
  }
  script +=
      "set origin 0,0.01\nset size 1,0.26\nset xlabel 'chainage m'\nset ylabel 'curvature 1/km'\n"
      "set zeroaxis lt -1 lc rgb '#888888'\n";
  const std::string curvature =
      "plot $data using 1:4 with lines lw 2 lc rgb '#c0392b' title 'to the right +'";
  // gnuplot draws nothing at all when one of the lines has no point.
  script += HasCant(axis) ? "set y2label 'cant mm'\nset y2tics\nset ytics nomirror\n" + curvature +
                                ", $data using 1:6 axes x1y2 with lines dt 2 lc rgb '#e08000' "
                                "title 'cant, left rail up'\n"
                          : curvature + "\n";
  script += "unset multiplot\n";
  return script;
}

}  // namespace

ExitCode RunAxisPlot(const AxisPlotRequest& request, const Console& console) {
  if (const auto obstacle = OutputFile(request.out, request.force).Obstacle()) {
    Complain(console, *obstacle);
    return ExitCode::kBadInput;
  }
  const auto axis = LoadAxis(request.source, console);
  if (!axis) return ExitCode::kBadInput;
  if (const auto fault =
          DrawPicture(PlotScript(*axis), kWidth_px, kHeight_px, request.out, request.force)) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  return ExitCode::kDone;
}

}  // namespace tbm
