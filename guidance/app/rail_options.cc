#include "guidance/app/rail_options.h"

#include <CLI/CLI.hpp>

namespace tbm {
namespace {

constexpr const char* kLineHelp =
    "RUN is a folder with rail.yaml (the trolley), imu.csv, tilt.csv, centres.csv and targets.csv; "
    "the\n"
    "trolley rests at first. One row is written for each sample of the inertial unit:\n"
    "  x_m .. qz      where the unit was in the world, and how it stood (world_from_imu)\n"
    "  sigma_*_mm     one standard deviation; the survey of the targets is in it\n"
    "  status         fixed, bridged (by the unit alone, between two fixes), open (nothing on one "
    "side)\n"
    "                 or gap (samples are missing)\n"
    "Beside it a .json: what was estimated on the way, how well the measurements agree, what was "
    "not taken\n"
    "and what the run could not observe.\n"
    "\n"
    "Methods\n"
    "  smoothed   what came later counts as well (default)\n"
    "  filter     as it is known while the run goes on\n"
    "  inertial   the unit alone, integrated twice, for comparison\n"
    "\n"
    "Example\n"
    "  tbm line run_0412 --out line.csv";

constexpr const char* kTargetsHelp =
    "RUN is a folder as for tbm line, with frames.csv (stamp_ns, file) instead of centres.csv, and "
    "a "
    "column\n"
    "kind in targets.csv: led, circle:DIAMETER_MM, coded:NUMBER (ArUco 4x4_50) or\n"
    "board:NAME:COLUMNSxROWS:POINT (inner corners row by row from 0), empty for a target that is "
    "not "
    "looked\n"
    "for. Each target is looked for where the filter expects it after all that came before. One "
    "row is "
    "written\n"
    "for each image point: stamp_ns, target, u_px, v_px, sigma_px. A target that two places fit is "
    "left out.\n"
    "Beside it a .json: how often each target was seen, and why it was not.\n"
    "\n"
    "Example\n"
    "  tbm targets run_0412 --out run_0412/centres.csv && tbm line run_0412 --out line.csv";

constexpr const char* kGroundHelp =
    "RUN is a folder as for tbm line, with ground_frames.csv (stamp_ns, file) and a section "
    "ground_camera in\n"
    "rail.yaml. One row is written for each two images after each other:\n"
    "  dx_m, dy_m   how far the unit moved, across the axis of the camera, by the height that "
    "rail.yaml says\n"
    "  sigma_m      of each\n"
    "Height makes scale: tbm line estimates how far both are off. Beside it a .json: where nothing "
    "could be\n"
    "told, and why (no_texture, blurred, too_few_matches, not_a_plane).\n"
    "\n"
    "Example\n"
    "  tbm ground run_0412 --out run_0412/displacement.csv && tbm line run_0412 --out line.csv";

constexpr const char* kSettleHelp =
    "BASE and LATER are files of tbm line, of the same rail and in the same frame; LATER may be "
    "several, in\n"
    "any order. Both are compared at equal distance along BASE, at the same place in plan. "
    "Columns:\n"
    "  dz_mm          last line minus base: settlement is negative; empty where one of them is "
    "not there\n"
    "  sigma_mm       of the difference\n"
    "  significant    1 or 0: two-sided test of this place alone\n"
    "  alert          with --alert-mm: none, watch, alert, alarm; only by more than chance gives\n"
    "                 anywhere on the line, and beside a shift of the whole line\n"
    "  trend_*        of three or more lines: weighted straight line through the heights\n"
    "  dz_1_mm ..     of each later line against the base\n"
    "The summary says what chance does not explain, fits a trough, and says when the whole line "
    "is higher or\n"
    "lower by the same.\n"
    "\n"
    "Example\n"
    "  tbm settle march.csv april.csv may.csv --out settlement.csv --alert-mm 1,3,5 --plot "
    "settlement.png";

constexpr const char* kGeometryHelp =
    "LINE is a file of tbm line. Columns, at equal distance, empty where nothing can be said:\n"
    "  level_d1_mm, level_d2_mm           longitudinal level, + up; wavelengths 3 to 25 m, 25 to "
    "70 m\n"
    "  alignment_d1_mm, alignment_d2_mm   alignment, + to the left; the same\n"
    "  cross_level_mm                     + where the left side is higher, over the gauge\n"
    "  twist_3m_mm_per_m ..               change of cross level over a base, centred\n"
    "Band-pass: Butterworth of fourth order, forward and backward, without phase; gain 0.71 at "
    "either end of\n"
    "the band. 50 m (D1) and 140 m (D2) at either end of the line stay empty.\n"
    "Not as in EN 13848: one line instead of two rails, cross level from the roll of the inertial "
    "unit (a\n"
    "constant tilt of it stands in the cross level, not in the twist), no gauge.\n"
    "\n"
    "Example\n"
    "  tbm geometry line.csv --out geometry.csv --bases 3,6,12";

}  // namespace

CLI::App* AddLine(CLI::App& app, LineRequest& request) {
  CLI::App* line = app.add_subcommand("line", "The line of the rail from a trolley's run");
  line->footer(kLineHelp);
  line->add_option("RUN", request.run, "folder of the run")->required();
  line->add_option("--out,-o", request.out, "file to write; - is the standard output")->required();
  line->add_option("--method,-m", request.method, "estimator")
      ->check(CLI::IsMember({"smoothed", "filter", "inertial"}))
      ->capture_default_str();
  line->add_flag("--force,-f", request.force, "replace existing files");
  return line;
}

CLI::App* AddTargets(CLI::App& app, TargetsRequest& request) {
  CLI::App* targets =
      app.add_subcommand("targets", "Image points of surveyed targets in a trolley's images");
  targets->footer(kTargetsHelp);
  targets->add_option("RUN", request.run, "folder of the run")->required();
  targets->add_option("--out,-o", request.out, "file to write; - is the standard output")
      ->required();
  targets->add_flag("--force,-f", request.force, "replace existing files");
  return targets;
}

CLI::App* AddGround(CLI::App& app, GroundRequest& request) {
  CLI::App* ground =
      app.add_subcommand("ground", "How the ground went by in a trolley's images of it");
  ground->footer(kGroundHelp);
  ground->add_option("RUN", request.run, "folder of the run")->required();
  ground->add_option("--out,-o", request.out, "file to write; - is the standard output")
      ->required();
  ground->add_flag("--force,-f", request.force, "replace existing files");
  return ground;
}

CLI::App* AddSettle(CLI::App& app, SettleRequest& request) {
  CLI::App* settle = app.add_subcommand("settle", "How much a rail went down from run to run");
  settle->footer(kSettleHelp);
  settle->add_option("BASE", request.base, "line of the first run")->required();
  settle->add_option("LATER", request.later, "lines of later runs")->required();
  settle->add_option("--out,-o", request.out, "file to write; - is the standard output")
      ->required();
  settle->add_option("--step", request.step_m, "metres from row to row")
      ->check(CLI::Range(0.001, 1000.0))
      ->capture_default_str();
  settle->add_option("--level", request.level, "of the test: a part of 1 - level alarms falsely")
      ->check(CLI::Range(0.5, 0.999999))
      ->capture_default_str();
  settle->add_option("--alert-mm", request.alert_mm, "watch, alert and alarm, with commas")
      ->allow_extra_args(false)
      ->delimiter(',');
  settle->add_option("--plot", request.plot, "PNG to write as well");
  settle->add_flag("--force,-f", request.force, "replace existing files");
  return settle;
}

CLI::App* AddGeometry(CLI::App& app, GeometryRequest& request) {
  CLI::App* geometry =
      app.add_subcommand("geometry", "Level, alignment, cross level and twist of a line");
  geometry->footer(kGeometryHelp);
  geometry->add_option("LINE", request.line, "file of tbm line")->required();
  geometry->add_option("--out,-o", request.out, "file to write; - is the standard output")
      ->required();
  geometry->add_option("--step", request.step_m, "metres from row to row")
      ->check(CLI::Range(0.05, 0.5))
      ->capture_default_str();
  geometry->add_option("--bases", request.bases_m, "of the twist in metres, with commas")
      ->allow_extra_args(false)
      ->delimiter(',')
      ->capture_default_str();
  geometry->add_option("--gauge-mm", request.gauge_mm, "what the cross level is taken over")
      ->check(CLI::Range(100.0, 10000.0))
      ->capture_default_str();
  geometry->add_flag("--force,-f", request.force, "replace an existing file");
  return geometry;
}

}  // namespace tbm
