#include "guidance/app/output_file.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <iostream>

#include <fmt/format.h>
#include <unistd.h>

#include "devices/replay/synced_file.h"

namespace tbm {
namespace {

namespace fs = std::filesystem;

std::string ExistsText(const std::string& path) {
  return path + ": exists already; give another name, or --force to replace it";
}

}  // namespace

std::optional<std::string> OutputFile::Obstacle() const {
  if (path_ == "-") return std::nullopt;
  if (path_.empty()) return "--out needs a file name";
  std::error_code ignored;
  const fs::path parent = fs::path(path_).has_parent_path() ? fs::path(path_).parent_path() : ".";
  if (!fs::is_directory(parent, ignored)) {
    return fmt::format("{}: the folder {} does not exist; make it first", path_, parent.string());
  }
  if (fs::is_directory(path_, ignored)) return path_ + ": is a folder; give the name of a file";
  if (fs::exists(fs::symlink_status(path_, ignored)) && !may_replace_) return ExistsText(path_);
  if (::access(parent.c_str(), W_OK) != 0) {
    return fmt::format(
        "{}: the folder {} may not be written: {}", path_, parent.string(), std::strerror(errno));
  }
  return std::nullopt;
}

std::optional<std::string> OutputFile::Write(std::string_view bytes) const {
  if (path_ == "-") {
    std::cout << bytes << std::flush;
    return std::cout ? std::nullopt : std::optional<std::string>("the output cannot be written");
  }
  const std::string beside = fmt::format("{}.part{}", path_, ::getpid());
  SyncedFile file;
  int error = file.Create(beside);
  if (error == 0) error = file.Append(bytes);
  if (error == 0) error = file.Sync();
  file.Close();
  if (error == 0 && may_replace_) {
    if (std::rename(beside.c_str(), path_.c_str()) != 0) error = errno;
  } else if (error == 0) {
    // link() refuses an existing name in the same step; rename() would replace what somebody else
    // wrote while we were computing. Disks without links (vfat) get the two steps.
    if (::link(beside.c_str(), path_.c_str()) != 0) {
      error = errno;
      std::error_code ignored;
      if ((error == EPERM || error == ENOTSUP) && !fs::exists(path_, ignored)) {
        error = std::rename(beside.c_str(), path_.c_str()) == 0 ? 0 : errno;
      }
    }
  }
  ::unlink(beside.c_str());
  if (error == EEXIST) return ExistsText(path_);
  if (error != 0) return fmt::format("{}: cannot be written: {}", path_, std::strerror(error));
  return std::nullopt;
}

std::optional<std::string> MakeFolder(const std::string& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (error || !fs::is_directory(path, error)) {
    return fmt::format("{}: the folder cannot be made: {}", path, error.message());
  }
  return std::nullopt;
}

}  // namespace tbm
