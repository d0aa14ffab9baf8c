#include "guidance/app/target_input.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "devices/gsi/gsi.h"
#include "devices/gsi/survey_csv.h"
#include "guidance/config/calibration_parts.h"
#include "pose/base/length.h"
#include "pose/rig/rig_sections.h"

namespace tbm {
namespace {

constexpr double kFurthest_mm = 1e5;
constexpr double kFurthestInSite_mm = 1e10;

// One LED's row; faults are collected.
void ReadDrawnLed(const CsvTable& table,
                  std::size_t row,
                  std::vector<Led>* leds,
                  FileFaults* faults) {
  const std::size_t id_column = *table.Column("led");
  Led led;
  led.id = table.Field(row, id_column);
  if (!IsRigName(led.id)) {
    faults->push_back(
        table.FaultAt(row, id_column, Quoted(led.id) + " " + std::string(kRigNameRule)));
  }
  for (const Led& other : *leds) {
    if (other.id != led.id) continue;
    faults->push_back(
        table.FaultAt(row, id_column, Quoted(led.id) + " names two LEDs; each needs its own"));
  }
  for (const auto& [axis, name] :
       {std::pair{0, "x_mm"}, std::pair{1, "y_mm"}, std::pair{2, "z_mm"}}) {
    const std::size_t column = *table.Column(name);
    const auto value_mm = table.Finite(row, column);
    if (!value_mm) {
      faults->push_back(value_mm.error());
    } else if (!(std::abs(*value_mm) <= kFurthest_mm)) {
      faults->push_back(table.FaultAt(
          row, column, fmt::format("{} is outside; allowed is -100000 .. 100000 mm", *value_mm)));
    } else {
      led.p_led_in_target[axis] = *value_mm / kMmPerMetre;
    }
  }
  leds->push_back(std::move(led));
}

std::optional<std::size_t> LedOf(const std::string& point, const std::vector<Led>& leds) {
  for (std::size_t j = 0; j < leds.size(); ++j) {
    if (WithoutLeadingZeros(leds[j].id) == WithoutLeadingZeros(point)) return j;
  }
  return {};
}

std::string Ids(const std::vector<Led>& leds) {
  std::vector<std::string> ids;
  for (const Led& led : leds) ids.push_back(led.id);
  return fmt::format("{}", fmt::join(ids, ", "));
}

}  // namespace

Result<std::vector<Led>, FileFaults> ParseLedDrawing(std::string text, const std::string& file) {
  constexpr std::array<std::string_view, 4> kColumns = {"led", "x_mm", "y_mm", "z_mm"};
  const auto table = CsvTable::Parse(std::move(text), file, kColumns);
  if (!table) return Failure{FileFaults{table.error()}};
  std::vector<Led> leds;
  FileFaults faults;
  const auto count = table->row_count();
  if (count < kMinLeds || count > kMaxLeds) {
    faults.push_back(
        {file, 0, "", fmt::format("has {} LEDs; allowed is {} .. {}", count, kMinLeds, kMaxLeds)});
    return Failure{std::move(faults)};
  }
  for (std::size_t row = 0; row < count; ++row) ReadDrawnLed(*table, row, &leds, &faults);
  if (!faults.empty()) return Failure{std::move(faults)};
  return leds;
}

std::optional<std::vector<Led>> LoadNominalLeds(const std::string& path, const Console& console) {
  if (path.ends_with(".csv")) {
    auto text = ReadTextFile(path, 1 << 20);
    if (!text) {
      Complain(console, text.error().Text());
      return std::nullopt;
    }
    auto leds = ParseLedDrawing(std::move(text).value(), path);
    if (leds) return std::move(leds).value();
    Complain(console, leds.error());
    return std::nullopt;
  }
  auto leds = LoadLeds(path);
  if (leds) return std::move(leds).value();
  for (const RigFileFault& fault : leds.error()) Complain(console, fault.Text());
  return std::nullopt;
}

Result<PlacementPoints, FileFaults> ParsePlacement(std::string text,
                                                   const std::string& file,
                                                   const std::vector<Led>& leds,
                                                   double most_apart_mm) {
  const auto rows = ReadSurvey(std::move(text), file);
  if (!rows) return Failure{FileFaults{rows.error()}};
  PlacementPoints points;
  points.led_in_site_m.resize(leds.size());
  std::vector<const SurveyRow*> first(leds.size(), nullptr);
  std::vector<double> times(leds.size(), 0.0);
  FileFaults faults;
  for (const SurveyRow& row : *rows) {
    const auto led = LedOf(row.point, leds);
    if (!led) {
      points.others.push_back(Quoted(row.point));
      continue;
    }
    const Eigen::Vector3d place_mm(row.x_mm, row.y_mm, row.z_mm);
    if (!(place_mm.cwiseAbs().maxCoeff() <= kFurthestInSite_mm)) {
      faults.push_back(
          {file,
           row.line,
           "point",
           fmt::format("{} lies outside of any map; allowed is -1e10 .. 1e10 mm", leds[*led].id)});
      continue;
    }
    auto& mean_m = points.led_in_site_m[*led];
    if (first[*led] == nullptr) {
      first[*led] = &row;
      mean_m = Eigen::Vector3d::Zero();
    }
    const SurveyRow& before = *first[*led];
    const double apart_mm =
        (place_mm - Eigen::Vector3d(before.x_mm, before.y_mm, before.z_mm)).norm();
    if (!(apart_mm <= most_apart_mm)) {
      faults.push_back({file,
                        row.line,
                        "point",
                        fmt::format("{} is {:.2f} mm from where line {} has it, measuring explains "
                                    "{:.2f}; a placement is one stand of the board, and has a file "
                                    "of its own",
                                    leds[*led].id,
                                    apart_mm,
                                    before.line,
                                    most_apart_mm)});
    }
    times[*led] += 1.0;
    *mean_m += (place_mm / kMmPerMetre - *mean_m) / times[*led];
  }
  if (!faults.empty()) return Failure{std::move(faults)};
  const bool has_any =
      std::any_of(first.begin(), first.end(), [](const SurveyRow* row) { return row != nullptr; });
  if (has_any) return points;
  constexpr std::size_t kMostNames = 12;
  const bool has_more = points.others.size() > kMostNames;
  if (has_more) points.others.resize(kMostNames);
  return Failure{FileFaults{
      {file,
       0,
       "",
       fmt::format(
           "has none of the LEDs {}; its points are {}{}; give them "
           "the LEDs' names",
           Ids(leds),
           points.others.empty() ? "none" : fmt::format("{}", fmt::join(points.others, ", ")),
           has_more ? ", .." : "")}}};
}

}  // namespace tbm
