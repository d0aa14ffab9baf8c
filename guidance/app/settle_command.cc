#include "guidance/app/settle_command.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <optional>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "guidance/app/gnuplot.h"
#include "guidance/app/line_file.h"
#include "guidance/app/output_file.h"
#include "guidance/app/settlement_words.h"

namespace tbm {
namespace {

constexpr int kWidth_px = 1100;
constexpr int kHeight_px = 700;
constexpr double kMostPlaces = 1e6;
constexpr std::array<std::string_view, 4> kAlertWords = {"none", "watch", "alert", "alarm"};

std::optional<std::string> OptionFault(const SettleRequest& request) {
  if (!(request.step_m > 0.0) || !std::isfinite(request.step_m)) {
    return fmt::format("--step {}: must be more than 0 m", request.step_m);
  }
  if (!(request.level > 0.0 && request.level < 1.0)) {
    return fmt::format("--level {}: must lie between 0 and 1, such as 0.95", request.level);
  }
  if (request.later.empty()) return "there is no later line to compare with";
  const std::vector<double>& alert_mm = request.alert_mm;
  if (alert_mm.size() >= kAlertWords.size()) {
    return fmt::format("--alert-mm: has {} numbers; watch, alert and alarm take three at the most",
                       alert_mm.size());
  }
  for (std::size_t i = 0; i < alert_mm.size(); ++i) {
    if (!(alert_mm[i] > (i == 0 ? 0.0 : alert_mm[i - 1])) || !std::isfinite(alert_mm[i])) {
      return fmt::format(
          "--alert-mm: {} stands where more than {} belongs; thresholds grow, such as 1,3,5",
          alert_mm[i],
          i == 0 ? 0.0 : alert_mm[i - 1]);
    }
  }
  return std::nullopt;
}

std::optional<LineFile> Read(const std::string& path, const Console& console) {
  auto line = ReadLineFile(path);
  if (!line) {
    Complain(console, line.error());
    return std::nullopt;
  }
  for (const std::string& warning : line->warnings) Complain(console, "warning: " + warning);
  return std::move(line).value();
}

// Base first, then by time. Empty after a complaint; all files are read before that.
std::vector<LineFile> ReadEpochs(const SettleRequest& request, const Console& console) {
  std::vector<std::string> paths = {request.base};
  paths.insert(paths.end(), request.later.begin(), request.later.end());
  std::vector<LineFile> lines;
  for (const std::string& path : paths) {
    if (auto line = Read(path, console)) lines.push_back(std::move(*line));
  }
  if (lines.size() < paths.size()) return {};
  const auto begins = [](const LineFile& line) { return line.points.front().at; };
  std::stable_sort(lines.begin() + 1, lines.end(), [&](const LineFile& a, const LineFile& b) {
    return begins(a) < begins(b);
  });
  for (std::size_t i = 1; i < lines.size(); ++i) {
    const RailPoint& end = lines[i - 1].points.back();
    if (begins(lines[i]) > end.at) continue;
    Complain(console,
             FileFaults{{lines[i].file,
                         lines[i].line_of_point.front(),
                         "stamp_ns",
                         fmt::format("{} is not after {}, the end of {}; the base must be the "
                                     "earliest, and no run can be two epochs",
                                     begins(lines[i]).ns,
                                     end.at.ns,
                                     lines[i - 1].file)}});
    return {};
  }
  return lines;
}

std::string Header(const Settlement& settlement, bool has_alert) {
  std::string text = "distance_m,dz_mm,sigma_mm,significant";
  if (has_alert) text += ",alert";
  const std::size_t epochs = settlement.epochs.size();
  if (epochs < 2) return text + "\n";
  text += ",trend_mm_per_day,trend_sigma_mm_per_day,trend_significant";
  for (std::size_t i = 1; i <= epochs; ++i) text += fmt::format(",dz_{0}_mm,sigma_{0}_mm", i);
  return text + "\n";
}

std::string Row(const SettlementPlace& place, const SettleRequest& request) {
  std::string text = fmt::format("{:.6f}", place.distance_m);
  const auto& last = place.changes.back();
  if (last) {
    text += fmt::format(
        ",{:.4f},{:.4f},{}", 1e3 * last->dz_m, 1e3 * last->sigma_m, last->is_significant ? 1 : 0);
  } else {
    text += ",,,";
  }
  if (!request.alert_mm.empty()) {
    text += ",";
    if (last) text += kAlertWords[place.alert];
  }
  if (place.changes.size() < 2) return text + "\n";
  if (place.trend) {
    text += fmt::format(",{:.6f},{:.6f},{}",
                        1e3 * place.trend->rate_m_per_day,
                        1e3 * place.trend->sigma_m_per_day,
                        place.trend->is_significant ? 1 : 0);
  } else {
    text += ",,,";
  }
  for (const auto& change : place.changes) {
    text +=
        change ? fmt::format(",{:.4f},{:.4f}", 1e3 * change->dz_m, 1e3 * change->sigma_m) : ",,";
  }
  return text + "\n";
}

std::string Table(const Settlement& settlement, const SettleRequest& request) {
  std::string text = Header(settlement, !request.alert_mm.empty());
  for (const SettlementPlace& place : settlement.places) text += Row(place, request);
  return text;
}

std::string PeakLine(std::string_view what, const SettlementPeak& peak) {
  return fmt::format(
      "  {}; significant from {:.2f} to {:.2f} m\n", PeakText(what, peak), peak.from_m, peak.to_m);
}

std::string EpochText(const EpochSummary& epoch, const LineFile& line, const Settlement& all) {
  std::string text = fmt::format("{}: {} of {} places compared, {} significant\n",
                                 line.file,
                                 epoch.compared,
                                 all.places.size(),
                                 epoch.significant);
  if (epoch.datum) {
    text += fmt::format("  the datum may have moved: {}\n", ShiftText(*epoch.datum));
  }
  if (epoch.settlement) text += PeakLine("settlement", *epoch.settlement);
  if (epoch.heave) text += PeakLine("heave", *epoch.heave);
  if (!epoch.datum && !epoch.settlement && !epoch.heave) {
    text += "  nothing moved that chance would not give somewhere on a line of this length\n";
  }
  if (epoch.trough) {
    const TroughFit& trough = *epoch.trough;
    text += fmt::format(
        "  trough: {:.2f} mm +- {:.2f} deep, centre {:.2f} m +- {:.2f}, width {:.2f} m +- {:.2f}\n",
        1e3 * trough.depth_m,
        1e3 * trough.sigma_depth_m,
        trough.centre_m,
        trough.sigma_centre_m,
        trough.width_m,
        trough.sigma_width_m);
  }
  return text;
}

std::string TrendText(const Settlement& settlement) {
  std::string text;
  const auto add = [&](std::string_view word, const std::optional<TrendPeak>& peak) {
    if (!peak) return;
    text += fmt::format("trend: {} {:.3f} mm a day +- {:.3f} at {:.2f} m\n",
                        word,
                        1e3 * peak->trend.rate_m_per_day,
                        1e3 * peak->trend.sigma_m_per_day,
                        peak->distance_m);
  };
  add("lowest", settlement.sinking);
  add("highest", settlement.rising);
  return text.empty() ? "trend: none that chance would not give\n" : text;
}

std::string AlertText(const Settlement& settlement, const SettleRequest& request) {
  std::string text;
  for (std::size_t i = request.alert_mm.size(); i > 0; --i) {
    const auto count = std::count_if(
        settlement.places.begin(), settlement.places.end(), [&](const SettlementPlace& place) {
          return place.alert == i;
        });
    if (count == 0) continue;
    const auto first = std::find_if(settlement.places.begin(),
                                    settlement.places.end(),
                                    [&](const SettlementPlace& place) { return place.alert == i; });
    text += fmt::format("{}: {} mm or more at {} places, the first at {:.2f} m\n",
                        kAlertWords[i],
                        request.alert_mm[i - 1],
                        count,
                        first->distance_m);
  }
  if (request.alert_mm.empty()) return "";
  if (text.empty()) text = "alert: none\n";
  if (settlement.epochs.back().datum) text += "  counted beside the shift of the whole line\n";
  return text;
}

std::string Summary(const Settlement& settlement,
                    const std::vector<LineFile>& lines,
                    const SettleRequest& request) {
  std::string text = fmt::format(
      "against {}; where nothing moved, {:.3g} % of the places are significant by chance\n",
      lines.front().file,
      100.0 * (1.0 - request.level));
  for (std::size_t i = 0; i < settlement.epochs.size(); ++i) {
    text += EpochText(settlement.epochs[i], lines[i + 1], settlement);
  }
  if (settlement.epochs.size() > 1) text += TrendText(settlement);
  return text + AlertText(settlement, request);
}

bool HasObstacle(const SettleRequest& request, const Console& console) {
  std::vector<std::string> paths = {request.out};
  if (!request.plot.empty()) paths.push_back(request.plot);
  for (const std::string& path : paths) {
    if (const auto obstacle = OutputFile(path, request.force).Obstacle()) {
      Complain(console, *obstacle);
      return true;
    }
  }
  return false;
}

}  // namespace

ExitCode RunSettle(const SettleRequest& request, const Console& console) {
  if (const auto fault = OptionFault(request)) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  if (HasObstacle(request, console)) return ExitCode::kBadInput;
  std::vector<LineFile> lines = ReadEpochs(request, console);
  if (lines.empty()) return ExitCode::kBadInput;
  const double length_m =
      lines.front().points.back().distance_m - lines.front().points.front().distance_m;
  if (!(length_m / request.step_m < kMostPlaces)) {
    Complain(console,
             fmt::format("--step {}: gives more than a million places on {} m of {}",
                         request.step_m,
                         length_m,
                         request.base));
    return ExitCode::kBadInput;
  }
  SettlementOptions options;
  options.step_m = request.step_m;
  options.level = request.level;
  for (const double mm : request.alert_mm) options.alert_m.push_back(1e-3 * mm);
  std::vector<std::vector<RailPoint>> epochs;
  for (LineFile& line : lines) epochs.push_back(std::move(line.points));
  const auto settlement = CompareEpochs(epochs, options);
  if (!settlement) {
    Complain(console, FileFaults{Explain(settlement.error(), lines)});
    return ExitCode::kBadInput;
  }
  const std::string table = Table(*settlement, request);
  std::optional<std::string> fault;
  if (request.out == "-") {
    console.out << table;
  } else {
    fault = OutputFile(request.out, request.force).Write(table);
  }
  if (!fault && !request.plot.empty()) {
    std::vector<std::string> names;
    for (const LineFile& line : lines) {
      names.push_back(std::filesystem::path(line.file).filename().string());
    }
    fault = DrawPicture(SettlePlotScript(*settlement, names, options),
                        kWidth_px,
                        kHeight_px,
                        request.plot,
                        request.force);
  }
  if (fault) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  (request.out == "-" ? console.err : console.out) << Summary(*settlement, lines, request);
  return ExitCode::kDone;
}

}  // namespace tbm
