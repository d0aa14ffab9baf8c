#include "guidance/app/run_folders.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <filesystem>

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

namespace tbm {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> UnfinishedIn(const std::string& folder) {
  std::vector<std::string> found;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (name.starts_with("rail_") && name.ends_with(kUnfinished)) found.push_back(it->path());
  }
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace

std::optional<std::string> RunFolders::Take() {
  std::error_code error;
  for (const std::string& path : {runs_, lines_}) {
    fs::create_directories(path, error);
    if (error) return fmt::format("{}: {}", path, error.message());
    if (!locks_.empty() && fs::equivalent(runs_, lines_, error)) continue;
    const int folder = ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (folder < 0) return fmt::format("{}: {}", path, std::strerror(errno));
    locks_.push_back(folder);
    if (::flock(folder, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
      Release();
      return fmt::format("{}: another rail_line is at work in this folder", path);
    }
  }
  return {};
}

void RunFolders::Release() {
  for (const int folder : locks_) ::close(folder);
  locks_.clear();
}

std::string RunFolders::FreeName(Timestamp begins_at) const {
  const auto seconds = static_cast<std::time_t>(begins_at.ns / 1'000'000'000);
  const std::string first = fmt::format("rail_{:%Y%m%d_%H%M%S}", fmt::gmtime(seconds));
  const auto is_taken = [&](const std::string& name) {
    std::error_code ignored;
    for (const std::string& path : {RunPath(name), LinePath(name)}) {
      if (fs::exists(path, ignored) || fs::exists(path + std::string(kUnfinished), ignored)) {
        return true;
      }
    }
    return false;
  };
  std::string name = first;
  for (int number = 2; is_taken(name); ++number) name = fmt::format("{}_{}", first, number);
  return name;
}

std::vector<std::string> RunFolders::CleanUp() const {
  std::error_code ignored;
  for (const std::string& path : UnfinishedIn(lines_)) fs::remove_all(path, ignored);
  return UnfinishedIn(runs_);
}

}  // namespace tbm
