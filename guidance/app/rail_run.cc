#include "guidance/app/rail_run.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <initializer_list>
#include <map>
#include <set>

#include <fmt/format.h>

#include "guidance/config/rail_file.h"
#include "pose/base/angle.h"

namespace tbm {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 7> kImuColumns = {"stamp_ns",
                                                         "gyro_x_rad_s",
                                                         "gyro_y_rad_s",
                                                         "gyro_z_rad_s",
                                                         "accel_x_m_s2",
                                                         "accel_y_m_s2",
                                                         "accel_z_m_s2"};
constexpr std::array<std::string_view, 4> kTiltColumns = {
    "stamp_ns", "sensor", "beta_deg", "gamma_deg"};
constexpr std::array<std::string_view, 4> kCentreColumns = {"stamp_ns", "target", "u_px", "v_px"};
constexpr std::array<std::string_view, 5> kTargetColumns = {
    "target", "x_m", "y_m", "z_m", "sigma_mm"};
constexpr std::array<std::string_view, 8> kTruthColumns = {
    "stamp_ns", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz"};
constexpr std::array<std::string_view, 2> kFrameColumns = {"stamp_ns", "file"};
constexpr std::array<std::string_view, 5> kGroundColumns = {
    "from_ns", "to_ns", "dx_m", "dy_m", "sigma_m"};
constexpr std::array<std::string_view, 2> kOdometerColumns = {"stamp_ns", "distance_m"};

constexpr std::string_view kTiltSensor = "trolley";
// Noise never shows one number so often on end.
constexpr std::size_t kFrozenRows = 12;
constexpr std::size_t kMostFaults = 20;
constexpr double kUnitLength = 1e-3;
constexpr std::size_t kLargestYaml = std::size_t{1} << 20;
constexpr std::size_t kLargestTable = std::size_t{1} << 30;

class RailRunLoader {
 public:
  RailRunLoader(const std::string& folder, RailRunTexts texts)
      : folder_(folder), texts_(std::move(texts)) {}

  Result<RailRun, FileFaults> LoadBeforeRun() {
    LoadSetup();
    LoadTargets();
    return Whole();
  }
  Result<RailRun, FileFaults> Load() {
    LoadSetup();
    LoadImu();
    LoadTilts();
    LoadTargets();
    LoadCentres();
    LoadFrames("frames.csv", &run_.frames);
    LoadFrames("ground_frames.csv", &run_.ground_frames);
    LoadOdometer();
    LoadGrounds();
    LoadTruth();
    WarnOfUnused();
    return Whole();
  }

 private:
  Result<RailRun, FileFaults> Whole() {
    if (!faults_.empty()) return Failure{std::move(faults_)};
    return std::move(run_);
  }
  std::string PathOf(std::string_view name) const {
    return (fs::path(folder_) / fs::path(std::string(name))).string();
  }
  bool Has(std::string_view name) const { return texts_.contains(name); }
  bool Fault(FileFault fault) {
    if (faults_.size() < kMostFaults) faults_.push_back(std::move(fault));
    return false;
  }

  void LoadSetup() {
    auto setup = ParseRailSetup(texts_["rail.yaml"], PathOf("rail.yaml"));
    if (setup) {
      run_.setup = std::move(setup).value();
      return;
    }
    for (const RigFileFault& fault : setup.error()) {
      Fault({fault.file,
             fault.line,
             "",
             fault.key.empty() ? fault.what : fault.key + ": " + fault.what});
    }
  }

  std::optional<CsvTable> Table(std::string_view name, std::span<const std::string_view> columns) {
    auto table = CsvTable::Parse(std::move(texts_[std::string(name)]), PathOf(name), columns);
    if (!table) {
      Fault(table.error());
      return {};
    }
    CsvTable whole = std::move(table).value();
    if (whole.last_line_is_open() && whole.row_count() > 0) {
      run_.warnings.push_back(
          fmt::format("{}: the last line is cut short and passed over", PathOf(name)));
      whole.DropLastRow();
    }
    return whole;
  }

  // A row's stamp, later than the one before (or the same, where a stamp has several rows).
  bool Stamp(const CsvTable& table,
             std::size_t row,
             bool may_repeat,
             std::optional<Timestamp>* last,
             Timestamp* at) {
    const std::size_t column = *table.Column("stamp_ns");
    const auto stamp = table.Integer(row, column);
    if (!stamp) return Fault(stamp.error());
    *at = {*stamp};
    if (*last && (at->ns < (*last)->ns || (!may_repeat && at->ns == (*last)->ns))) {
      return Fault(table.FaultAt(
          row,
          column,
          fmt::format("{} is {} the row before ({}); rows must stand in the order of time",
                      at->ns,
                      at->ns == (*last)->ns ? "the stamp of" : "earlier than",
                      (*last)->ns)));
    }
    *last = *at;
    return true;
  }

  bool Number(const CsvTable& table, std::size_t row, std::string_view name, double* value) {
    const auto number = table.Finite(row, *table.Column(name));
    if (!number) return Fault(number.error());
    *value = *number;
    return true;
  }

  template <std::size_t kCount>
  bool Numbers(const CsvTable& table,
               std::size_t row,
               const std::array<std::string_view, kCount>& names,
               std::size_t first,
               double* values) {
    for (std::size_t i = first; i < kCount; ++i) {
      if (!Number(table, row, names[i], &values[i - first])) return false;
    }
    return true;
  }

  void LoadImu() {
    const auto table = Table("imu.csv", kImuColumns);
    if (!table) return;
    if (table->row_count() < 2) {
      Fault({PathOf("imu.csv"), 0, "", "has no two samples"});
      return;
    }
    const double nominal_s = 1.0 / run_.setup.imu.rate_hz;
    std::optional<Timestamp> last;
    std::optional<Timestamp> before;
    for (std::size_t row = 0; row < table->row_count(); ++row) {
      ImuSample sample;
      std::array<double, 6> v{};
      if (!Stamp(*table, row, false, &last, &sample.ends_at)) return;
      if (!Numbers(*table, row, kImuColumns, 1, v.data())) return;
      sample.gyro_rad_s = {v[0], v[1], v[2]};
      sample.accel_m_s2 = {v[3], v[4], v[5]};
      sample.interval_s = before ? SecondsBetween(*before, sample.ends_at) : nominal_s;
      if (before && sample.interval_s > 1.5 * nominal_s) {
        run_.warnings.push_back(
            table
                ->FaultAt(row,
                          0,
                          fmt::format("{:.0f} ms are missing before this sample",
                                      1e3 * (sample.interval_s - nominal_s)))
                .Text());
      }
      before = sample.ends_at;
      run_.recording.imu.push_back(sample);
    }
    CheckRate(*table, nominal_s);
    for (std::size_t axis = 0; axis < 6; ++axis) CheckFrozen(*table, axis);
  }

  // Half of the intervals may be longer, half shorter.
  void CheckRate(const CsvTable& table, double nominal_s) {
    std::vector<double> spans;
    for (const ImuSample& sample : run_.recording.imu) spans.push_back(sample.interval_s);
    std::nth_element(
        spans.begin(), spans.begin() + static_cast<std::ptrdiff_t>(spans.size() / 2), spans.end());
    const double median_s = spans[spans.size() / 2];
    if (std::abs(median_s / nominal_s - 1.0) < 0.2) return;
    Fault(table.FaultAt(
        1,
        0,
        fmt::format("rows come every {:.4g} ms, and rail.yaml says imu.rate_hz: {} ({:.4g} ms)",
                    1e3 * median_s,
                    run_.setup.imu.rate_hz,
                    1e3 * nominal_s)));
  }

  void CheckFrozen(const CsvTable& table, std::size_t axis) {
    const auto value = [&](std::size_t row) {
      const ImuSample& sample = run_.recording.imu[row];
      return axis < 3 ? sample.gyro_rad_s[static_cast<Eigen::Index>(axis)]
                      : sample.accel_m_s2[static_cast<Eigen::Index>(axis - 3)];
    };
    double largest = 0.0;
    for (std::size_t row = 0; row < run_.recording.imu.size(); ++row) {
      largest = std::max(largest, std::abs(value(row)));
    }
    std::size_t begin = 0;
    for (std::size_t row = 1; row <= run_.recording.imu.size(); ++row) {
      if (row < run_.recording.imu.size() && value(row) == value(begin)) continue;
      const bool is_saturated = std::abs(value(begin)) == largest && largest > 0.0;
      if (row - begin >= (is_saturated ? kFrozenRows / 2 : kFrozenRows)) {
        Fault(table.FaultAt(
            begin,
            *table.Column(kImuColumns[axis + 1]),
            fmt::format(
                "is {} in {} rows on end: the sensor is {}",
                table.Field(begin, *table.Column(kImuColumns[axis + 1])),
                row - begin,
                is_saturated ? "saturated; the run cannot be used beyond this row" : "frozen")));
        return;
      }
      begin = row;
    }
  }

  void LoadTilts() {
    if (!Has("tilt.csv")) {
      run_.warnings.push_back(PathOf("tilt.csv") +
                              ": is not there: level comes from the "
                              "accelerometers alone");
      return;
    }
    const auto table = Table("tilt.csv", kTiltColumns);
    if (!table) return;
    std::optional<Timestamp> last;
    for (std::size_t row = 0; row < table->row_count(); ++row) {
      const std::size_t sensor = *table->Column("sensor");
      if (table->Field(row, sensor) != kTiltSensor) {
        Fault(table->FaultAt(
            row,
            sensor,
            fmt::format("{} is not {}", Quoted(table->Field(row, sensor)), kTiltSensor)));
        return;
      }
      TrolleyTilt tilt;
      double beta_deg = 0.0;
      double gamma_deg = 0.0;
      if (!Stamp(*table, row, false, &last, &tilt.sensed_at)) return;
      if (!Number(*table, row, "beta_deg", &beta_deg)) return;
      if (!Number(*table, row, "gamma_deg", &gamma_deg)) return;
      if (std::abs(beta_deg) > 89.0 || std::abs(gamma_deg) > 89.0) {
        Fault(table->FaultAt(
            row, *table->Column("beta_deg"), "and gamma_deg must lie between -89 and 89 degrees"));
        return;
      }
      tilt.angles = {DegToRad(beta_deg), DegToRad(gamma_deg)};
      run_.recording.tilts.push_back(tilt);
    }
  }

  void LoadTargets() {
    if (!Has("targets.csv")) return;
    const auto table = Table("targets.csv", kTargetColumns);
    if (!table) return;
    for (std::size_t row = 0; row < table->row_count(); ++row) {
      SurveyedTarget target;
      const std::size_t column = *table->Column("target");
      target.name = std::string(table->Field(row, column));
      std::array<double, 4> v{};
      if (!Numbers(*table, row, kTargetColumns, 1, v.data())) return;
      target.in_world_m = {v[0], v[1], v[2]};
      if (v[3] < 0.0) {
        Fault(table->FaultAt(row, *table->Column("sigma_mm"), "must not be below 0"));
        return;
      }
      target.sigma_m = 1e-3 * v[3];
      if (target.name.empty() ||
          !target_at_.emplace(target.name, static_cast<int>(run_.recording.targets.size()))
               .second) {
        Fault(table->FaultAt(
            row, column, fmt::format("{} stands twice or is empty", Quoted(target.name))));
        return;
      }
      run_.recording.targets.push_back(std::move(target));
      if (!LoadMark(*table, row)) return;
    }
  }

  // The optional column `kind`; empty where nobody looks for the target in images.
  bool LoadMark(const CsvTable& table, std::size_t row) {
    const auto kind = table.Column("kind");
    if (!kind) return true;
    run_.marks.emplace_back();
    if (table.Field(row, *kind).empty()) return true;
    auto mark = ParseTargetMark(table.Field(row, *kind));
    if (!mark) {
      return Fault(table.FaultAt(
          row, *kind, Quoted(table.Field(row, *kind)) + " is no kind: " + Advice(mark.error())));
    }
    if (!known_marks_.insert(NameOf(*mark)).second && mark->kind >= TargetKind::kCoded) {
      return Fault(table.FaultAt(row, *kind, Quoted(NameOf(*mark)) + " stands twice"));
    }
    run_.marks.back() = std::move(mark).value();
    return true;
  }

  static std::string NameOf(const TargetMark& mark) {
    return mark.kind == TargetKind::kCoded ? fmt::format("coded:{}", mark.code)
                                           : fmt::format("board:{}:{}", mark.board, mark.point);
  }

  void LoadCentres() {
    if (!Has("centres.csv")) return;
    const auto table = Table("centres.csv", kCentreColumns);
    if (!table) return;
    std::vector<TargetImage>& images = run_.recording.images;
    std::set<int> seen;
    std::optional<Timestamp> last;
    for (std::size_t row = 0; row < table->row_count(); ++row) {
      Timestamp at;
      if (!Stamp(*table, row, true, &last, &at)) return;
      const std::size_t column = *table->Column("target");
      const auto known = target_at_.find(std::string(table->Field(row, column)));
      if (known == target_at_.end()) {
        Fault(table->FaultAt(
            row,
            column,
            fmt::format("{} does not stand in targets.csv", Quoted(table->Field(row, column)))));
        return;
      }
      TargetPixel pixel;
      pixel.target = known->second;
      if (!Number(*table, row, "u_px", &pixel.pixel_px.x())) return;
      if (!Number(*table, row, "v_px", &pixel.pixel_px.y())) return;
      if (table->Column("sigma_px") && !Number(*table, row, "sigma_px", &pixel.sigma_px)) return;
      if (table->Column("sigma_px") && !(pixel.sigma_px > 0.0)) {
        Fault(table->FaultAt(row, *table->Column("sigma_px"), "must be above 0"));
        return;
      }
      if (images.empty() || images.back().stamped_at < at) {
        images.push_back({at, {}});
        seen.clear();
      }
      if (!seen.insert(pixel.target).second) {
        Fault(
            table->FaultAt(row, column, fmt::format("{} stands twice at {}", known->first, at.ns)));
        return;
      }
      images.back().pixels.push_back(pixel);
    }
  }

  void LoadFrames(std::string_view name, std::vector<RailFrameFile>* frames) {
    if (!Has(name)) return;
    const auto table = Table(name, kFrameColumns);
    if (!table) return;
    std::optional<Timestamp> last;
    for (std::size_t row = 0; row < table->row_count(); ++row) {
      RailFrameFile frame;
      if (!Stamp(*table, row, false, &last, &frame.stamped_at)) return;
      const std::size_t column = *table->Column("file");
      frame.path = PathOf(table->Field(row, column));
      if (table->Field(row, column).empty()) {
        Fault(table->FaultAt(row, column, "is empty; it names an image, such as frames/0001.pgm"));
        return;
      }
      frames->push_back(std::move(frame));
    }
  }

  void LoadOdometer() {
    if (!Has("odometer.csv")) return;
    const auto table = Table("odometer.csv", kOdometerColumns);
    if (!table) return;
    std::optional<Timestamp> last;
    for (std::size_t row = 0; row < table->row_count(); ++row) {
      OdometerReading reading;
      if (!Stamp(*table, row, false, &last, &reading.sensed_at)) return;
      if (!Number(*table, row, "distance_m", &reading.distance_m)) return;
      run_.recording.odometer.push_back(reading);
    }
  }

  void LoadGrounds() {
    if (!Has("displacement.csv")) return;
    const auto table = Table("displacement.csv", kGroundColumns);
    if (!table) return;
    for (std::size_t row = 0; row < table->row_count(); ++row) {
      const auto from = table->Integer(row, *table->Column("from_ns"));
      const auto to = table->Integer(row, *table->Column("to_ns"));
      for (const auto* stamp : {&from, &to}) {
        if (!*stamp) {
          Fault(stamp->error());
          return;
        }
      }
      std::vector<GroundDisplacement>& grounds = run_.recording.grounds;
      if (*to <= *from || (!grounds.empty() && *from < grounds.back().to.ns)) {
        Fault(table->FaultAt(row,
                             *table->Column("from_ns"),
                             "must be before to_ns, and not before the last row's to_ns"));
        return;
      }
      std::array<double, 3> v{};
      if (!Numbers(*table, row, kGroundColumns, 2, v.data())) return;
      if (!(v[2] > 0.0)) {
        Fault(table->FaultAt(row, *table->Column("sigma_m"), "must be above 0"));
        return;
      }
      grounds.push_back({{*from}, {*to}, {v[0], v[1]}, v[2]});
    }
  }

  void LoadTruth() {
    if (!Has("truth.csv")) return;
    const auto table = Table("truth.csv", kTruthColumns);
    if (!table) return;
    std::optional<Timestamp> last;
    for (std::size_t row = 0; row < table->row_count(); ++row) {
      RailTruthRow truth;
      std::array<double, 7> v{};
      if (!Stamp(*table, row, false, &last, &truth.at)) return;
      if (!Numbers(*table, row, kTruthColumns, 1, v.data())) return;
      truth.position_world_m = {v[0], v[1], v[2]};
      truth.world_from_imu = Eigen::Quaterniond(v[3], v[4], v[5], v[6]);
      const double norm = truth.world_from_imu.norm();
      if (!(std::abs(norm - 1.0) < kUnitLength)) {
        Fault(
            table->FaultAt(row,
                           *table->Column("qw"),
                           fmt::format("qw,qx,qy,qz have the length {:.4g}; it must be 1", norm)));
        return;
      }
      truth.world_from_imu.normalize();
      run_.truth.push_back(truth);
    }
  }

  // Nothing is passed over in silence.
  void WarnOfUnused() {
    const auto unused = [&](std::string_view file, std::string_view why) {
      run_.warnings.push_back(fmt::format("{}: is not used: {}", PathOf(file), why));
    };
    const RailSetup& setup = run_.setup;
    if (!run_.recording.tilts.empty() && !setup.tilt) {
      unused("tilt.csv", "rail.yaml has no section tilt");
    }
    if (!run_.recording.tilts.empty() && setup.tilt && setup.tilt->sigma_rotation_rad <= 0.0) {
      run_.warnings.push_back(PathOf("rail.yaml") +
                              ": tilt: no sigma_rotation_deg: how the inclinometer is built in "
                              "counts as exactly known");
    }
    if (!run_.recording.images.empty() && !setup.camera) {
      unused("centres.csv", "rail.yaml has no section camera");
    }
    if (!run_.recording.odometer.empty() && !setup.odometer) {
      unused("odometer.csv", "rail.yaml has no section odometer");
    }
    if (!run_.recording.grounds.empty() && !setup.ground) {
      unused("displacement.csv", "rail.yaml has no section ground_camera");
    }
    if (!run_.ground_frames.empty() && !Has("displacement.csv")) {
      run_.advice.push_back(
          fmt::format("{}: how far the ground went by is not measured yet: tbm ground {} --out {}",
                      PathOf("ground_frames.csv"),
                      folder_,
                      PathOf("displacement.csv")));
    }
    const bool has_frames_only = !run_.frames.empty() && !Has("centres.csv");
    if (setup.camera && run_.recording.images.empty() && !has_frames_only) {
      run_.warnings.push_back(PathOf("centres.csv") +
                              ": there is no image point: no target is seen on this run");
    }
    if (has_frames_only) {
      run_.advice.push_back(
          fmt::format("{}: its targets are not found yet: tbm targets {} --out {}",
                      PathOf("frames.csv"),
                      folder_,
                      PathOf("centres.csv")));
    }
  }

  const std::string folder_;
  RailRunTexts texts_;
  RailRun run_;
  FileFaults faults_;
  std::map<std::string, int> target_at_;
  std::set<std::string> known_marks_;
};

// The files of a folder that are needed, and those of `others` that are there.
Result<RailRunTexts, FileFaults> ReadTexts(const std::string& folder,
                                           std::initializer_list<const char*> needed,
                                           std::initializer_list<const char*> others) {
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) {
    return Failure{FileFaults{
        {folder, 0, "", "is not a folder; a rail run is a folder with rail.yaml and imu.csv"}}};
  }
  RailRunTexts texts;
  FileFaults faults;
  const auto read = [&](const char* name) {
    const bool is_yaml = std::string_view(name).ends_with(".yaml");
    auto text =
        ReadTextFile((fs::path(folder) / name).string(), is_yaml ? kLargestYaml : kLargestTable);
    if (text) {
      texts.emplace(name, std::move(text).value());
    } else {
      faults.push_back(text.error());
    }
  };
  for (const char* name : needed) read(name);
  for (const char* name : others) {
    if (fs::exists(fs::path(folder) / name, ignored)) read(name);
  }
  if (!faults.empty()) return Failure{std::move(faults)};
  return texts;
}

}  // namespace

Result<RailRun, FileFaults> ParseRailRun(const std::string& folder, RailRunTexts texts) {
  return RailRunLoader(folder, std::move(texts)).Load();
}

Result<RailRun, FileFaults> ReadRailRun(const std::string& folder) {
  auto texts = ReadTexts(folder,
                         {"rail.yaml", "imu.csv"},
                         {"tilt.csv",
                          "targets.csv",
                          "centres.csv",
                          "frames.csv",
                          "ground_frames.csv",
                          "odometer.csv",
                          "displacement.csv",
                          "truth.csv"});
  if (!texts) return Failure{texts.error()};
  return ParseRailRun(folder, std::move(texts).value());
}

Result<RailRun, FileFaults> ReadRailSetup(const std::string& folder) {
  auto texts = ReadTexts(folder, {"rail.yaml"}, {"targets.csv"});
  if (!texts) return Failure{texts.error()};
  return RailRunLoader(folder, std::move(texts).value()).LoadBeforeRun();
}

}  // namespace tbm
