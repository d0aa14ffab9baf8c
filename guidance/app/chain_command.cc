#include "guidance/app/chain_command.h"

#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "devices/gsi/gsi.h"
#include "guidance/app/chain_check.h"
#include "guidance/app/chain_input.h"
#include "guidance/app/chain_report.h"
#include "guidance/app/journal_reading.h"

namespace tbm {
namespace {

struct Input {
  GuidedRecord record;
  std::vector<MachineShot> shots;  // at points that the record has, by its names
  std::size_t other_points = 0;
};

// Shots at the wanted point, or at every point that guidance knows, under guidance's names.
Result<Input, std::string> Choose(GuidedRecord record,
                                  std::vector<MachineShot> shots,
                                  const CheckRequest& request) {
  std::set<std::string> known;
  for (const auto& [name, track] : record.tracks) known.insert(name);
  if (!request.point.empty() && known.count(request.point) == 0) {
    return Failure{fmt::format("{}: has no point {}; it has {}",
                               request.poses,
                               Quoted(request.point),
                               fmt::join(known, ", "))};
  }
  const std::string& wanted = request.log_point.empty() ? request.point : request.log_point;
  Input input;
  std::set<std::string> seen;
  for (MachineShot& shot : shots) {
    seen.insert(Quoted(shot.point));
    std::string name;
    if (!request.point.empty()) {
      if (WithoutLeadingZeros(shot.point) == WithoutLeadingZeros(wanted)) name = request.point;
    } else if (known.count(shot.point) > 0) {
      name = shot.point;
    }
    if (name.empty()) {
      ++input.other_points;
      continue;
    }
    shot.point = name;
    input.shots.push_back(std::move(shot));
  }
  if (input.shots.empty()) {
    return Failure{fmt::format(
        "{}: has no shot at {}; it has {}{}",
        request.log,
        request.point.empty() ? fmt::format("any of {}", fmt::join(known, ", ")) : Quoted(wanted),
        seen.empty() ? "none" : fmt::format("{}", fmt::join(seen, ", ")),
        request.log_point.empty() ? "; --point with --log-point gives the name it has in the log"
                                  : "")};
  }
  input.record = std::move(record);
  return input;
}

Result<Input, std::string> ReadInput(const CheckRequest& request, const Console& console) {
  std::optional<Timestamp> at;
  if (!request.at.empty()) {
    at = UtcFromText(request.at);
    if (!at) {
      return Failure{fmt::format(
          "--at {} is no time: wanted is one such as 2026-11-23T14:05:00Z, or nanoseconds since "
          "1970",
          Quoted(request.at))};
    }
  }
  auto record = ReadGuidanceRecord(request.poses);
  if (!record) return Failure{record.error()};
  for (const std::string& remark : record->remarks) Complain(console, remark);
  auto shots = ReadShots(request.log, at);
  if (!shots) return Failure{shots.error()};
  return Choose(std::move(record).value(), std::move(shots).value(), request);
}

ClockFinding FindClock(const Input& input,
                       const CheckRequest& request,
                       const ChainOptions& options) {
  ClockFinding finding;
  const auto estimate = EstimateClock(input.record.tracks, input.shots, options);
  if (!estimate) {
    switch (estimate.error()) {
      case NoClockEstimate::kTooFewShots:
        finding.why_not = "fewer than three shots have published samples around them";
        break;
      case NoClockEstimate::kMovedTooLittle:
        finding.why_not = "the machine moved too little while it was shot at";
        break;
      case NoClockEstimate::kOtherFault:
        finding.why_not = "more than a fifth of the shots contradict the rest whatever the clock";
        break;
    }
    return finding;
  }
  finding.estimate = *estimate;
  finding.is_applied =
      request.clock == "estimate" || (request.clock == "auto" && estimate->is_significant);
  return finding;
}

ExitCode Refuse(const Console& console, const std::string& why) {
  Complain(console, why);
  return ExitCode::kBadInput;
}

}  // namespace

ExitCode RunChainCheck(const CheckRequest& request, const Console& console) {
  if (request.align_rigid) {
    return Refuse(console,
                  "--align rigid is for poses in the camera's frame; guidance and the shots are "
                  "both in site");
  }
  if (const auto fault = ReportObstacle(request)) return Refuse(console, *fault);
  const auto input = ReadInput(request, console);
  if (!input) return Refuse(console, input.error());
  if (input->other_points > 0) {
    Complain(console,
             fmt::format(
                 "{}: {} shots at other points are passed over", request.log, input->other_points));
  }
  ChainOptions options;
  options.most_gap = Duration(static_cast<std::int64_t>(std::llround(request.tolerance_ms * 1e6)));
  options.log_sigma_m = 1e-3 * request.log_sigma_mm;
  options.clock_range_s = request.clock_range_s;
  const ClockFinding clock = FindClock(*input, request, options);
  ChainPairs pairs = PairShots(input->record.tracks,
                               input->shots,
                               clock.is_applied ? clock.estimate->ahead_s : 0.0,
                               clock.is_applied ? clock.estimate->sigma_s : 0.0,
                               options);
  if (pairs.observations.empty()) {
    return Refuse(console,
                  fmt::format("no shot has published samples on both sides of it, {} ms apart or "
                              "less ({} while guidance said that it knows nothing, {} without any "
                              "around them); do both clocks run on UTC?",
                              request.tolerance_ms,
                              pairs.without_pose,
                              pairs.without_partner));
  }
  ChainFigures figures = FiguresOf(std::move(pairs));
  figures.clock = clock;
  figures.other_points = input->other_points;
  console.out << ChainText(figures, request);
  if (request.report.empty()) return ExitCode::kDone;
  return WriteReport(
      {ChainCsv(figures), ChainJson(figures, request), ChainPlot(figures), 1100}, request, console);
}

}  // namespace tbm
