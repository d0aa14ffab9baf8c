#include "guidance/app/rail_study_command.h"

#include <array>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "guidance/app/output_file.h"
#include "guidance/rail_study/rail_scene.h"
#include "guidance/rail_study/rail_study.h"

namespace tbm {
namespace {

constexpr std::array<std::string_view, 2> kBoards = {"board", "spread"};
// Table 2 of the paper [mm]: what it calls a variance has the size of a deviation.
constexpr std::string_view kPrinted =
    "  the paper, inertial     5.0    4.2    4.8     2.6    2.9    2.8\n"
    "  the paper, fused        0.5    0.4    0.5     0.3    0.3    0.1\n";

struct Row {
  std::string_view board;
  StudiedLine way = StudiedLine::kInertial;
  LineDeviation median;
};

// Empty where a run that was made here could not be solved: our own mistake.
std::optional<std::vector<Row>> Simulate(const RailStudyRequest& request, const Console& console) {
  const auto draws = static_cast<std::size_t>(request.draws);
  Progress progress(console, "running", draws * kBoards.size());
  std::vector<Row> rows;
  for (std::size_t board = 0; board < kBoards.size(); ++board) {
    std::array<std::vector<LineDeviation>, kStudiedLines.size()> runs;
    for (std::size_t draw = 0; draw < draws; ++draw) {
      RailScene scene;
      scene.seed = request.seed + draw;
      scene.has_spread_targets = kBoards[board] == "spread";
      const GeneratedRun run = GenerateRail(scene);
      std::vector<KnownPoint> truth;
      truth.reserve(run.truth.size());
      for (const RailTruth& point : run.truth) truth.push_back({point.at, point.position_world_m});
      for (std::size_t way = 0; way < kStudiedLines.size(); ++way) {
        const auto line = SolveStudiedLine(run.setup, run.recording, kStudiedLines[way]);
        if (!line) return std::nullopt;
        runs[way].push_back(CompareLine(*line, truth));
      }
      progress.Show(board * draws + draw + 1);
    }
    for (std::size_t way = 0; way < kStudiedLines.size(); ++way) {
      rows.push_back({kBoards[board], kStudiedLines[way], MedianOf(runs[way])});
    }
  }
  return rows;
}

std::string CsvText(const std::vector<Row>& rows) {
  std::string text =
      "targets,line,largest_x_mm,largest_y_mm,largest_z_mm,deviation_x_mm,deviation_y_mm,"
      "deviation_z_mm,error_over_sigma\n";
  for (const Row& row : rows) {
    text += fmt::format("{},{}", row.board, Word(row.way));
    for (int i = 0; i < 3; ++i) text += fmt::format(",{:.4f}", 1e3 * row.median.largest_m[i]);
    for (int i = 0; i < 3; ++i) text += fmt::format(",{:.4f}", 1e3 * row.median.deviation_m[i]);
    text += fmt::format(",{:.3f}\n", row.median.error_over_sigma);
  }
  return text;
}

std::string TableText(const std::vector<Row>& rows, const RailStudyRequest& request) {
  std::string text = fmt::format(
      "The curve of the rail-line paper's Table 1 at 0.27 m/s: 200 Hz, 0.2 deg/sqrt(h), 30 "
      "ug/sqrt(Hz), 12 mm lens,\n0.1 px, targets known to 0.03 mm; medians of {} runs, and error "
      "over published sigma (RMS).\n\n"
      "                     largest off [mm]     deviation about the mean [mm]\n"
      "                          x      y      z       x      y      z    error/sigma\n{}",
      request.draws,
      kPrinted);
  std::string_view board;
  for (const Row& row : rows) {
    if (row.board != board) {
      board = row.board;
      text += board == "board" ? "a board of 63 corners 2 to 3 m ahead\n"
                               : "the same, and eight targets to the sides and in depth\n";
    }
    text += fmt::format("  {:<18}", Word(row.way));
    for (int i = 0; i < 3; ++i) text += fmt::format(" {:>6.2f}", 1e3 * row.median.largest_m[i]);
    text += " ";
    for (int i = 0; i < 3; ++i) text += fmt::format(" {:>6.2f}", 1e3 * row.median.deviation_m[i]);
    text += fmt::format(" {:>10.2f}\n", row.median.error_over_sigma);
  }
  return text +
         "\ninertial: after the patent, biases of the rest at the start, closed at the rest at the "
         "end\npaper: its filter; lens, clock and targets taken as exact\nfilter, smoothed: those "
         "of tbm line\n";
}

}  // namespace

ExitCode RunRailStudy(const RailStudyRequest& request, const Console& console) {
  const OutputFile csv(request.out + "/rail_study.csv", request.force);
  const OutputFile table(request.out + "/rail_study.txt", request.force);
  auto fault = MakeFolder(request.out);
  if (!fault) fault = csv.Obstacle();
  if (!fault) fault = table.Obstacle();
  if (fault) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  const auto rows = Simulate(request, console);
  if (!rows) {
    Complain(console, "a simulated run could not be solved");
    return ExitCode::kInternal;
  }
  const std::string text = TableText(*rows, request);
  fault = csv.Write(CsvText(*rows));
  if (!fault) fault = table.Write(text);
  if (fault) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  console.out << text << "\nwritten: " << csv.path() << ", rail_study.txt\n";
  return ExitCode::kDone;
}

}  // namespace tbm
