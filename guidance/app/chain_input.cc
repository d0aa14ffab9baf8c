#include "guidance/app/chain_input.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>

#include <Eigen/LU>
#include <fmt/format.h>

#include "devices/gsi/gsi.h"
#include "devices/gsi/survey_csv.h"
#include "devices/replay/csv.h"
#include "guidance/app/journal_files.h"
#include "guidance/app/journal_reading.h"
#include "guidance/journal/mcap_reader.h"
#include "idl/cpp/codec.h"
#include "idl/cpp/topics.h"

namespace tbm {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kStampColumn = "valid_at_utc_ns";
constexpr std::string_view kEastColumn = "_position_in_site_east_m";

// The design where the machine is: its direction in plan and its gradient, from the two points that
// are furthest from each other along it. Empty for points closer together than a metre.
struct DesignHere {
  Eigen::Vector3d along;  // unit length, horizontal
  double gradient = 0.0;
};
std::optional<DesignHere> DesignAround(const dds::Guidance& message) {
  const dds::GuidedPoint* first = nullptr;
  const dds::GuidedPoint* last = nullptr;
  for (const dds::GuidedPoint& point : message.points) {
    if (point.validity == dds::Validity::kInvalid || !point.position_in_site_m.allFinite() ||
        !std::isfinite(point.chainage_m) || !std::isfinite(point.deviation_right_m)) {
      continue;
    }
    if (!first || point.chainage_m < first->chainage_m) first = &point;
    if (!last || point.chainage_m > last->chainage_m) last = &point;
  }
  if (!first || last->chainage_m - first->chainage_m < 1.0) return std::nullopt;
  const double forward_m = last->chainage_m - first->chainage_m;
  const double right_m = last->deviation_right_m - first->deviation_right_m;
  const Eigen::Vector3d way = last->position_in_site_m - first->position_in_site_m;
  // The way leads to the right of the design by this much; the design lies to the left of it.
  const double turned_rad = std::atan2(right_m, forward_m);
  const double bearing_rad = std::atan2(way.x(), way.y()) - turned_rad;
  double up_m = way.z();
  if (std::isfinite(last->deviation_up_m) && std::isfinite(first->deviation_up_m)) {
    up_m -= last->deviation_up_m - first->deviation_up_m;
  }
  return DesignHere{{std::sin(bearing_rad), std::cos(bearing_rad), 0.0}, up_m / forward_m};
}

// Empty when the message does not give enough.
std::optional<Eigen::Matrix3d> CovarianceOf(const dds::GuidedPoint& point,
                                            const std::optional<DesignHere>& design) {
  const double along_m = point.chainage_sigma_m;
  const double right_m = point.deviation_right_sigma_m;
  const double up_m = point.deviation_up_sigma_m;
  if (design && along_m > 0.0 && right_m > 0.0 && up_m > 0.0 &&
      std::isfinite(along_m + right_m + up_m)) {
    const double rho = std::isfinite(point.right_up_correlation) ? point.right_up_correlation : 0.0;
    Eigen::Matrix3d in_axis;
    in_axis << along_m * along_m, 0.0, 0.0, 0.0, right_m * right_m, rho * right_m * up_m, 0.0,
        rho * right_m * up_m, up_m * up_m;
    // Deviation upward is against the gradient line at the point's own chainage.
    Eigen::Matrix3d axis_from_site;
    const Eigen::Vector3d& along = design->along;
    axis_from_site << along.transpose(), along.y(), -along.x(), 0.0, -design->gradient * along.x(),
        -design->gradient * along.y(), 1.0;
    const Eigen::Matrix3d site_from_axis = axis_from_site.inverse();
    return site_from_axis * in_axis * site_from_axis.transpose();
  }
  const double sigma_m = point.position_sigma_m;
  if (!(sigma_m > 0.0) || !std::isfinite(sigma_m)) return std::nullopt;
  return sigma_m * sigma_m / 3.0 * Eigen::Matrix3d::Identity();
}

// Tracks are kept in order of time; of two samples of one moment the first stays.
void PutInOrder(GuidedRecord* record) {
  for (auto& [name, track] : record->tracks) {
    std::stable_sort(
        track.begin(), track.end(), [](const auto& a, const auto& b) { return a.at < b.at; });
    const auto same = std::unique(
        track.begin(), track.end(), [](const auto& a, const auto& b) { return a.at == b.at; });
    track.erase(same, track.end());
  }
}

std::string FirstBytes(const std::string& path, std::size_t count) {
  std::ifstream file(path, std::ios::binary);
  std::string bytes(count, '\0');
  file.read(bytes.data(), static_cast<std::streamsize>(count));
  bytes.resize(static_cast<std::size_t>(std::max<std::streamsize>(0, file.gcount())));
  return bytes;
}

bool IsJournal(const std::string& path) {
  const std::string bytes = FirstBytes(path, mcap::kMagic.size());
  return bytes.size() == mcap::kMagic.size() &&
         std::equal(bytes.begin(), bytes.end(), mcap::kMagic.begin(), [](char a, auto b) {
           return static_cast<unsigned char>(a) == static_cast<unsigned char>(b);
         });
}

std::optional<std::string> OneMachine(const std::string& file,
                                      std::string_view machine_id,
                                      GuidedRecord* record) {
  if (record->machine_id.empty()) record->machine_id = machine_id;
  if (record->machine_id == machine_id) return std::nullopt;
  return fmt::format("{}: holds the machines {} and {}; export one of them to a CSV",
                     file,
                     Quoted(record->machine_id),
                     Quoted(machine_id));
}

std::optional<std::string> AddJournal(const std::string& path, GuidedRecord* record) {
  const auto bytes = ReadJournalBytes(path);
  if (!bytes) return bytes.error();
  std::optional<std::string> fault;
  std::size_t refused = 0;
  const auto content =
      ReadMcap(*bytes, [&](const McapChannel& channel, const McapMessage& message) {
        if (channel.topic != dds::kGuidanceTopic.name || fault) return;
        dds::Guidance guidance;
        if (dds::DecodeCdr(message.data, &guidance) != dds::BoundaryFault::kNone) {
          ++refused;
          return;
        }
        fault = OneMachine(path, guidance.machine_id, record);
        if (!fault) AddGuidance(guidance, record);
      });
  if (!content) return NoJournalText(path, *bytes);
  if (fault) return fault;
  if (refused > 0) {
    record->remarks.push_back(
        fmt::format("{}: {} samples of guidance cannot be read and are left out", path, refused));
  }
  if (!IsOnlyCut(*content)) {
    record->remarks.push_back(path + ": damaged: what is whole is used; see tbm repair");
  }
  return std::nullopt;
}

// A cell that may be empty: what is nothing.
Result<double, FileFault> Cell(const CsvTable& table, std::size_t row, const std::string& name) {
  const auto column = table.Column(name);
  if (!column || table.Field(row, *column).empty()) return std::numeric_limits<double>::quiet_NaN();
  return table.Finite(row, *column);
}

// The fields of a point that are needed here.
Result<dds::GuidedPoint, FileFault> PointOfRow(const CsvTable& table,
                                               std::size_t row,
                                               const std::string& name) {
  dds::GuidedPoint point;
  point.name = std::string_view(name);
  const auto validity = table.Column(name + "_validity");
  const std::string_view word = validity ? table.Field(row, *validity) : "";
  if (word == "valid" || word == "degraded") {
    point.validity = word == "valid" ? dds::Validity::kValid : dds::Validity::kDegraded;
  } else if (!word.empty() && word != "invalid") {
    return Failure{
        table.FaultAt(row, *validity, Quoted(word) + " must be valid, degraded or invalid")};
  }
  const std::pair<const char*, double*> fields[] = {
      {"_position_in_site_east_m", &point.position_in_site_m.x()},
      {"_position_in_site_north_m", &point.position_in_site_m.y()},
      {"_position_in_site_up_m", &point.position_in_site_m.z()},
      {"_position_sigma_m", &point.position_sigma_m},
      {"_chainage_m", &point.chainage_m},
      {"_chainage_sigma_m", &point.chainage_sigma_m},
      {"_deviation_right_m", &point.deviation_right_m},
      {"_deviation_up_m", &point.deviation_up_m},
      {"_deviation_right_sigma_m", &point.deviation_right_sigma_m},
      {"_deviation_up_sigma_m", &point.deviation_up_sigma_m},
      {"_right_up_correlation", &point.right_up_correlation},
  };
  for (const auto& [ending, value] : fields) {
    const auto number = Cell(table, row, name + ending);
    if (!number) return Failure{number.error()};
    *value = *number;
  }
  return point;
}

}  // namespace

void AddGuidance(const dds::Guidance& message, GuidedRecord* record) {
  ++record->messages;
  const auto design = DesignAround(message);
  for (const dds::GuidedPoint& point : message.points) {
    GuidedSample sample;
    sample.at = message.valid_at;
    const auto covariance = CovarianceOf(point, design);
    sample.is_valid = point.validity != dds::Validity::kInvalid &&
                      point.position_in_site_m.allFinite() && covariance.has_value();
    if (sample.is_valid) {
      sample.p_in_site_m = point.position_in_site_m;
      sample.covariance_m2 = *covariance;
    }
    record->tracks[std::string(point.name)].push_back(sample);
  }
}

bool IsGuidanceRecord(const std::string& path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) return !JournalFilesIn(path).empty();
  if (path.ends_with(".mcap") || IsJournal(path)) return true;
  const std::string begin = FirstBytes(path, 65536);
  const std::string header = begin.substr(0, begin.find('\n'));
  return header.find(kStampColumn) != std::string::npos &&
         header.find(kEastColumn) != std::string::npos;
}

Result<GuidedRecord, std::string> ParseGuidanceCsv(std::string text, const std::string& file) {
  const std::array<std::string_view, 1> required = {kStampColumn};
  const auto table = CsvTable::Parse(std::move(text), file, required);
  if (!table) return Failure{table.error().Text()};
  std::vector<std::string> names;
  for (const std::string& column : table->columns()) {
    if (column.ends_with(kEastColumn)) {
      names.push_back(column.substr(0, column.size() - kEastColumn.size()));
    }
  }
  if (names.empty() || names.size() > dds::kMaxPoints) {
    return Failure{
        fmt::format("{}: has no columns NAME{}: not what tbm export writes of the topic "
                    "guidance",
                    file,
                    kEastColumn)};
  }
  GuidedRecord record;
  const auto machine_column = table->Column("machine_id");
  for (std::size_t row = 0; row < table->row_count(); ++row) {
    const auto stamp = table->Integer(row, *table->Column(kStampColumn));
    if (!stamp) return Failure{stamp.error().Text()};
    if (machine_column) {
      const auto fault = OneMachine(file, table->Field(row, *machine_column), &record);
      if (fault) return Failure{*fault};
    }
    dds::Guidance message;
    message.valid_at = Timestamp{*stamp};
    for (const std::string& name : names) {
      const auto point = PointOfRow(*table, row, name);
      if (!point) return Failure{point.error().Text()};
      message.points.push_back(*point);
    }
    AddGuidance(message, &record);
  }
  PutInOrder(&record);
  return record;
}

Result<GuidedRecord, std::string> ReadGuidanceRecord(const std::string& path) {
  GuidedRecord record;
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) {
    for (const JournalFile& file : JournalFilesIn(path)) {
      if (auto fault = AddJournal(file.path, &record)) return Failure{std::move(*fault)};
    }
  } else if (path.ends_with(".mcap") || IsJournal(path)) {
    if (auto fault = AddJournal(path, &record)) return Failure{std::move(*fault)};
  } else {
    auto text = ReadTextFile(path);
    if (!text) return Failure{text.error().Text()};
    return ParseGuidanceCsv(std::move(text).value(), path);
  }
  if (record.messages == 0) {
    return Failure{fmt::format("{}: holds no sample of {}", path, dds::kGuidanceTopic.name)};
  }
  PutInOrder(&record);
  return record;
}

Result<std::vector<MachineShot>, std::string> ReadShots(const std::string& path,
                                                        std::optional<Timestamp> at) {
  auto text = ReadTextFile(path);
  if (!text) return Failure{text.error().Text()};
  constexpr std::string_view kNoTime =
      "has no time; where the machine stood still, --at gives the time of all such shots";
  std::vector<MachineShot> shots;
  if (LooksLikeGsi(*text)) {
    const auto blocks = ParseGsi(*text, path);
    if (!blocks) return Failure{blocks.error().Text()};
    for (const GsiBlock& block : *blocks) {
      const auto point = PointOf(block, path);
      if (!point) return Failure{point.error().Text()};
      if (!*point) continue;
      if (!at) return Failure{FileFault{path, block.line, "", std::string(kNoTime)}.Text()};
      const GsiPoint& gsi = **point;
      shots.push_back({*at, gsi.name, {gsi.east_m, gsi.north_m, gsi.height_m}});
    }
    return shots;
  }
  const auto rows = ReadSurveyCsv(std::move(text).value(), path);
  if (!rows) return Failure{rows.error().Text()};
  for (const SurveyRow& row : *rows) {
    if (!row.at && !at) {
      return Failure{FileFault{path, row.line, "stamp_ns", std::string(kNoTime)}.Text()};
    }
    shots.push_back({row.at.value_or(at.value_or(Timestamp{})),
                     row.point,
                     {1e-3 * row.x_mm, 1e-3 * row.y_mm, 1e-3 * row.z_mm}});
  }
  return shots;
}

}  // namespace tbm
