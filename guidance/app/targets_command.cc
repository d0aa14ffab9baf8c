#include "guidance/app/targets_command.h"

#include <algorithm>
#include <iterator>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "guidance/app/frame_reader.h"
#include "guidance/app/rail_run_for.h"
#include "guidance/app/rail_start_words.h"
#include "guidance/rail_vision/target_search.h"

namespace tbm {
namespace {

using Json = nlohmann::ordered_json;

std::string Table(const RailRun& run, const std::vector<FrameOutcome>& frames) {
  std::string text = "stamp_ns,target,u_px,v_px,sigma_px\n";
  for (const FrameOutcome& frame : frames) {
    for (const TargetSeen& one : frame.targets.seen) {
      fmt::format_to(std::back_inserter(text),
                     "{},{},{:.4f},{:.4f},{:.4f}\n",
                     frame.stamped_at.ns,
                     run.recording.targets[one.target].name,
                     one.pixel_px.x(),
                     one.pixel_px.y(),
                     one.sigma_px);
    }
  }
  return text;
}

struct Counts {
  std::size_t frames = 0;
  std::size_t unreadable = 0;
  std::size_t outside = 0;  // of the samples
  std::size_t seen = 0;
  std::map<std::string_view, std::size_t> refused;
  // By target that has a mark: how often seen, how often outside of the image, and why not seen.
  std::map<std::size_t, std::map<std::string_view, std::size_t>> of_target;
};

Counts CountsOf(const RailRun& run, const std::vector<FrameOutcome>& frames) {
  Counts counts;
  counts.frames = frames.size();
  std::size_t looked_at = 0;
  for (const FrameOutcome& frame : frames) {
    if (!frame.is_in_run) {
      ++counts.outside;
    } else if (!frame.is_readable) {
      ++counts.unreadable;
    } else {
      ++looked_at;
    }
    counts.seen += frame.targets.seen.size();
    for (const TargetSeen& one : frame.targets.seen) ++counts.of_target[one.target]["seen"];
    for (const TargetNotSeen& one : frame.targets.refused) {
      ++counts.refused[Word(one.why)];
      ++counts.of_target[one.target][Word(one.why)];
    }
  }
  for (std::size_t target = 0; target < run.marks.size(); ++target) {
    if (!run.marks[target]) continue;
    auto& words = counts.of_target[target];
    std::size_t told = 0;
    for (const auto& [word, times] : words) told += times;
    words["seen"] += 0;
    if (told < looked_at) words["outside"] = looked_at - told;
  }
  return counts;
}

Json Report(const RailRun& run, const Counts& counts) {
  Json report;
  report["frames"] = counts.frames;
  report["unreadable"] = counts.unreadable;
  report["outside_of_samples"] = counts.outside;
  report["seen"] = counts.seen;
  Json targets = Json::array();
  for (const auto& [target, words] : counts.of_target) {
    Json one{{"target", run.recording.targets[target].name}};
    for (const auto& [word, times] : words) one[std::string(word)] = times;
    targets.push_back(std::move(one));
  }
  report["targets"] = std::move(targets);
  return report;
}

std::string Summary(const Counts& counts) {
  std::string text =
      fmt::format("{} images, {} image points of targets\n", counts.frames, counts.seen);
  if (counts.unreadable > 0) text += fmt::format("  {:6} images unreadable\n", counts.unreadable);
  if (counts.outside > 0) {
    text += fmt::format("  {:6} images where imu.csv has no samples\n", counts.outside);
  }
  for (const auto& [why, count] : counts.refused) {
    text += fmt::format("  {:6} not taken: {}\n", count, why);
  }
  return text;
}

// Why there is nothing to look for, or where.
std::optional<std::string> Missing(const RailRun& run) {
  if (!run.setup.camera) return "rail.yaml: has no section camera";
  if (run.frames.empty()) {
    return "frames.csv: has no images; it needs the columns stamp_ns and file";
  }
  const bool is_any = std::any_of(
      run.marks.begin(), run.marks.end(), [](const auto& mark) { return mark.has_value(); });
  if (!is_any) {
    return "targets.csv: has no column kind, or nothing in it; it says what each target looks "
           "like: led, circle:DIAMETER_MM, coded:NUMBER or board:NAME:COLUMNSxROWS:POINT";
  }
  return std::nullopt;
}

std::string Explain(const SearchFailure& failure, const RailSetup& setup) {
  switch (failure.fault) {
    case SearchFault::kStart:
      return Explain(failure.start, setup);
    case SearchFault::kNoHeading:
      return "rail.yaml: the heading is not known, and no image of the rest at the start shows a "
             "coded target or a board: give start.heading_deg, sigma_heading_deg and "
             "heading_known: true";
  }
  return "";
}

}  // namespace

ExitCode RunTargets(const TargetsRequest& request, const Console& console) {
  const TableAndReport files(request.out, request.force);
  const auto run = RailRunFor(request.run, files, console);
  if (!run) return ExitCode::kBadInput;
  if (const auto missing = Missing(*run)) {
    Complain(console, request.run + "/" + *missing);
    return ExitCode::kBadInput;
  }
  FrameReader reader(run->frames, run->setup.camera->model, console);
  Progress progress(console, "images", run->frames.size());
  std::size_t done = 0;
  const auto frames = SearchTargets(
      run->setup, run->recording, run->marks, reader.Frames(), [&](const FrameOutcome&) {
        progress.Show(++done);
      });
  if (!frames) {
    Complain(console, request.run + "/" + Explain(frames.error(), run->setup));
    return ExitCode::kBadInput;
  }
  const Counts counts = CountsOf(*run, *frames);
  if (const auto fault = files.Write(Table(*run, *frames), Report(*run, counts).dump(2) + "\n")) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  if (files.has_report()) console.out << Summary(counts);
  return ExitCode::kDone;
}

}  // namespace tbm
