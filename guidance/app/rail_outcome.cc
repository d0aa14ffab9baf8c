#include "guidance/app/rail_outcome.h"

#include <exception>
#include <filesystem>
#include <utility>

#include <fmt/format.h>

#include "devices/replay/synced_file.h"
#include "guidance/app/line_command.h"
#include "guidance/app/line_file.h"
#include "guidance/app/settlement_words.h"
#include "guidance/config/sha256.h"
#include "guidance/rail/settlement.h"

namespace tbm {
namespace {

namespace fs = std::filesystem;

// line.csv as a file, and its digest.
struct ReadLine {
  LineFile file;
  std::string sha256;
};

Result<ReadLine, std::string> Read(const std::string& path) {
  auto text = ReadTextFile(path);
  if (!text) return Failure{text.error().Text()};
  std::string sha256 = Sha256(*text);
  auto line = ParseLineFile(std::move(text).value(), path);
  if (!line) return Failure{line.error().front().Text()};
  return ReadLine{std::move(line).value(), std::move(sha256)};
}

// The base's run is named by its folder.
std::string RunOfLine(const std::string& path) {
  std::error_code ignored;
  const fs::path whole = fs::absolute(path, ignored);
  std::string name = whole.parent_path().filename().string();
  return name.empty() ? "base" : name;
}

SettlementOptions OptionsOf(const RailLineConfig& config) {
  SettlementOptions options;
  options.step_m = config.settlement_step_m;
  options.level = config.settlement_level;
  options.alert_m = config.alert_m;
  return options;
}

Result<Settlement, std::string> CompareFiles(const RailLineConfig& config,
                                             const LineFile& base,
                                             const LineFile& later) {
  const std::vector<RailPoint> epochs[] = {base.points, later.points};
  auto settlement = CompareEpochs(epochs, OptionsOf(config));
  if (settlement) return std::move(settlement).value();
  const LineFile files[] = {base, later};
  return Failure{Explain(settlement.error(), files).Text()};
}

void Compare(const RailLineConfig& config,
             const std::string& run,
             const ReadLine& later,
             RailOutcome* outcome) {
  if (config.base_line.empty()) return;
  const auto base = Read(config.base_line);
  if (!base) {
    outcome->no_comparison = base.error();
    return;
  }
  const auto settlement = CompareFiles(config, base->file, later.file);
  if (!settlement) {
    outcome->no_comparison = settlement.error();
    return;
  }
  LineComparison& comparison = outcome->comparison.emplace();
  const FinishedLine base_line{RunOfLine(config.base_line), base->sha256, {}};
  const FinishedLine later_line{run, later.sha256, {}};
  comparison.pieces = PiecesOf(*settlement, base_line, later_line, config.settlement_level);
  if (!comparison.pieces.empty()) {
    comparison.alert = static_cast<std::size_t>(comparison.pieces.front().highest_alert);
  }
  if (const auto& datum = settlement->epochs.back().datum) {
    comparison.datum_alert = SizesReached(datum->dz_m, config.alert_m);
  }
  comparison.told = SentenceOf(*settlement);
}

// Whoever reads it knows the run.
std::string WithoutFolder(std::string text, const std::string& folder) {
  return text.starts_with(folder + "/") ? text.substr(folder.size() + 1) : text;
}

void Make(const RailLineConfig& config,
          const RunFolders& folders,
          const std::string& name,
          RailOutcome* outcome) {
  const auto fails = [&](const std::string& path, const std::error_code& error) {
    outcome->troubles.push_back(fmt::format("{}: {}", path, error.message()));
  };
  const std::string run = folders.RunPath(name);
  const std::string folder = folders.LinePath(name);
  const std::string unborn = folder + std::string(kUnfinished);
  std::error_code error;
  fs::create_directories(unborn, error);
  if (error) return fails(unborn, error);
  const auto made =
      WriteLine({.run = run, .out = unborn + "/line.csv"}, [&](const std::string& warning) {
        outcome->warnings.push_back(WithoutFolder(warning, run));
      });
  if (!made) {
    for (const std::string& why : made.error()) {
      outcome->troubles.push_back(WithoutFolder(why, run));
    }
    fs::remove_all(unborn, error);
    return;
  }
  SyncFolder(unborn);
  fs::rename(unborn, folder, error);
  if (error) return fails(folder, error);
  SyncFolder(folders.lines());
  auto line = Read(folder + "/line.csv");
  if (!line) {
    outcome->troubles.push_back(line.error());
    return;
  }
  outcome->line = FinishedLine{name, line->sha256, line->file.points};
  Compare(config, name, *line, outcome);
}

}  // namespace

RailOutcome MakeOutcome(const RailLineConfig& config,
                        const RunFolders& folders,
                        const std::string& name) {
  RailOutcome outcome;
  try {
    Make(config, folders, name, &outcome);
  } catch (const std::exception& error) {
    // Such as no memory for a very long run: what was measured is still there.
    (outcome.line ? outcome.no_comparison : outcome.troubles.emplace_back()) = error.what();
  }
  return outcome;
}

std::optional<std::string> BaseFault(const RailLineConfig& config) {
  if (config.base_line.empty()) return {};
  const auto base = ReadLineFile(config.base_line);
  if (!base) return base.error().front().Text();
  // Against itself: what is wrong with it alone shows.
  const auto settlement = CompareFiles(config, *base, *base);
  return settlement ? std::optional<std::string>() : settlement.error();
}

}  // namespace tbm
