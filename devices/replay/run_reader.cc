#include "devices/replay/run_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include "pose/base/angle.h"
#include "pose/rig/rig_file.h"

namespace tbm {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 2> kFrameColumns = {"stamp_ns", "file"};
constexpr std::array<std::string_view, 4> kTiltColumns = {
    "stamp_ns", "sensor", "beta_deg", "gamma_deg"};

std::string Inside(const std::string& folder, std::string_view file) {
  return (fs::path(folder) / fs::path(std::string(file))).string();
}

// A recording may come from anywhere; it names files of its own folder only.
bool StaysInside(const std::string& file) {
  const fs::path path(file);
  return !file.empty() && file.find('\0') == std::string::npos && path.is_relative() &&
         std::find(path.begin(), path.end(), "..") == path.end();
}

class RunLoader {
 public:
  explicit RunLoader(const std::string& folder) { run_.folder = folder; }

  Result<RecordedRun, FileFaults> Load() {
    std::error_code ignored;
    if (!fs::is_directory(run_.folder, ignored)) {
      return Failure{FileFaults{
          {run_.folder,
           0,
           "",
           "is not a folder; a run is a folder with rig.yaml, frames.csv and tilt.csv"}}};
    }
    LoadRig();
    LoadFrames();
    LoadTilts();
    LoadState();
    if (!faults_.empty()) return Failure{std::move(faults_)};
    return std::move(run_);
  }

 private:
  void LoadRig() {
    auto loaded = LoadRigFile(Inside(run_.folder, "rig.yaml"));
    if (!loaded) {
      for (const RigFileFault& fault : loaded.error()) {
        faults_.push_back({fault.file,
                           fault.line,
                           "",
                           fault.key.empty() ? fault.what : fault.key + ": " + fault.what});
      }
      return;
    }
    for (const RigFileFault& warning : loaded->warnings) run_.warnings.push_back(warning.Text());
    run_.rig = std::move(loaded).value().rig;
  }

  std::optional<CsvTable> LoadTable(std::string_view name,
                                    std::span<const std::string_view> columns) {
    const std::string path = Inside(run_.folder, name);
    auto text = ReadTextFile(path);
    if (!text) {
      faults_.push_back(text.error());
      return std::nullopt;
    }
    std::string whole = std::move(text).value();
    // A row that a power cut left half written may lack fields: taken away before it is judged.
    std::string cut_line;
    // Some file systems leave the promised length behind, filled with zeros.
    if (const std::size_t end = whole.find_last_not_of('\0'); end + 1 < whole.size()) {
      whole.resize(end + 1);
      cut_line = "?";
    }
    if (!whole.empty() && whole.back() != '\n') {
      const std::size_t start = whole.rfind('\n') + 1;  // npos + 1 is 0
      cut_line = whole.substr(start);
      if (start > 0) whole.resize(start);
    }
    auto table = CsvTable::Parse(std::move(whole), path, columns);
    if (!table) {
      faults_.push_back(table.error());
      return std::nullopt;
    }
    cut_line_ = cut_line;
    return std::move(table).value();
  }

  void LoadFrames() {
    auto table = LoadTable("frames.csv", kFrameColumns);
    if (!table) return;
    ReadFrameRows(*table);
    if (cut_line_.empty()) return;
    // Names have one length within a run, so a row whose image is there is whole.
    std::string text;
    for (const std::string& column : table->columns()) text += (text.empty() ? "" : ",") + column;
    const int line = table->row_count() == 0 ? 2 : table->line(table->row_count() - 1) + 1;
    auto last = CsvTable::Parse(
        text + "\n" + cut_line_ + "\n", Inside(run_.folder, "frames.csv"), kFrameColumns);
    if (last && last->row_count() == 1) {
      const std::string file(last->Field(0, *last->Column("file")));
      const auto stamp = last->Integer(0, *last->Column("stamp_ns"));
      std::error_code ignored;
      const bool has_all_fields = !last->Column("tilts_known");
      if (stamp && has_all_fields && StaysInside(file) &&
          fs::is_regular_file(Inside(run_.folder, file), ignored)) {
        run_.frames.push_back({{*stamp}, file, line, std::nullopt});
        return;
      }
    }
    WarnOfCut("frames.csv", line);
  }

  void ReadFrameRows(const CsvTable& table) {
    const std::size_t stamp_column = *table.Column("stamp_ns");
    const std::size_t file_column = *table.Column("file");
    const auto known_column = table.Column("tilts_known");
    for (std::size_t row = 0; row < table.row_count(); ++row) {
      const auto stamp = table.Integer(row, stamp_column);
      if (!stamp) return faults_.push_back(stamp.error());
      RecordedFrame frame{
          {*stamp}, std::string(table.Field(row, file_column)), table.line(row), {}};
      if (!StaysInside(frame.file)) {
        return faults_.push_back(
            table.FaultAt(row,
                          file_column,
                          Quoted(frame.file) +
                              " must be a path inside the run folder such as frames/000001.png"));
      }
      if (known_column) {
        const auto known = table.Integer(row, *known_column);
        if (!known) return faults_.push_back(known.error());
        const bool goes_back = !run_.frames.empty() &&
                               run_.frames.back().tilts_known > static_cast<std::size_t>(*known);
        if (*known < 0 || goes_back) {
          return faults_.push_back(table.FaultAt(
              row, *known_column, "must be 0 or more and never less than the row before"));
        }
        frame.tilts_known = static_cast<std::size_t>(*known);
      }
      run_.frames.push_back(std::move(frame));
    }
  }

  void LoadTilts() {
    auto table = LoadTable("tilt.csv", kTiltColumns);
    if (!table) return;
    for (std::size_t row = 0; row < table->row_count(); ++row) {
      if (auto fault = ReadTiltRow(*table, row)) return faults_.push_back(std::move(*fault));
    }
    if (!cut_line_.empty()) {
      WarnOfCut("tilt.csv", table->row_count() == 0 ? 2 : table->line(table->row_count() - 1) + 1);
    }
    const bool in_arrival_order = !run_.frames.empty() && run_.frames.front().tilts_known;
    if (in_arrival_order && *run_.frames.back().tilts_known > run_.tilts.size()) {
      run_.warnings.push_back(fmt::format(
          "{}: the last frames were solved with {} tilt readings, of which {} are there",
          Inside(run_.folder, "tilt.csv"),
          *run_.frames.back().tilts_known,
          run_.tilts.size()));
    }
    if (!in_arrival_order) {
      std::stable_sort(run_.tilts.begin(), run_.tilts.end(), [](const auto& a, const auto& b) {
        return a.sensed_at < b.sensed_at;
      });
    }
  }

  std::optional<FileFault> ReadTiltRow(const CsvTable& table, std::size_t row) {
    const auto stamp = table.Integer(row, *table.Column("stamp_ns"));
    if (!stamp) return stamp.error();
    TiltReading reading;
    reading.sensed_at = {*stamp};
    const std::size_t sensor_column = *table.Column("sensor");
    const std::string_view sensor = table.Field(row, sensor_column);
    if (sensor == SensorWord(TiltSensor::kCamera)) {
      reading.sensor = TiltSensor::kCamera;
    } else if (sensor != SensorWord(TiltSensor::kTarget)) {
      return table.FaultAt(row, sensor_column, Quoted(sensor) + " must be target or camera");
    }
    const std::size_t beta_column = *table.Column("beta_deg");
    const std::size_t gamma_column = *table.Column("gamma_deg");
    const auto beta_deg = table.Real(row, beta_column);
    if (!beta_deg) return beta_deg.error();
    const auto gamma_deg = table.Real(row, gamma_column);
    if (!gamma_deg) return gamma_deg.error();
    for (const auto& [column, value] :
         {std::pair(beta_column, *beta_deg), {gamma_column, *gamma_deg}}) {
      if (std::isfinite(value)) continue;
      run_.warnings.push_back(
          table.FaultAt(row, column, "is not finite; kept as a reading that says nothing").Text());
    }
    reading.inclination = {DegToRad(*beta_deg), DegToRad(*gamma_deg)};
    run_.tilts.push_back(reading);
    return std::nullopt;
  }

  void LoadState() {
    const std::string path = Inside(run_.folder, "solver_state.txt");
    std::error_code ignored;
    if (!fs::exists(path, ignored)) return;
    auto text = ReadTextFile(path, 1 << 20);
    if (text) {
      run_.solver_state = std::move(text).value();
    } else {
      run_.warnings.push_back(text.error().Text());
    }
  }

  void WarnOfCut(std::string_view file, int line) {
    run_.warnings.push_back(FileFault{
        Inside(run_.folder, file),
        line,
        "",
        "the last line does not end with a line feed, as after a power cut; it is passed over"}
                                .Text());
  }

  RecordedRun run_;
  FileFaults faults_;
  std::string cut_line_;  // of the table loaded last
};

}  // namespace

std::string_view SensorWord(TiltSensor sensor) {
  return sensor == TiltSensor::kTarget ? "target" : "camera";
}

Result<RecordedRun, FileFaults> ReadRun(const std::string& folder) {
  return RunLoader(folder).Load();
}

ImageResult ReadFrame(const RecordedRun& run, std::size_t frame) {
  const CameraModel& camera = run.rig.camera;
  return ReadImageFile(Inside(run.folder, run.frames.at(frame).file),
                       ImageSize{camera.image_width_px, camera.image_height_px});
}

std::span<const TiltReading> TiltFeed::Before(std::size_t frame) {
  const RecordedFrame& row = run_.frames.at(frame);
  const std::size_t first = next_;
  if (row.tilts_known) {
    next_ = std::max(next_, std::min(*row.tilts_known, run_.tilts.size()));
  } else {
    while (next_ < run_.tilts.size() &&
           run_.tilts[next_].sensed_at <= row.sensed_at + look_ahead_) {
      ++next_;
    }
  }
  return {run_.tilts.data() + first, next_ - first};
}

}  // namespace tbm
