#include "devices/replay/run_writer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <vector>

#include <fmt/format.h>

#include "devices/replay/image_file.h"
#include "devices/replay/run_reader.h"
#include "devices/replay/synced_file.h"
#include "pose/base/angle.h"

namespace tbm {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kDoomedPrefix = ".deleting_";
constexpr std::string_view kUnbornPrefix = ".new_";
constexpr std::size_t kHeldTiltRows = 200;  // half a second of two fast instruments

std::string RunName(Timestamp at) {
  const auto instant = std::chrono::sys_time<Duration>(Duration(at.ns));
  const auto day = std::chrono::floor<std::chrono::days>(instant);
  const std::chrono::year_month_day date(day);
  const std::chrono::hh_mm_ss time(std::chrono::floor<std::chrono::seconds>(instant - day));
  return fmt::format("run_{:04}{:02}{:02}_{:02}{:02}{:02}",
                     static_cast<int>(date.year()),
                     static_cast<unsigned>(date.month()),
                     static_cast<unsigned>(date.day()),
                     time.hours().count(),
                     time.minutes().count(),
                     time.seconds().count());
}

// run_YYYYMMDD_HHMMSS or the same with _N behind it. Nothing else in the folder is ever deleted.
bool IsRunName(std::string_view name) {
  constexpr std::string_view kPattern = "run_dddddddd_dddddd";
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  if (name.size() < kPattern.size()) return false;
  for (std::size_t i = 0; i < kPattern.size(); ++i) {
    if (kPattern[i] == 'd' && i >= 4 ? !is_digit(name[i]) : name[i] != kPattern[i]) return false;
  }
  const std::string_view tail = name.substr(kPattern.size());
  return tail.empty() ||
         (tail.size() > 1 && tail[0] == '_' && std::all_of(tail.begin() + 1, tail.end(), is_digit));
}

std::int64_t BytesIn(const fs::path& folder) {
  std::int64_t bytes = 0;
  std::error_code error;
  for (fs::recursive_directory_iterator it(folder, error), end; !error && it != end;
       it.increment(error)) {
    std::error_code ignored;
    if (it->is_regular_file(ignored)) bytes += static_cast<std::int64_t>(it->file_size(ignored));
  }
  return bytes;
}

}  // namespace

struct RunWriter::Work {
  RecorderOptions options;
  RecorderStatus status;
  SyncedFile frames;
  SyncedFile tilts;
  std::string held_tilt_rows;
  std::size_t held_tilts = 0;
  std::int64_t run_frames = 0;
  std::int64_t run_tilts = 0;
  std::int64_t run_bytes = 0;
  Timestamp first_frame_at;
  Timestamp last_frame_at;

  bool is_open() const { return status.state == RecorderState::kRecording; }

  bool Stop(int error, const std::string& path) {
    frames.Close();
    tilts.Close();
    held_tilt_rows.clear();
    held_tilts = 0;
    status.state = MeansFull(error) ? RecorderState::kDiskFull : RecorderState::kFailed;
    status.what = fmt::format("{}: {}", path, std::strerror(error));
    return false;
  }

  void Count(std::int64_t bytes) {
    run_bytes += bytes;
    status.total_bytes += bytes;
  }

  std::int64_t FreeForUs() const {
    const std::int64_t free = FreeBytes(options.folder);
    return free < 0 ? 0 : free;
  }

  // Whole runs, oldest first, without the open one.
  std::vector<std::string> OldRuns() const {
    std::vector<std::string> names;
    std::error_code error;
    for (fs::directory_iterator it(options.folder, error), end; !error && it != end;
         it.increment(error)) {
      const std::string name = it->path().filename().string();
      if (IsRunName(name) && it->path().string() != status.run) names.push_back(name);
    }
    std::sort(names.begin(), names.end());
    return names;
  }

  // What a power cut left of a run being made or deleted.
  void SweepLeftovers() const {
    std::error_code error;
    std::vector<fs::path> leftovers;
    for (fs::directory_iterator it(options.folder, error), end; !error && it != end;
         it.increment(error)) {
      const std::string name = it->path().filename().string();
      if (name.starts_with(kDoomedPrefix) || name.starts_with(kUnbornPrefix)) {
        leftovers.push_back(it->path());
      }
    }
    for (const fs::path& leftover : leftovers) fs::remove_all(leftover, error);
  }

  void KeepTotal() {
    if (status.total_bytes <= options.total_max_bytes) return;
    for (const std::string& name : OldRuns()) {
      if (status.total_bytes <= options.total_max_bytes) return;
      const fs::path run = fs::path(options.folder) / name;
      const fs::path doomed = fs::path(options.folder) / (std::string(kDoomedPrefix) + name);
      const std::int64_t bytes = BytesIn(run);
      std::error_code error;
      // Renamed first: a run that is half deleted must not look like a run.
      fs::rename(run, doomed, error);
      if (error) continue;
      fs::remove_all(doomed, error);
      status.total_bytes -= bytes;
      ++status.runs_deleted;
    }
  }

  bool Begin(Timestamp now, std::string_view solver_state) {
    Close();
    std::error_code error;
    fs::create_directories(options.folder, error);
    if (error) return Stop(error.value(), options.folder);
    SweepLeftovers();
    status.run.clear();
    status.total_bytes = 0;
    for (const std::string& name : OldRuns())
      status.total_bytes += BytesIn(fs::path(options.folder) / name);
    KeepTotal();
    if (FreeForUs() < options.free_min_bytes) return Stop(ENOSPC, options.folder);

    std::string name = RunName(now);
    for (int again = 2; fs::exists(fs::path(options.folder) / name, error); ++again) {
      name = fmt::format("{}_{}", RunName(now), again);
    }
    const fs::path run = fs::path(options.folder) / name;
    const fs::path unborn = fs::path(options.folder) / (std::string(kUnbornPrefix) + name);
    const int failure = MakeRun(unborn.string(), run.string(), solver_state);
    if (failure != 0) {
      frames.Close();
      tilts.Close();
      fs::remove_all(unborn, error);
      return Stop(failure, run.string());
    }
    status.run = run.string();
    status.state = RecorderState::kRecording;
    status.what.clear();
    run_frames = 0;
    run_tilts = 0;
    run_bytes = 0;
    Count(BytesIn(run));
    return true;
  }

  int MakeRun(const std::string& unborn, const std::string& run, std::string_view solver_state) {
    std::error_code error;
    fs::create_directories(fs::path(unborn) / "frames", error);
    if (error) return error.value();
    int failure = WriteWhole(unborn + "/rig.yaml", options.rig_yaml);
    if (failure == 0 && !solver_state.empty()) {
      failure = WriteWhole(unborn + "/solver_state.txt", solver_state);
    }
    if (failure == 0) failure = tilts.Create(unborn + "/tilt.csv");
    if (failure == 0) failure = tilts.Append("stamp_ns,sensor,beta_deg,gamma_deg\n");
    if (failure == 0) failure = tilts.Sync();
    if (failure == 0) failure = frames.Create(unborn + "/frames.csv");
    if (failure == 0) failure = frames.Append("stamp_ns,file,tilts_known\n");
    if (failure == 0) failure = frames.Sync();
    if (failure == 0) failure = SyncFolder(unborn);
    if (failure != 0) return failure;
    fs::rename(unborn, run, error);
    if (error) return error.value();
    return SyncFolder(options.folder);
  }

  bool WriteTilts() {
    if (held_tilt_rows.empty()) return true;
    const int failure = tilts.Append(held_tilt_rows);
    if (failure != 0) return Stop(failure, status.run + "/tilt.csv");
    Count(static_cast<std::int64_t>(held_tilt_rows.size()));
    held_tilt_rows.clear();
    held_tilts = 0;
    return true;
  }

  void AddTilt(const TiltReading& reading) {
    if (!is_open()) return;
    held_tilt_rows += fmt::format("{},{},{},{}\n",
                                  reading.sensed_at.ns,
                                  SensorWord(reading.sensor),
                                  DegThatReadsAs(reading.inclination.beta_rad),
                                  DegThatReadsAs(reading.inclination.gamma_rad));
    ++run_tilts;
    if (++held_tilts >= kHeldTiltRows) WriteTilts();
  }

  std::string NextFile(std::string_view ending) const {
    return fmt::format("frames/{:06}.{}", run_frames, ending);
  }

  // True when a frame can be written now.
  bool MakeReady(std::int64_t bytes) {
    if (!is_open()) return false;
    if (FreeForUs() < options.free_min_bytes + bytes) return Stop(ENOSPC, status.run);
    return true;
  }

  bool AddRow(Timestamp sensed_at, const std::string& file) {
    if (!WriteTilts()) return false;
    const std::string row = fmt::format("{},{},{}\n", sensed_at.ns, file, run_tilts);
    int failure = 0;
    // The readings a row counts on reach the disk before the row does.
    const bool is_sync_due = (run_frames + 1) % std::max(1, options.sync_every_frames) == 0;
    if (is_sync_due) failure = tilts.Sync();
    if (failure == 0) failure = frames.Append(row);
    if (failure == 0 && is_sync_due) failure = frames.Sync();
    if (failure != 0) return Stop(failure, status.run + "/frames.csv");
    if (run_frames == 0) first_frame_at = sensed_at;
    last_frame_at = sensed_at;
    ++run_frames;
    ++status.frames_recorded;
    Count(static_cast<std::int64_t>(row.size()));
    KeepTotal();
    return true;
  }

  bool AddFile(Timestamp sensed_at, std::string_view ending, std::string_view bytes) {
    if (!MakeReady(static_cast<std::int64_t>(bytes.size()))) return false;
    const std::string file = NextFile(ending);
    const int failure = WriteWhole(status.run + "/" + file, bytes);
    if (failure != 0) return Stop(failure, status.run + "/" + file);
    Count(static_cast<std::int64_t>(bytes.size()));
    return AddRow(sensed_at, file);
  }

  bool AddImage(Timestamp sensed_at, const ImageView& image) {
    if (!is_open()) return false;
    const auto png = options.png ? EncodePng(image) : std::nullopt;
    const std::vector<std::uint8_t> bytes = png ? *png : EncodePgm(image);
    return AddFile(sensed_at,
                   png ? "png" : "pgm",
                   {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  }

  void Close() {
    if (is_open() && WriteTilts()) {
      const bool is_on_disk = tilts.Sync() == 0 && frames.Sync() == 0;
      status.state = is_on_disk ? RecorderState::kIdle : RecorderState::kFailed;
    }
    frames.Close();
    tilts.Close();
  }
};

RunWriter::RunWriter(const RecorderOptions& options) : work_(std::make_unique<Work>()) {
  work_->options = options;
}
RunWriter::~RunWriter() {
  if (work_) work_->Close();
}
RunWriter::RunWriter(RunWriter&&) noexcept = default;
RunWriter& RunWriter::operator=(RunWriter&&) noexcept = default;

bool RunWriter::WantsNewRun() {
  const Work& work = *work_;
  switch (work.status.state) {
    case RecorderState::kIdle:
    case RecorderState::kFailed:
      return true;
    case RecorderState::kDiskFull:
      return work.FreeForUs() >= 2 * work.options.free_min_bytes;
    case RecorderState::kRecording:
      break;
  }
  if (work.run_frames == 0) return false;
  return work.run_frames >= work.options.run_max_frames ||
         std::chrono::abs(work.last_frame_at - work.first_frame_at) >=
             work.options.run_max_duration ||
         work.run_bytes >= work.options.total_max_bytes / 4;
}

bool RunWriter::Begin(Timestamp now, std::string_view solver_state) {
  return work_->Begin(now, solver_state);
}

void RunWriter::AddTilt(const TiltReading& reading) { work_->AddTilt(reading); }

bool RunWriter::AddFrame(Timestamp sensed_at, const ImageView& image) {
  const bool is_recorded = work_->AddImage(sensed_at, image);
  if (!is_recorded) ++work_->status.frames_lost;
  return is_recorded;
}

bool RunWriter::AddFaultyFrame(Timestamp sensed_at, PoseReason image_fault) {
  bool is_recorded = false;
  if (image_fault == PoseReason::kFrameMissing) {
    is_recorded = work_->MakeReady(0) && work_->AddRow(sensed_at, work_->NextFile("missing"));
  } else {
    is_recorded = work_->AddFile(sensed_at, "unreadable", "");
  }
  if (!is_recorded) ++work_->status.frames_lost;
  return is_recorded;
}

void RunWriter::Close() { work_->Close(); }

const RecorderStatus& RunWriter::status() const { return work_->status; }

double DegThatReadsAs(double angle_rad) {
  const double nearest_deg = RadToDeg(angle_rad);
  if (!std::isfinite(nearest_deg)) return nearest_deg;
  double below_deg = nearest_deg;
  double above_deg = nearest_deg;
  constexpr int kUlps = 4;
  for (int ulp = 0; ulp <= kUlps; ++ulp) {
    if (DegToRad(below_deg) == angle_rad) return below_deg;
    if (DegToRad(above_deg) == angle_rad) return above_deg;
    below_deg = std::nextafter(below_deg, -HUGE_VAL);
    above_deg = std::nextafter(above_deg, HUGE_VAL);
  }
  return nearest_deg;
}

}  // namespace tbm
