#include "guidance/app/ground_command.h"

#include <iterator>
#include <map>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "guidance/app/frame_reader.h"
#include "guidance/app/rail_run_for.h"
#include "guidance/app/rail_start_words.h"
#include "guidance/rail/rail_line.h"
#include "guidance/rail_vision/ground_search.h"

namespace tbm {
namespace {

using Json = nlohmann::ordered_json;

std::string Table(const std::vector<GroundStep>& steps) {
  std::string text = "from_ns,to_ns,dx_m,dy_m,sigma_m\n";
  for (const GroundStep& step : steps) {
    if (!step.displacement) continue;
    fmt::format_to(std::back_inserter(text),
                   "{},{},{:.7f},{:.7f},{:.7f}\n",
                   step.from.ns,
                   step.to.ns,
                   step.displacement->told_m.x(),
                   step.displacement->told_m.y(),
                   step.displacement->sigma_m);
  }
  return text;
}

struct Counts {
  std::size_t told = 0;
  double distance_m = 0.0;  // of what was told
  std::map<std::string, std::size_t> why_not;
};

Counts CountsOf(const std::vector<GroundStep>& steps) {
  Counts counts;
  for (const GroundStep& step : steps) {
    if (step.displacement) {
      ++counts.told;
      counts.distance_m += step.displacement->told_m.norm();
    } else {
      ++counts.why_not[step.why_not ? Word(*step.why_not) : "image_or_samples_missing"];
    }
  }
  return counts;
}

Json Report(const std::vector<GroundStep>& steps, const Counts& counts) {
  Json report;
  report["steps"] = steps.size();
  report["told"] = counts.told;
  report["distance_m"] = counts.distance_m;
  Json refused = Json::array();
  for (const GroundStep& step : steps) {
    if (step.displacement) continue;
    refused.push_back({{"from_ns", step.from.ns},
                       {"to_ns", step.to.ns},
                       {"why", step.why_not ? Word(*step.why_not) : "image_or_samples_missing"}});
  }
  report["refused"] = std::move(refused);
  return report;
}

std::string Summary(const std::vector<GroundStep>& steps, const Counts& counts) {
  std::string text = fmt::format("{} steps from image to image, {} told, {:.3f} m together\n",
                                 steps.size(),
                                 counts.told,
                                 counts.distance_m);
  for (const auto& [why, count] : counts.why_not) {
    text += fmt::format("  {:6} not told: {}\n", count, why);
  }
  return text;
}

std::optional<std::string> Missing(const RailRun& run) {
  if (!run.setup.ground) return "rail.yaml: has no section ground_camera";
  if (run.ground_frames.empty()) {
    return "ground_frames.csv: has no images; it needs the columns stamp_ns and file";
  }
  return std::nullopt;
}

// Attitudes are known well enough without what the ground tells.
Result<RailLine, RailStartFailure> LineWithoutGround(const RailRun& run) {
  RailSetup setup = run.setup;
  RailRecording recording = run.recording;
  setup.ground.reset();
  recording.grounds.clear();
  return SolveRailLine(setup, recording, RailMethod::kSmoothed);
}

}  // namespace

ExitCode RunGround(const GroundRequest& request, const Console& console) {
  const TableAndReport files(request.out, request.force);
  const auto run = RailRunFor(request.run, files, console);
  if (!run) return ExitCode::kBadInput;
  if (const auto missing = Missing(*run)) {
    Complain(console, request.run + "/" + *missing);
    return ExitCode::kBadInput;
  }
  const auto line = LineWithoutGround(*run);
  if (!line) {
    Complain(console, request.run + "/" + Explain(line.error(), run->setup));
    return ExitCode::kBadInput;
  }
  FrameReader reader(run->ground_frames, run->setup.ground->model, console);
  Progress progress(console, "images", run->ground_frames.size());
  std::size_t done = 0;
  const auto steps = SearchGround(
      run->setup, *line, reader.Frames(), [&](const GroundStep&) { progress.Show(++done); });
  const Counts counts = CountsOf(steps);
  if (const auto fault = files.Write(Table(steps), Report(steps, counts).dump(2) + "\n")) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  if (files.has_report()) console.out << Summary(steps, counts);
  return ExitCode::kDone;
}

}  // namespace tbm
