#include "devices/app/reference_table.h"

#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "devices/replay/csv.h"

namespace tbm {

Result<std::vector<ReferenceRow>, std::string> ReadReferenceTable(const std::string& path) {
  auto text = ReadTextFile(path, 1 << 20);
  if (!text) return Failure{text.error().Text()};
  constexpr std::array<std::string_view, 5> kRequired = {"name", "x_m", "y_m", "z_m", "sigma_mm"};
  const auto table = CsvTable::Parse(*text, path, kRequired);
  if (!table) return Failure{table.error().Text()};
  std::optional<FileFault> fault;
  const auto value = [&](std::size_t row, std::string_view name) {
    const auto column = table->Column(name);
    if (!column) return 0.0;
    const auto number = table->Finite(row, *column);
    if (!number && !fault) fault = number.error();
    return number ? *number : 0.0;
  };
  std::vector<ReferenceRow> rows;
  for (std::size_t i = 0; i < table->row_count(); ++i) {
    ReferenceRow row;
    row.name = table->Field(i, *table->Column("name"));
    row.p_in_site = {value(i, "x_m"), value(i, "y_m"), value(i, "z_m")};
    row.sigma_m = value(i, "sigma_mm") * 1e-3;
    row.constant_m = value(i, "prism_constant_mm") * 1e-3;
    row.is_control = value(i, "control") != 0.0;
    const auto refuse = [&](std::string_view name, std::string what) {
      if (!fault) fault = table->FaultAt(i, *table->Column(name), std::move(what));
    };
    if (!(row.sigma_m >= 0.0 && row.sigma_m <= 0.1)) refuse("sigma_mm", "allowed is 0 .. 100 mm");
    if (!(std::abs(row.constant_m) <= 0.1))
      refuse("prism_constant_mm", "allowed is -100 .. 100 mm");
    if (!(row.p_in_site.cwiseAbs().maxCoeff() <= 1e8)) refuse("x_m", "a coordinate beyond 1e8 m");
    if (row.is_control && value(i, "control") != 1.0) refuse("control", "wanted 0 or 1");
    rows.push_back(row);
  }
  if (fault) return Failure{fault->Text()};
  return rows;
}

}  // namespace tbm
