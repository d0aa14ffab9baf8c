#include "guidance/config/axis_table.h"

#include <array>
#include <optional>

#include <fmt/format.h>

#include "devices/replay/csv.h"

namespace tbm {
namespace {

constexpr std::array<std::string_view, 2> kRequired = {"east_m", "north_m"};
constexpr std::size_t kMostFaults = 200;

AxisFileFault Translated(const FileFault& fault) {
  return {fault.file, fault.line, fault.column.empty() ? "" : "column " + fault.column, fault.what};
}

class TableReader {
 public:
  TableReader(const CsvTable& table, const AxisFileOptions& options)
      : table_(table),
        origin_(options.site_origin),
        east_(*table.Column("east_m")),
        north_(*table.Column("north_m")),
        up_(table.Column("up_m")),
        chainage_(table.Column("chainage_m")) {}

  void Read(AxisDescription* description) {
    for (std::size_t row = 0; row < table_.row_count(); ++row) {
      TablePoint point;
      point.line = table_.line(row);
      point.plan = {Number(row, east_) - origin_.x(), Number(row, north_) - origin_.y()};
      if (up_) point.up_m = Number(row, *up_) - origin_.z();
      if (chainage_) point.chainage_m = Number(row, *chainage_);
      description->table.push_back(point);
    }
    if (description->table.size() >= 2) {
      if (chainage_) description->start = {*description->table.front().chainage_m};
    } else if (faults_.empty()) {
      faults_.push_back(Translated(table_.FaultAt(
          0, east_, fmt::format("has {} points; an axis needs two", table_.row_count()))));
    }
  }

  AxisFileFaults& faults() { return faults_; }

 private:
  double Number(std::size_t row, std::size_t column) {
    const auto number = table_.Finite(row, column);
    if (number) return *number;
    if (faults_.size() < kMostFaults) faults_.push_back(Translated(number.error()));
    return 0.0;
  }

  const CsvTable& table_;
  Eigen::Vector3d origin_;
  std::size_t east_;
  std::size_t north_;
  std::optional<std::size_t> up_;
  std::optional<std::size_t> chainage_;
  AxisFileFaults faults_;
};

// Columns that look like one that is read, in another unit or language of the trade.
void WarnOfColumns(const CsvTable& table, const std::string& file, AxisFileFaults* warnings) {
  for (const std::string& column : table.columns()) {
    if (column == "east_m" || column == "north_m" || column == "up_m" || column == "chainage_m") {
      continue;
    }
    warnings->push_back({file,
                         1,
                         "column " + column,
                         "is read by nobody; known here are east_m, north_m, up_m and chainage_m"});
  }
}

}  // namespace

Result<LoadedAxis, AxisFileFaults> ParseAxisTable(std::string_view text,
                                                  const std::string& file,
                                                  const AxisFileOptions& options) {
  auto parsed = CsvTable::Parse(std::string(text), file, kRequired);
  if (!parsed) return Failure{AxisFileFaults{Translated(parsed.error())}};
  const CsvTable table = std::move(parsed).value();
  if (table.row_count() == 0) {
    return Failure{AxisFileFaults{{file, 1, "", "has no points; an axis needs two"}}};
  }
  LoadedAxis loaded;
  TableReader reader(table, options);
  reader.Read(&loaded.description);
  if (!reader.faults().empty()) return Failure{std::move(reader.faults())};
  WarnOfColumns(table, file, &loaded.warnings);
  return loaded;
}

}  // namespace tbm
