#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "devices/replay/synced_file.h"
#include "guidance/app/rail_source.h"
#include "guidance/app/run_folders.h"

namespace tbm {

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

  // `hold_back`: within one table a row comes at most so much later than rows that are newer; what
  // is later than that is not recorded. Samples of the unit come in the order of time, or not at
  // all.
  RailRecorder(std::string folder, Setup setup, Duration hold_back);

  // Each: empty when done, else what went wrong, on which path. Begin makes the folder and refuses
  // one that is there.
  std::optional<std::string> Begin();
  std::optional<std::string> Flush();
  std::optional<std::string> Finish();

  void Add(const RailInput& input);

  const std::string& folder() const { return folder_; }
  // Rows: too late, of a stamp that the table has already, without a sigma where it has that
  // column.
  std::uint64_t not_recorded() const { return not_recorded_; }
  std::size_t samples() const { return samples_; }

 private:
  enum Table : std::size_t { kImu, kTilt, kCentres, kOdometer, kTables };
  struct File {
    std::string name;
    std::string header;
    SyncedFile file;
    std::multimap<Timestamp, std::string> rows;  // in the order of their stamps
    Timestamp newest;
    Timestamp written_up_to;
  };

  void Keep(Table table, Timestamp at, std::string rows);
  void KeepCentres(const TargetImage& image);
  std::optional<std::string> WriteRows(File& file, Timestamp before);
  std::string PathOf(std::string_view name) const { return unfinished_ + "/" + std::string(name); }

  const std::string folder_;
  const std::string unfinished_;
  const Setup setup_;
  const Duration hold_back_;
  std::array<File, kTables> files_;
  std::optional<bool>
      has_sigma_;  // whether centres.csv has the column sigma_px: by the first image
  std::uint64_t not_recorded_ = 0;
  std::size_t samples_ = 0;
};

}  // namespace tbm
