#include "guidance/app/tbm_app.h"

#include <algorithm>
#include <exception>
#include <map>
#include <optional>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "guidance/app/ask_command.h"
#include "guidance/app/axis_options.h"
#include "guidance/app/calibrate_options.h"
#include "guidance/app/chain_command.h"
#include "guidance/app/chain_input.h"
#include "guidance/app/check_command.h"
#include "guidance/app/completion.h"
#include "guidance/app/journal_options.h"
#include "guidance/app/rail_options.h"
#include "guidance/app/rail_study_command.h"
#include "guidance/app/solve_command.h"
#include "guidance/app/study_command.h"
#include "guidance/app/watch_command.h"

namespace tbm {
namespace {

constexpr const char* kAbout =
    "The surveyor's tool of a tunnel boring machine's guidance: shows the live system and asks it "
    "for "
    "things,\n"
    "works on recorded runs, journals and design axes, and checks against a total station.";

constexpr const char* kExamples =
    "Examples\n"
    "  tbm solve tests/data/run_small --out poses.csv\n"
    "      a pose for every picture of a recorded run, with its sigma and its bound\n"
    "  tbm check poses.csv station.gsi --point shield_head --align rigid --report report\n"
    "      how far these poses are from what the total station measured\n"
    "  tbm axis check tests/data/axis/example.xml\n"
    "      what is odd in the file of a design axis; eval, project and plot work on it\n"
    "  tbm watch\n"
    "      what the operator steers by, and all that it rests on\n"
    "  tbm record --out journal; tbm export journal --out tables\n"
    "      everything that is published, kept as MCAP files, and as tables\n"
    "\n"
    "Exit codes: 0 done, 2 command line or file wrong, 3 device, 4 DDS, 70 mistake of the "
    "program.\n"
    "Each command explains itself: tbm solve --help\n"
    "Completion for your shell: source <(tbm completion bash)";

constexpr const char* kSolveHelp =
    "RUN is a folder with rig.yaml (camera, LEDs, inclinometers), frames.csv (time and file of "
    "each\n"
    "picture) and tilt.csv (readings of both inclinometers). One row is written for each row of\n"
    "frames.csv, whatever happened to the frame:\n"
    "  status       ok, degraded (usable with its sigma, something is missing) or none\n"
    "  reason       why it is not ok, such as frame_missing or too_few_leds\n"
    "  qw .. tz_mm  how the target stands in the camera frame (x right, y down, z forward)\n"
    "  sigma_*      one standard deviation\n"
    "  POINT_*      the points named in rig.yaml; POINT_bound_mm: the error is larger than this "
    "once in\n"
    "               a thousand frames at the most, even when one LED or one tilt reading is wrong\n"
    "\n"
    "Methods\n"
    "  fused      LEDs and inclinometers, each weighted by its own sigma (default, most accurate)\n"
    "  published  the estimator of the pose paper, for comparison\n"
    "  vision     LEDs only\n"
    "\n"
    "Examples\n"
    "  tbm solve run_0412 --out poses.csv\n"
    "  tbm solve run_0412 --out vision.csv --method vision --force\n"
    "  tbm solve run_0412 --out - --format json | jq .";

constexpr const char* kCentresHelp =
    "One row is written for each bright spot: stamp_ns, led (empty when the spot is none of the "
    "target's),\n"
    "u_px, v_px (pixel 0, 0 is the centre of the first pixel), sigma_px and peak (grey values "
    "above the\n"
    "background).\n"
    "\n"
    "Example\n"
    "  tbm centres run_0412 --out centres.csv";

constexpr const char* kCheckPosesHelp =
    "POSES is a file of tbm solve. LOG holds what the total station measured of the same point: a "
    "CSV with\n"
    "the columns stamp_ns, point, x_mm, y_mm, z_mm, or a Leica GSI-8 / GSI-16 file (east, north, "
    "height).\n"
    "\n"
    "Pairing: where both files have stamps, each survey row takes the pose at its time, "
    "interpolated\n"
    "between the neighbours, or the nearest, none further than --tolerance-ms. Where stamps are "
    "missing the\n"
    "rows pair in order. Poses with status none are left out and counted.\n"
    "\n"
    "--align rigid first turns and shifts the survey onto the poses (no scale), for a total "
    "station that\n"
    "does not measure in the camera frame, and says how many degrees of freedom that took. At "
    "least four\n"
    "placements are needed for the remaining differences to say anything.\n"
    "\n"
    "POSES may also be what guidance published: its journal (*.mcap, or the folder), or the "
    "guidance.csv of\n"
    "tbm export. LOG then holds independent shots at points of the machine, in site, and each is "
    "compared\n"
    "with the position interpolated to its time: never beyond the record, and never across a time "
    "in which\n"
    "guidance said that it knows nothing. Besides the differences it is said how many lie inside "
    "the\n"
    "published 95 % ellipsoid. How far the log's clock is off is estimated where the machine moved "
    "enough to\n"
    "tell: --clock auto takes that out when it is more than three sigma, estimate always, trust "
    "never. Shots\n"
    "without a time (GSI) take that of --at.\n"
    "\n"
    "Examples\n"
    "  tbm check poses.csv station.gsi --point shield_head --align rigid --report report\n"
    "      writes report/check.csv, check.json and check.png\n"
    "  tbm check journal shots.csv --report report\n"
    "      every point that guidance and the log both know";

constexpr const char* kStudyHelp =
    "published: repeats the simulation of the pose paper's section 4.1 (its lens and LEDs, 4 m, "
    "0.1 to 1 px) "
    "with the\n"
    "three estimators, and writes study.csv, study.txt, study_rmse.png and study_mean.png: the six "
    "panels of\n"
    "its Fig. 3 with the bound that no estimator can go below drawn in.\n"
    "\n"
    "rail: runs a trolley along the curve of the rail-line paper's Table 1 and writes "
    "rail_study.csv and\n"
    "rail_study.txt: what inertial measuring, the paper's filter and ours make of it, beside its "
    "Table 2.\n"
    "\n"
    "Examples\n"
    "  tbm study published --out published_study\n"
    "  tbm study rail --out rail_study --draws 20";

constexpr const char* kAskHelp =
    "The process answers: accepted (it takes a while), done, refused or failed, with a sentence.\n"
    "  guidance, total_station   acknowledge CODE, shelve 'CODE MINUTES' --because WHY, "
    "unshelve CODE\n"
    "  total_station             check_references, set_up, pause, resume, propose_move "
    "E,N,U,REFERENCE,\n"
    "                            take_over_move, give_up_move, undo_move\n"
    "\n"
    "Examples\n"
    "  tbm ask total_station check_references --by 'A. Surveyor'\n"
    "  tbm ask guidance acknowledge deviation_high --by 'O. Perator' --because 'shift engineer "
    "knows'\n"
    "  tbm ask guidance shelve 'tilt_late 60' --by 'O. Perator' --because 'cable is being "
    "changed'\n"
    "\n"
    "Exit codes: 0 done, 2 refused, 3 failed, 4 nobody answers.";

constexpr const char* kWatchHelp =
    "On a terminal: a screen that redraws itself, green ok, yellow degraded, red none. What is old "
    "stands\n"
    "in brackets with the status STALE: the age is the worse of the time since it came and the age "
    "of its\n"
    "stamp. Into a pipe: one line of key=value for each sample.\n"
    "\n"
    "Examples\n"
    "  tbm watch\n"
    "  tbm watch --interface 192.168.10.5 --domain 25\n"
    "  tbm watch --seconds 5 | grep relative_pose";

// All options of all commands, filled in by the parser.
struct Requests {
  SolveRequest solve;
  SolveRequest centres;
  CheckRequest check;
  StudyRequest study;
  WatchRequest watch;
  AskRequest ask;
  AxisRequests axis;
  CalibrateRequests calibrate;
  JournalRequests journal;
  LineRequest line;
  TargetsRequest targets;
  GroundRequest ground;
  SettleRequest settle;
  GeometryRequest geometry;
  std::string align = "none";
  std::string format = "csv";
  std::string method = "fused";
  std::string shell;
  std::string study_name;
  std::string study_out;
  int study_draws = 0;
};

const std::map<std::string, PoseMethod> kMethods = {{"fused", PoseMethod::kFused},
                                                    {"published", PoseMethod::kPublished},
                                                    {"vision", PoseMethod::kVision}};

CLI::App* AddSolve(CLI::App& app, Requests& requests) {
  CLI::App* solve = app.add_subcommand("solve", "Poses of a recorded run");
  solve->footer(kSolveHelp);
  solve->add_option("RUN", requests.solve.run, "folder of the run")->required();
  solve->add_option("--out,-o", requests.solve.out, "file to write; - is the standard output")
      ->required();
  solve->add_option("--method,-m", requests.method, "estimator")
      ->check(CLI::IsMember({"fused", "published", "vision"}))
      ->capture_default_str();
  solve->add_option("--format", requests.format, "form of the output")
      ->check(CLI::IsMember({"csv", "json"}))
      ->capture_default_str();
  solve->add_flag("--force,-f", requests.solve.force, "replace an existing file");
  solve
      ->add_option(
          "--threads", requests.solve.threads, "threads that decode pictures; 0: one per core")
      ->check(CLI::Range(0, 256));
  return solve;
}

CLI::App* AddCentres(CLI::App& app, Requests& requests) {
  CLI::App* centres = app.add_subcommand("centres", "Bright spots of a recorded run");
  centres->footer(kCentresHelp);
  centres->add_option("RUN", requests.centres.run, "folder of the run")->required();
  centres->add_option("--out,-o", requests.centres.out, "file to write; - is the standard output")
      ->required();
  centres->add_flag("--force,-f", requests.centres.force, "replace an existing file");
  centres
      ->add_option(
          "--threads", requests.centres.threads, "threads that decode pictures; 0: one per core")
      ->check(CLI::Range(0, 256));
  return centres;
}

CLI::App* AddCheck(CLI::App& app, Requests& requests) {
  CheckRequest& request = requests.check;
  CLI::App* check = app.add_subcommand("check", "Poses against a total station");
  check->footer(kCheckPosesHelp);
  check->add_option("POSES", request.poses, "file of tbm solve, or a record of guidance")
      ->required();
  check->add_option("LOG", request.log, "total station's file: CSV or Leica GSI")->required();
  check->add_option("--point",
                    request.point,
                    "point of rig.yaml, such as shield_head, or of machine.yaml; there, none: all");
  check->add_option("--log-point", request.log_point, "its name in LOG, when that is another");
  check->add_option("--align", requests.align, "fit the two frames to each other first")
      ->check(CLI::IsMember({"none", "rigid"}))
      ->capture_default_str();
  check
      ->add_option(
          "--tolerance-ms", request.tolerance_ms, "furthest pose that may stand for a survey row")
      ->check(CLI::Range(0.0, 86'400'000.0))
      ->capture_default_str();
  check->add_option("--clock", request.clock, "take an error of the log's clock out: guidance only")
      ->check(CLI::IsMember({"auto", "estimate", "trust"}))
      ->capture_default_str();
  check->add_option("--clock-range-s", request.clock_range_s, "how far off it may be")
      ->check(CLI::Range(0.0, 100'000.0))
      ->capture_default_str();
  check->add_option("--log-sigma-mm", request.log_sigma_mm, "of each coordinate of a shot")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str();
  check->add_option("--at", request.at, "time of shots without one: UTC, the machine standing");
  check->add_option("--report", request.report, "folder for check.csv, check.json and check.png");
  check->add_flag("--force,-f", request.force, "replace existing files");
  return check;
}

CLI::App* AddStudy(CLI::App& app, Requests& requests) {
  StudyRequest& request = requests.study;
  CLI::App* study = app.add_subcommand("study", "Simulations that show what the estimators reach");
  study->footer(kStudyHelp);
  study->add_option("NAME", requests.study_name, "which study")
      ->required()
      ->check(CLI::IsMember({"published", "rail"}));
  study->add_option(
      "--out,-o", requests.study_out, "folder for the results; NAME_study unless given");
  study
      ->add_option(
          "--draws", requests.study_draws, "random poses at each noise level (1000); runs (10)")
      ->check(CLI::Range(1, 10'000'000));
  study->add_option("--seed", request.seed, "of the random numbers")->capture_default_str();
  study->add_option("--threads", request.threads, "threads; 0: one per core")
      ->check(CLI::Range(0, 256));
  study->add_flag("--force,-f", request.force, "replace existing files");
  return study;
}

ExitCode RunNamedStudy(const Requests& requests, const Console& console) {
  StudyRequest published = requests.study;
  RailStudyRequest rail{.seed = published.seed, .force = published.force};
  if (!requests.study_out.empty()) published.out = rail.out = requests.study_out;
  if (requests.study_draws > 0) published.draws = rail.draws = requests.study_draws;
  return requests.study_name == "rail" ? RunRailStudy(rail, console) : RunStudy(published, console);
}

CLI::App* AddWatch(CLI::App& app, Requests& requests) {
  WatchRequest& request = requests.watch;
  CLI::App* watch =
      app.add_subcommand("watch", "Live: what the operator steers by, and all that it rests on");
  watch->footer(kWatchHelp);
  AddNetworkOptions(*watch, request.network);
  watch->add_option("--seconds", request.seconds, "end after this time; 0: never")
      ->check(CLI::Range(0.0, 1e9));
  return watch;
}

CLI::App* AddAsk(CLI::App& app, Requests& requests) {
  AskRequest& request = requests.ask;
  CLI::App* ask = app.add_subcommand("ask", "Asks a process of the machine to do something");
  ask->footer(kAskHelp);
  ask->add_option("ADDRESSEE", request.addressee, "total_station or guidance")->required();
  ask->add_option("VERB", request.verb, "what to do")->required();
  ask->add_option("ARGUMENT", request.argument, "as the verb wants it");
  ask->add_option("--by", request.by, "your name; it stands in the journal")->required();
  ask->add_option("--because", request.because, "your reason");
  ask->add_option("--machine", request.machine, "machine_id; none: the one that is heard");
  ask->add_option("--wait", request.wait_s, "seconds, for the last answer")
      ->check(CLI::Range(0.0, 86400.0))
      ->capture_default_str();
  AddNetworkOptions(*ask, request.network);
  return ask;
}

CLI::App* AddCompletion(CLI::App& app, Requests& requests) {
  CLI::App* completion = app.add_subcommand("completion", "Completion script for a shell");
  completion->footer("Example, in ~/.bashrc:\n  source <(tbm completion bash)");
  completion->add_option("SHELL", requests.shell, "bash or zsh")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh"}));
  return completion;
}

ExitCode Dispatch(std::vector<std::string> arguments, const Console& console) {
  Requests requests;
  CLI::App app(kAbout, "tbm");
  app.footer(kExamples);
  app.set_version_flag("--version", "tbm " TBM_VERSION, "print the version");
  app.require_subcommand(1);
  app.get_formatter()->column_width(28);
  const CLI::App* solve = AddSolve(app, requests);
  const CLI::App* centres = AddCentres(app, requests);
  const CLI::App* check = AddCheck(app, requests);
  const CLI::App* axis = AddAxis(app, requests.axis);
  const CLI::App* calibrate = AddCalibrate(app, requests.calibrate);
  const CLI::App* line = AddLine(app, requests.line);
  const CLI::App* targets = AddTargets(app, requests.targets);
  const CLI::App* ground = AddGround(app, requests.ground);
  const CLI::App* settle = AddSettle(app, requests.settle);
  const CLI::App* geometry = AddGeometry(app, requests.geometry);
  const CLI::App* study = AddStudy(app, requests);
  const CLI::App* watch = AddWatch(app, requests);
  const CLI::App* ask = AddAsk(app, requests);
  const CLI::App* record = AddRecord(app, requests.journal);
  const CLI::App* exported = AddExport(app, requests.journal);
  const CLI::App* replay = AddReplay(app, requests.journal);
  const CLI::App* repair = AddRepair(app, requests.journal);
  const CLI::App* completion = AddCompletion(app, requests);

  std::reverse(arguments.begin(), arguments.end());  // as CLI11 wants them
  try {
    app.parse(std::move(arguments));
  } catch (const CLI::ParseError& error) {
    const bool is_help = error.get_exit_code() == 0;
    app.exit(error, console.out, console.err);
    return is_help ? ExitCode::kDone : ExitCode::kBadInput;
  }
  requests.solve.method = kMethods.at(requests.method);
  requests.solve.as_json = requests.format == "json";
  requests.journal.record.program = requests.journal.repair.program = "tbm " TBM_VERSION;
  requests.check.align_rigid = requests.align == "rigid";
  if (solve->parsed()) return RunSolve(requests.solve, console);
  if (centres->parsed()) return RunCentres(requests.centres, console);
  if (check->parsed() && IsGuidanceRecord(requests.check.poses)) {
    return RunChainCheck(requests.check, console);
  }
  if (check->parsed()) return RunCheck(requests.check, console);
  if (axis->parsed()) return RunAxis(*axis, requests.axis, console);
  if (calibrate->parsed()) return RunCalibrate(*calibrate, requests.calibrate, console);
  if (line->parsed()) return RunLine(requests.line, console);
  if (targets->parsed()) return RunTargets(requests.targets, console);
  if (ground->parsed()) return RunGround(requests.ground, console);
  if (settle->parsed()) return RunSettle(requests.settle, console);
  if (geometry->parsed()) return RunGeometry(requests.geometry, console);
  if (study->parsed()) return RunNamedStudy(requests, console);
  if (watch->parsed()) return RunWatch(requests.watch, console);
  if (ask->parsed()) return RunAsk(requests.ask, console);
  if (record->parsed()) return RunRecord(requests.journal.record, console);
  if (exported->parsed()) return RunExport(requests.journal.exported, console);
  if (replay->parsed()) return RunReplay(requests.journal.replay, console);
  if (repair->parsed()) return RunRepair(requests.journal.repair, console);
  if (completion->parsed()) {
    console.out << (requests.shell == "bash" ? BashCompletion(app) : ZshCompletion(app));
  }
  return ExitCode::kDone;
}

}  // namespace

ExitCode RunTbm(std::vector<std::string> arguments, const Console& console) {
  try {
    return Dispatch(std::move(arguments), console);
  } catch (const std::exception& error) {
    Complain(console, fmt::format("a mistake in this program: {}; please report it", error.what()));
    return ExitCode::kInternal;
  }
}

}  // namespace tbm
