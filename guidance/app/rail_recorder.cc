#include "guidance/app/rail_recorder.h"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <limits>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "devices/replay/run_writer.h"
#include "guidance/app/csv_field.h"

namespace tbm {
namespace {

namespace fs = std::filesystem;

std::string Told(const std::string& path, int error) {
  return fmt::format("{}: {}", path, std::strerror(error));
}

}  // namespace

RailRecorder::RailRecorder(std::string folder, Setup setup, Duration hold_back)
    : folder_(std::move(folder)),
      unfinished_(folder_ + std::string(kUnfinished)),
      setup_(std::move(setup)),
      hold_back_(hold_back) {
  files_[kImu].name = "imu.csv";
  files_[kImu].header =
      "stamp_ns,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,accel_x_m_s2,accel_y_m_s2,accel_z_m_s2\n";
  files_[kTilt].name = "tilt.csv";
  files_[kTilt].header = "stamp_ns,sensor,beta_deg,gamma_deg\n";
  files_[kCentres].name = "centres.csv";
  files_[kOdometer].name = "odometer.csv";
  files_[kOdometer].header = "stamp_ns,distance_m\n";
}

std::optional<std::string> RailRecorder::Begin() {
  std::error_code error;
  const fs::path parent = fs::path(folder_).parent_path();
  if (!parent.empty()) fs::create_directories(parent, error);
  const bool is_new =
      !error && !fs::exists(folder_, error) && fs::create_directory(unfinished_, error);
  if (error) return Told(unfinished_, error.value());
  if (!is_new) return folder_ + ": is there already";
  if (const int failed = WriteWhole(PathOf("rail.yaml"), setup_.rail_yaml)) {
    return Told(PathOf("rail.yaml"), failed);
  }
  if (!setup_.targets_csv.empty()) {
    if (const int failed = WriteWhole(PathOf("targets.csv"), setup_.targets_csv)) {
      return Told(PathOf("targets.csv"), failed);
    }
  }
  return {};
}

void RailRecorder::Add(const RailInput& input) {
  const Timestamp at = StampOf(input);
  if (const auto* sample = std::get_if<ImuSample>(&input)) {
    const Eigen::Vector3d& w = sample->gyro_rad_s;
    const Eigen::Vector3d& f = sample->accel_m_s2;
    // Put among the samples before, one of a clock that was set back would look like one of them.
    if (at <= files_[kImu].newest) {
      ++not_recorded_;
      return;
    }
    Keep(kImu,
         at,
         fmt::format("{},{},{},{},{},{},{}\n", at.ns, w.x(), w.y(), w.z(), f.x(), f.y(), f.z()));
  } else if (const auto* tilt = std::get_if<TrolleyTilt>(&input)) {
    Keep(kTilt,
         at,
         fmt::format("{},trolley,{},{}\n",
                     at.ns,
                     DegThatReadsAs(tilt->angles.beta_rad),
                     DegThatReadsAs(tilt->angles.gamma_rad)));
  } else if (const auto* image = std::get_if<TargetImage>(&input)) {
    KeepCentres(*image);
  } else if (const auto* reading = std::get_if<OdometerReading>(&input)) {
    Keep(kOdometer, at, fmt::format("{},{}\n", at.ns, reading->distance_m));
  }
}

void RailRecorder::KeepCentres(const TargetImage& image) {
  const Timestamp at = image.stamped_at;
  if (!has_sigma_ && !image.pixels.empty()) {
    has_sigma_ = std::all_of(image.pixels.begin(),
                             image.pixels.end(),
                             [](const TargetPixel& pixel) { return pixel.sigma_px > 0.0; });
    files_[kCentres].header =
        *has_sigma_ ? "stamp_ns,target,u_px,v_px,sigma_px\n" : "stamp_ns,target,u_px,v_px\n";
  }
  std::string rows;
  std::set<int> seen;
  for (const TargetPixel& pixel : image.pixels) {
    if (!seen.insert(pixel.target).second) continue;
    if (*has_sigma_ && !(pixel.sigma_px > 0.0)) {
      ++not_recorded_;
      continue;
    }
    fmt::format_to(std::back_inserter(rows),
                   "{},{},{},{}",
                   at.ns,
                   CsvField(setup_.targets[static_cast<std::size_t>(pixel.target)]),
                   pixel.pixel_px.x(),
                   pixel.pixel_px.y());
    rows += *has_sigma_ ? fmt::format(",{}\n", pixel.sigma_px) : "\n";
  }
  if (!rows.empty()) Keep(kCentres, at, std::move(rows));
}

void RailRecorder::Keep(Table table, Timestamp at, std::string rows) {
  File& file = files_[table];
  if (at <= file.written_up_to || file.rows.contains(at)) {
    ++not_recorded_;
    return;
  }
  file.newest = std::max(file.newest, at);
  file.rows.emplace(at, std::move(rows));
  if (table == kImu) ++samples_;
}

// Each table by its own newest row: one whose instrument is silent holds back no other.
std::optional<std::string> RailRecorder::Flush() {
  for (File& file : files_) {
    if (auto failed = WriteRows(file, file.newest - hold_back_)) return failed;
  }
  return {};
}

std::optional<std::string> RailRecorder::WriteRows(File& file, Timestamp before) {
  std::string piece;
  const auto end = file.rows.lower_bound(before);
  for (auto row = file.rows.begin(); row != end; ++row) piece += row->second;
  if (piece.empty()) return {};
  int failed = 0;
  if (!file.file.is_open()) failed = file.file.Create(PathOf(file.name));
  if (file.file.size_bytes() == 0) piece.insert(0, file.header);
  if (failed == 0) failed = file.file.Append(piece);
  if (failed == 0) failed = file.file.Sync();
  if (failed != 0) return Told(PathOf(file.name), failed);
  file.written_up_to = std::prev(end)->first;
  file.rows.erase(file.rows.begin(), end);
  return {};
}

std::optional<std::string> RailRecorder::Finish() {
  for (File& file : files_) {
    if (auto failed = WriteRows(file, {std::numeric_limits<std::int64_t>::max()})) return failed;
    file.file.Close();
  }
  if (const int failed = SyncFolder(unfinished_)) return Told(unfinished_, failed);
  std::error_code error;
  fs::rename(unfinished_, folder_, error);
  if (error) return Told(folder_, error.value());
  if (const int failed = SyncFolder(fs::path(folder_).parent_path().string())) {
    return Told(folder_, failed);
  }
  return {};
}

}  // namespace tbm
