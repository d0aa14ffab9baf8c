#include "guidance/app/line_file.h"

#include <array>
#include <cmath>
#include <optional>
#include <string_view>

#include <fmt/format.h>

namespace tbm {
namespace {

constexpr std::array<std::string_view, 13> kColumns = {"stamp_ns",
                                                       "distance_m",
                                                       "x_m",
                                                       "y_m",
                                                       "z_m",
                                                       "qw",
                                                       "qx",
                                                       "qy",
                                                       "qz",
                                                       "sigma_x_mm",
                                                       "sigma_y_mm",
                                                       "sigma_z_mm",
                                                       "status"};
constexpr std::size_t kDistance = 1;
constexpr std::size_t kPosition = 2;
constexpr std::size_t kAttitude = 5;
constexpr std::size_t kSigma = 9;
constexpr std::size_t kStatus = 12;
constexpr std::size_t kMostFaults = 20;
// Beyond stands no rail on earth, and double has no thousandth of a millimetre left.
constexpr double kFurthest_m = 1e8;
constexpr double kUnitLength = 1e-3;

std::optional<RailStatus> StatusOf(std::string_view word) {
  for (const RailStatus status :
       {RailStatus::kFixed, RailStatus::kBridged, RailStatus::kOpen, RailStatus::kGap}) {
    if (Word(status) == word) return status;
  }
  return std::nullopt;
}

class LineReader {
 public:
  LineReader(const CsvTable& table, LineFile* line) : table_(table), line_(line) {
    for (std::size_t i = 0; i < kColumns.size(); ++i) columns_[i] = *table.Column(kColumns[i]);
  }

  FileFaults Read() {
    for (std::size_t row = 0; row < table_.row_count() && faults_.size() < kMostFaults; ++row) {
      RailPoint point;
      if (!ReadPoint(row, &point)) continue;
      CheckOrder(row, point);
      line_->points.push_back(point);
      line_->line_of_point.push_back(table_.line(row));
    }
    return std::move(faults_);
  }

 private:
  // Each of these: false after a fault.
  bool Fault(FileFault fault) {
    faults_.push_back(std::move(fault));
    return false;
  }
  bool Fault(std::size_t row, std::size_t column, std::string what) {
    return Fault(table_.FaultAt(row, columns_[column], std::move(what)));
  }
  bool Number(std::size_t row, std::size_t column, double* number) {
    const auto read = table_.Finite(row, columns_[column]);
    if (!read) return Fault(read.error());
    *number = *read;
    return true;
  }

  bool ReadPoint(std::size_t row, RailPoint* point) {
    const auto stamp = table_.Integer(row, columns_[0]);
    if (!stamp) return Fault(stamp.error());
    point->at = {*stamp};
    return Number(row, kDistance, &point->distance_m) && ReadPosition(row, point) &&
           ReadAttitude(row, point) && ReadSigma(row, point) && ReadStatus(row, point);
  }

  bool ReadPosition(std::size_t row, RailPoint* point) {
    for (std::size_t i = 0; i < 3; ++i) {
      double& coordinate = point->position_world_m[static_cast<Eigen::Index>(i)];
      if (!Number(row, kPosition + i, &coordinate)) return false;
      if (std::abs(coordinate) > kFurthest_m) {
        return Fault(row, kPosition + i, "is no place on earth; write metres");
      }
    }
    return true;
  }

  bool ReadAttitude(std::size_t row, RailPoint* point) {
    std::array<double, 4> q{};
    for (std::size_t i = 0; i < 4; ++i) {
      if (!Number(row, kAttitude + i, &q[i])) return false;
    }
    point->world_from_imu = Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
    const double norm = point->world_from_imu.norm();
    if (std::abs(norm - 1.0) > kUnitLength) {
      return Fault(
          row, kAttitude, fmt::format("qw,qx,qy,qz have the length {:.4g}; it must be 1", norm));
    }
    point->world_from_imu.normalize();
    return true;
  }

  bool ReadSigma(std::size_t row, RailPoint* point) {
    for (std::size_t i = 0; i < 3; ++i) {
      double sigma_mm = 0.0;
      if (!Number(row, kSigma + i, &sigma_mm)) return false;
      if (!(sigma_mm > 0.0)) {
        return Fault(row, kSigma + i, "must be more than 0: nothing is known without an error");
      }
      point->sigma_world_m[static_cast<Eigen::Index>(i)] = 1e-3 * sigma_mm;
    }
    return true;
  }

  bool ReadStatus(std::size_t row, RailPoint* point) {
    const std::string_view word = table_.Field(row, columns_[kStatus]);
    const auto status = StatusOf(word);
    if (!status) {
      return Fault(row, kStatus, Quoted(word) + " is none of fixed, bridged, open, gap");
    }
    point->status = *status;
    return true;
  }

  // Against the row before, also where that one is wrong: one bad row gives one fault.
  bool CheckOrder(std::size_t row, const RailPoint& point) {
    if (line_->points.empty()) return true;
    const RailPoint& before = line_->points.back();
    if (point.at <= before.at) {
      return Fault(row,
                   0,
                   fmt::format("{} does not come after {} of line {}; rows must be in the order of "
                               "time",
                               point.at.ns,
                               before.at.ns,
                               line_->line_of_point.back()));
    }
    if (point.distance_m < before.distance_m) {
      return Fault(row,
                   kDistance,
                   fmt::format("{} is less than {} of line {}; the distance run only grows",
                               point.distance_m,
                               before.distance_m,
                               line_->line_of_point.back()));
    }
    return true;
  }

  const CsvTable& table_;
  LineFile* line_;
  std::array<std::size_t, kColumns.size()> columns_{};
  FileFaults faults_;
};

}  // namespace

Result<LineFile, FileFaults> ReadLineFile(const std::string& path) {
  auto text = ReadTextFile(path);
  if (!text) return Failure{FileFaults{text.error()}};
  return ParseLineFile(std::move(text).value(), path);
}

Result<LineFile, FileFaults> ParseLineFile(std::string text, const std::string& path) {
  auto parsed = CsvTable::Parse(std::move(text), path, kColumns);
  if (!parsed) return Failure{FileFaults{parsed.error()}};
  CsvTable table = std::move(parsed).value();
  LineFile line;
  line.file = path;
  if (table.last_line_is_open() && table.row_count() > 0) {
    line.warnings.push_back(path + ": the last line is cut short and passed over");
    table.DropLastRow();
  }
  FileFaults faults = LineReader(table, &line).Read();
  if (!faults.empty()) return Failure{std::move(faults)};
  if (line.points.size() < 2) {
    return Failure{FileFaults{{path, 0, "", "has fewer than two rows; a line needs two"}}};
  }
  return line;
}

}  // namespace tbm
