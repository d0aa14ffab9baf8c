#pragma once

#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>

#include "devices/replay/synced_file.h"

namespace tbm {

// A result file that appears under its name only when whole, and never over an existing one unless
// that is allowed. The name "-" stands for the standard output.
class OutputFile {
 public:
  OutputFile(std::string path, bool may_replace)
      : path_(std::move(path)), may_replace_(may_replace) {}

  // Asked before long work: why the file could not be written in the end. Empty when it could.
  std::optional<std::string> Obstacle() const;

  // Writes beside the name and renames. Empty when done, else what went wrong.
  std::optional<std::string> Write(std::string_view bytes) const;

  const std::string& path() const { return path_; }

 private:
  std::string path_;
  bool may_replace_;
};

// The same for a file that is too long to be held in memory: it grows beside its name, and gets the
// name in the end.
class GrowingOutputFile {
 public:
  GrowingOutputFile(std::string path, bool may_replace);
  // Without Commit nothing stays behind.
  ~GrowingOutputFile();
  GrowingOutputFile(const GrowingOutputFile&) = delete;
  GrowingOutputFile& operator=(const GrowingOutputFile&) = delete;

  // Each: empty when done, else what went wrong.
  std::optional<std::string> Append(std::string_view bytes);
  std::optional<std::string> Commit();

 private:
  std::optional<std::string> Told(int error) const;

  std::string path_;
  std::string beside_;
  bool may_replace_;
  SyncedFile file_;
};

// A folder with a command's results under one name: report/check.csv, report/check.json, ..
class ReportFolder {
 public:
  // Without a folder there is no report, and nothing stops it.
  ReportFolder(std::string folder, std::string name, bool may_replace)
      : folder_(std::move(folder)), name_(std::move(name)), may_replace_(may_replace) {}

  bool is_wanted() const { return !folder_.empty(); }
  OutputFile File(std::string_view ending) const;

  // Makes the folder. Everything that would stop one of the files is found before anything of them
  // is written.
  std::optional<std::string> Obstacle(std::initializer_list<std::string_view> endings) const;

 private:
  std::string folder_;
  std::string name_;
  bool may_replace_;
};

// Makes a folder for several results. Empty when it is there afterwards.
std::optional<std::string> MakeFolder(const std::string& path);

}  // namespace tbm
