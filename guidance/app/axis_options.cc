#include "guidance/app/axis_options.h"

#include <CLI/CLI.hpp>

namespace tbm {
namespace {

constexpr const char* kAxisHelp =
    "FILE is LandXML (1.0 to 1.2), or a CSV with a point of the axis in each row: east_m, north_m "
    "and, both\n"
    "optional, up_m and chainage_m.\n"
    "\n"
    "Chainage is plan length as the file counts it; official chainage is what stands on the "
    "tunnel\n"
    "wall, after the file's equations. Every output carries both, and the file's SHA-256.\n"
    "\n"
    "Examples\n"
    "  tbm axis check tests/data/axis/example.xml\n"
    "  tbm axis eval tests/data/axis/example.xml --at 10250\n"
    "  tbm axis project tests/data/axis/example.xml tests/data/axis/example_shots.csv\n"
    "  tbm axis plot tests/data/axis/example.xml --out axis.png";

constexpr const char* kCheckHelp =
    "Says what is odd: gaps, kinks, radii or directions mirrored, redundant values that disagree,\n"
    "units. `refused`: no axis is made of the file, the exit code is 2. `odd`: look at it.";

constexpr const char* kEvalHelp =
    "Columns: bearing_deg clockwise from north; curvature_right_per_m + turning right;\n"
    "gradient_mm_per_m + uphill; cant_mm + where the left rail is higher. What the design does "
    "not\n"
    "give is empty.\n"
    "\n"
    "Examples\n"
    "  tbm axis eval axis.xml --from 10100 --to 10200 --step 1 --out points.csv\n"
    "  tbm axis eval axis.xml --at 690 --official\n"
    "      both places, when the number stands twice on the wall";

constexpr const char* kProjectHelp =
    "POINTS is a CSV with east_m, north_m, up_m and, both optional, point (a name) and near_m (a\n"
    "chainage that decides where the axis passes twice). One row each, in order:\n"
    "  status              ok, or none with a reason: before_start, beyond_end, too_far, "
    "ambiguous\n"
    "  deviation_right_mm  square to the axis in plan, + to the right of increasing chainage\n"
    "  deviation_up_mm     plumb, over the gradient line at that chainage\n"
    "  other_chainage_m    the next nearest place of the axis, where it passes twice";

void AddSource(CLI::App* command, AxisRequests& requests) {
  command->add_option("FILE", requests.source.file, "LandXML or CSV of the axis")->required();
  command->add_option(
      "--alignment", requests.source.options.alignment, "its name, when FILE has several");
  command->add_option(
      "--profile", requests.source.options.profile, "its name, when there are several");
  command
      ->add_option("--origin",
                   requests.origin_m,
                   "east, north and height in metres to subtract from all coordinates")
      ->expected(3);
}

void AddOut(CLI::App* command, std::string& out, bool& force) {
  command->add_option("--out,-o", out, "file to write; - is the standard output")
      ->capture_default_str();
  command->add_flag("--force,-f", force, "replace an existing file");
}

void AddEval(CLI::App* axis, AxisRequests& requests) {
  AxisEvalRequest& request = requests.eval;
  CLI::App* eval = axis->add_subcommand("eval", "Point, direction, gradient, cant at a chainage");
  eval->footer(kEvalHelp);
  AddSource(eval, requests);
  CLI::Option* at = eval->add_option("--at", request.at_m, "chainage; several with commas")
                        ->allow_extra_args(false)
                        ->delimiter(',');
  eval->add_option("--from", request.from_m, "first chainage; the start")->excludes(at);
  eval->add_option("--to", request.to_m, "last chainage; the end")->excludes(at);
  eval->add_option("--step", request.step_m, "metres from row to row")
      ->check(CLI::Range(1e-6, 1e6))
      ->capture_default_str();
  eval->add_flag("--official", request.is_official, "chainages are those on the tunnel wall");
  AddOut(eval, request.out, request.force);
}

void AddProject(CLI::App* axis, AxisRequests& requests) {
  AxisProjectRequest& request = requests.project;
  CLI::App* project = axis->add_subcommand("project", "Chainage and deviations of points");
  project->footer(kProjectHelp);
  AddSource(project, requests);
  project->add_option("POINTS", request.points, "CSV of points")->required();
  project->add_option("--near", request.near_m, "chainage near all points");
  project->add_option("--reach", request.reach_m, "furthest from the axis, in metres")
      ->check(CLI::Range(0.001, 1e6))
      ->capture_default_str();
  AddOut(project, request.out, request.force);
}

}  // namespace

CLI::App* AddAxis(CLI::App& app, AxisRequests& requests) {
  CLI::App* axis = app.add_subcommand("axis", "Design axis: check, evaluate, project, draw");
  axis->footer(kAxisHelp);
  axis->require_subcommand(1);
  CLI::App* check = axis->add_subcommand("check", "What is odd in the file");
  check->footer(kCheckHelp);
  AddSource(check, requests);
  check->add_option("--format", requests.check_format, "form of the output")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
  AddEval(axis, requests);
  AddProject(axis, requests);
  CLI::App* plot = axis->add_subcommand("plot", "Plan, profile and curvature as a picture");
  AddSource(plot, requests);
  plot->add_option("--out,-o", requests.plot.out, "PNG to write")->required();
  plot->add_flag("--force,-f", requests.plot.force, "replace an existing file");
  return axis;
}

ExitCode RunAxis(const CLI::App& axis, AxisRequests& requests, const Console& console) {
  if (requests.origin_m.size() == 3) {
    requests.source.options.site_origin = {
        requests.origin_m[0], requests.origin_m[1], requests.origin_m[2]};
  }
  requests.check.source = requests.source;
  requests.eval.source = requests.source;
  requests.project.source = requests.source;
  requests.plot.source = requests.source;
  requests.check.as_json = requests.check_format == "json";
  if (axis.got_subcommand("check")) return RunAxisCheck(requests.check, console);
  if (axis.got_subcommand("eval")) return RunAxisEval(requests.eval, console);
  if (axis.got_subcommand("project")) return RunAxisProject(requests.project, console);
  return RunAxisPlot(requests.plot, console);
}

}  // namespace tbm
