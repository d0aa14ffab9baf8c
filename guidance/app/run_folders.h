#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pose/base/time.h"

namespace tbm {

// Of a folder that is not finished; the whole one has its name without it.
inline constexpr std::string_view kUnfinished = ".unfinished";

// The folders of the process rail_line, a folder in them for each run: `runs` for what is measured,
// `lines` for what comes of it. One process at a time works in them, or it would clear away what
// another is making.
class RunFolders {
 public:
  RunFolders(std::string runs, std::string lines)
      : runs_(std::move(runs)), lines_(std::move(lines)) {}
  ~RunFolders() { Release(); }
  RunFolders(const RunFolders&) = delete;
  RunFolders& operator=(const RunFolders&) = delete;

  // Makes both and keeps other processes out until Release, or until this one ends in whatever way.
  // Empty when done, else why not. On a file system that knows no locks nobody is kept out.
  std::optional<std::string> Take();
  void Release();

  // A name that nothing in either folder has: "rail_20261123_114500", or "rail_20261123_114500_2".
  std::string FreeName(Timestamp begins_at) const;

  // After a power cut: removes lines that were being made, and returns the runs that were being
  // measured, which stay.
  std::vector<std::string> CleanUp() const;

  std::string RunPath(const std::string& name) const { return runs_ + "/" + name; }
  std::string LinePath(const std::string& name) const { return lines_ + "/" + name; }
  const std::string& lines() const { return lines_; }

 private:
  const std::string runs_;
  const std::string lines_;
  std::vector<int> locks_;
};

}  // namespace tbm
