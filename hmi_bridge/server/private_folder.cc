#include "hmi_bridge/server/private_folder.h"

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

namespace tbm::hmi {
namespace {

constexpr std::size_t kMostBytes = 4u << 20;

FileStamp StampFrom(const struct stat& status) {
  return {true,
          static_cast<std::uint64_t>(status.st_ino),
          static_cast<std::int64_t>(status.st_mtim.tv_sec) * 1'000'000'000 + status.st_mtim.tv_nsec,
          static_cast<std::int64_t>(status.st_size)};
}

std::string Sentence(const std::string& path, const char* what, int error) {
  return fmt::format("{}: {}: {}", path, what, std::strerror(error));
}

// Root does the work of the folder's owner, who must be able to read it afterwards.
bool IsOwnedByUs(const struct stat& status) {
  return status.st_uid == ::geteuid() || ::geteuid() == 0;
}

int WriteAll(int descriptor, std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(descriptor, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return written < 0 ? errno : ENOSPC;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  return 0;
}

int SyncNames(const std::string& folder) {
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return errno;
  const int error = ::fsync(descriptor) == 0 ? 0 : errno;
  ::close(descriptor);
  return error;
}

}  // namespace

Result<PrivateFolder, std::string> PrivateFolder::Open(const std::string& path) {
  if (path.empty()) return Failure{std::string("the state folder has no name")};
  if (::mkdir(path.c_str(), 0700) != 0 && errno != EEXIST) {
    return Failure{Sentence(path, "cannot be made", errno)};
  }
  struct stat status = {};
  if (::stat(path.c_str(), &status) != 0) return Failure{Sentence(path, "cannot be read", errno)};
  if (!S_ISDIR(status.st_mode)) return Failure{path + ": is not a folder"};
  if (!IsOwnedByUs(status)) {
    return Failure{path + ": belongs to another user: run the bridge as its owner"};
  }
  if ((status.st_mode & 077) != 0) {
    return Failure{fmt::format("{0}: others may read or change it: chmod 700 {0}", path)};
  }
  return PrivateFolder(path);
}

Result<std::optional<PrivateFolder::Content>, std::string> PrivateFolder::Read(
    std::string_view name) const {
  const std::string path = PathOf(name);
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (descriptor < 0 && errno == ENOENT) return std::optional<Content>();
  if (descriptor < 0) return Failure{Sentence(path, "cannot be read", errno)};
  struct stat status = {};
  Content content;
  std::string fault;
  if (::fstat(descriptor, &status) != 0) {
    fault = Sentence(path, "cannot be read", errno);
  } else if (!S_ISREG(status.st_mode)) {
    fault = path + ": is not a file";
  } else if (!IsOwnedByUs(status)) {
    fault = path + ": belongs to another user: run the bridge as its owner";
  } else if ((status.st_mode & 077) != 0) {
    fault = fmt::format("{0}: others may read or change it: chmod 600 {0}", path);
  } else if (static_cast<std::uint64_t>(status.st_size) > kMostBytes) {
    fault = fmt::format("{}: has {} bytes, at most {} are read", path, status.st_size, kMostBytes);
  }
  while (fault.empty()) {
    std::array<char, 16384> piece{};
    const ssize_t count = ::read(descriptor, piece.data(), piece.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fault = Sentence(path, "cannot be read", errno);
    if (count <= 0) break;
    content.text.append(piece.data(), static_cast<std::size_t>(count));
    if (content.text.size() > kMostBytes) fault = path + ": grows while it is read";
  }
  ::close(descriptor);
  if (!fault.empty()) return Failure{fault};
  content.stamp = StampFrom(status);
  return std::optional<Content>(std::move(content));
}

FileStamp PrivateFolder::StampOf(std::string_view name) const {
  struct stat status = {};
  if (::lstat(PathOf(name).c_str(), &status) != 0) return {};
  return StampFrom(status);
}

std::optional<std::string> PrivateFolder::Write(std::string_view name,
                                                std::string_view text) const {
  const std::string path = PathOf(name);
  const std::string beside = path + ".part";
  struct stat folder = {};
  if (::stat(path_.c_str(), &folder) != 0) return Sentence(path_, "cannot be read", errno);
  ::unlink(beside.c_str());
  const int descriptor =
      ::open(beside.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (descriptor < 0) return Sentence(beside, "cannot be made", errno);
  int error = WriteAll(descriptor, text);
  const bool is_for_another = ::geteuid() == 0 && folder.st_uid != 0;
  if (error == 0 && is_for_another && ::fchown(descriptor, folder.st_uid, folder.st_gid) != 0) {
    error = errno;
  }
  if (error == 0 && ::fsync(descriptor) != 0) error = errno;
  ::close(descriptor);
  if (error == 0 && std::rename(beside.c_str(), path.c_str()) != 0) error = errno;
  if (error != 0) ::unlink(beside.c_str());
  if (error == 0) error = SyncNames(path_);
  if (error != 0) return Sentence(path, "cannot be written", error);
  return std::nullopt;
}

std::optional<std::string> PrivateFolder::Remove(std::string_view name) const {
  const std::string path = PathOf(name);
  if (::unlink(path.c_str()) == 0 || errno == ENOENT) return std::nullopt;
  return Sentence(path, "cannot be removed", errno);
}

PrivateFolder::Lock::Lock(const PrivateFolder& folder) {
  // On the folder itself: a file for it would be one more thing to own and to clean up.
  descriptor_ = ::open(folder.path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor_ < 0) return;
  int outcome = 0;
  do {
    outcome = ::flock(descriptor_, LOCK_EX);
  } while (outcome != 0 && errno == EINTR);
  if (outcome == 0) return;
  ::close(descriptor_);
  descriptor_ = -1;
}

PrivateFolder::Lock::~Lock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

}  // namespace tbm::hmi
