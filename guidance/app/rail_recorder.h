#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "devices/replay/synced_file.h"
#include "guidance/app/rail_source.h"

namespace tbm {

// Of a folder that is not finished; the whole one has its name without it.
inline constexpr std::string_view kUnfinished = ".unfinished";

// Writes a run as it is measured into a rail run's folder (FORMATS §5), from which `tbm line` gets
// back every number to the bit. The folder has its name only when the run has ended; what was
// written before a power cut stays readable under its name with `.unfinished`. All file work
// happens in Flush and Finish.
class RailRecorder {
 public:
  // What a run has beside measurements, to be copied.
  struct Setup {
    std::string rail_yaml;
    std::string targets_csv;           // empty: there are none
    std::vector<std::string> targets;  // names, in the order of TargetPixel::target
  };

  // `hold_back`: measurements come at most so much later than samples that are newer; what is later
  // than that is not recorded.
  RailRecorder(std::string folder, Setup setup, Duration hold_back);

  // Each: empty when done, else what went wrong, on which path.
  std::optional<std::string> Begin();
  std::optional<std::string> Flush();
  std::optional<std::string> Finish();

  void Add(const RailInput& input);

  const std::string& folder() const { return folder_; }
  std::uint64_t came_too_late() const { return came_too_late_; }
  std::size_t samples() const { return samples_; }

 private:
  enum Table : std::size_t { kImu, kTilt, kCentres, kOdometer, kTables };
  struct File {
    std::string name;
    std::string header;
    SyncedFile file;
    std::multimap<Timestamp, std::string> rows;  // in the order of their stamps
    Timestamp written_up_to;
  };

  void Keep(Table table, Timestamp at, std::string rows);
  std::optional<std::string> WriteRows(Timestamp before);
  std::string PathOf(std::string_view name) const { return unfinished_ + "/" + std::string(name); }

  const std::string folder_;
  const std::string unfinished_;
  const Setup setup_;
  const Duration hold_back_;
  std::array<File, kTables> files_;
  Timestamp newest_;  // sample
  std::uint64_t came_too_late_ = 0;
  std::size_t samples_ = 0;
};

}  // namespace tbm
