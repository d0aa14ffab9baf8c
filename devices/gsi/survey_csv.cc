#include "devices/gsi/survey_csv.h"

#include <array>

#include <fmt/format.h>

#include "devices/gsi/gsi.h"
#include "pose/base/length.h"

namespace tbm {
namespace {

constexpr std::array<std::string_view, 5> kColumns = {"stamp_ns", "point", "x_mm", "y_mm", "z_mm"};

std::string Field(const std::string& name) {
  if (name.find_first_of(",\"") == std::string::npos) return name;
  std::string quoted = "\"";
  for (const char c : name) {
    if (c == '"') quoted += '"';
    quoted += c;
  }
  return quoted + "\"";
}

Result<std::vector<SurveyRow>, FileFault> ReadGsi(std::string_view text, const std::string& file) {
  const auto blocks = ParseGsi(text, file);
  if (!blocks) return Failure{blocks.error()};
  std::vector<SurveyRow> rows;
  for (const GsiBlock& block : *blocks) {
    const auto point = PointOf(block, file);
    if (!point) return Failure{point.error()};
    if (!*point) continue;
    const GsiPoint& gsi = **point;
    rows.push_back({std::nullopt,
                    gsi.name,
                    gsi.east_m * kMmPerMetre,
                    gsi.north_m * kMmPerMetre,
                    gsi.height_m * kMmPerMetre,
                    block.line});
  }
  return rows;
}

}  // namespace

Result<std::vector<SurveyRow>, FileFault> ReadSurveyCsv(std::string text, const std::string& file) {
  const auto table = CsvTable::Parse(std::move(text), file, kColumns);
  if (!table) return Failure{table.error()};
  std::array<std::size_t, kColumns.size()> at{};
  for (std::size_t i = 0; i < kColumns.size(); ++i) at[i] = *table->Column(kColumns[i]);
  std::vector<SurveyRow> rows;
  rows.reserve(table->row_count());
  for (std::size_t i = 0; i < table->row_count(); ++i) {
    SurveyRow row;
    row.line = table->line(i);
    row.point = table->Field(i, at[1]);
    if (!table->Field(i, at[0]).empty()) {
      const auto ns = table->Integer(i, at[0]);
      if (!ns) return Failure{ns.error()};
      row.at = Timestamp{*ns};
    }
    for (const auto& [column, value] :
         {std::pair{at[2], &row.x_mm}, std::pair{at[3], &row.y_mm}, std::pair{at[4], &row.z_mm}}) {
      const auto number = table->Finite(i, column);
      if (!number) return Failure{number.error()};
      *value = *number;
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

Result<std::vector<SurveyRow>, FileFault> ReadSurvey(std::string text, const std::string& file) {
  return LooksLikeGsi(text) ? ReadGsi(text, file) : ReadSurveyCsv(std::move(text), file);
}

std::string SurveyCsvLine(const SurveyRow& row) {
  return fmt::format("{},{},{:.4f},{:.4f},{:.4f}\n",
                     row.at ? fmt::format("{}", row.at->ns) : std::string(),
                     Field(row.point),
                     row.x_mm,
                     row.y_mm,
                     row.z_mm);
}

}  // namespace tbm
