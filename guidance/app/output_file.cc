#include "guidance/app/output_file.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <iostream>

#include <fmt/format.h>
#include <unistd.h>

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
  GrowingOutputFile file(path_, may_replace_);
  if (const auto fault = file.Append(bytes)) return fault;
  return file.Commit();
}

GrowingOutputFile::GrowingOutputFile(std::string path, bool may_replace)
    : path_(std::move(path)),
      beside_(fmt::format("{}.part{}", path_, ::getpid())),
      may_replace_(may_replace) {}

GrowingOutputFile::~GrowingOutputFile() {
  if (file_.is_open()) ::unlink(beside_.c_str());
}

std::optional<std::string> GrowingOutputFile::Told(int error) const {
  if (error == 0) return std::nullopt;
  if (error == EEXIST) return ExistsText(path_);
  return fmt::format("{}: cannot be written: {}", path_, std::strerror(error));
}

std::optional<std::string> GrowingOutputFile::Append(std::string_view bytes) {
  if (!file_.is_open()) {
    if (const int error = file_.Create(beside_); error != 0) return Told(error);
  }
  return Told(file_.Append(bytes));
}

std::optional<std::string> GrowingOutputFile::Commit() {
  if (const auto fault = Append({})) return fault;
  int error = file_.Sync();
  file_.Close();
  if (error == 0 && may_replace_) {
    if (std::rename(beside_.c_str(), path_.c_str()) != 0) error = errno;
  } else if (error == 0) {
    // link() refuses an existing name in the same step; rename() would replace what somebody else
    // wrote while we were computing. Disks without links (vfat) get the two steps.
    if (::link(beside_.c_str(), path_.c_str()) != 0) {
      error = errno;
      std::error_code ignored;
      if ((error == EPERM || error == ENOTSUP) && !fs::exists(path_, ignored)) {
        error = std::rename(beside_.c_str(), path_.c_str()) == 0 ? 0 : errno;
      }
    }
  }
  ::unlink(beside_.c_str());
  return Told(error);
}

OutputFile ReportFolder::File(std::string_view ending) const {
  return {fmt::format("{}/{}.{}", folder_, name_, ending), may_replace_};
}

std::optional<std::string> ReportFolder::Obstacle(
    std::initializer_list<std::string_view> endings) const {
  if (!is_wanted()) return std::nullopt;
  if (auto fault = MakeFolder(folder_)) return fault;
  for (const std::string_view ending : endings) {
    if (auto fault = File(ending).Obstacle()) return fault;
  }
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
