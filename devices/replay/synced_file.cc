#include "devices/replay/synced_file.h"

#include <cerrno>
#include <cstdio>

#include <fcntl.h>
#include <sys/statvfs.h>
#include <unistd.h>

namespace tbm {

int SyncedFile::Create(const std::string& path) {
  Close();
  descriptor_ = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, 0644);
  size_bytes_ = 0;
  return descriptor_ < 0 ? errno : 0;
}

int SyncedFile::Append(std::string_view piece) {
  if (!is_open()) return EBADF;
  std::string_view rest = piece;
  while (!rest.empty()) {
    const ssize_t written = ::write(descriptor_, rest.data(), rest.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) {
      const int error = written < 0 ? errno : ENOSPC;
      // When even this fails, the reader finds a last line without LF and passes it over.
      if (::ftruncate(descriptor_, size_bytes_) != 0) return error;
      return error;
    }
    rest.remove_prefix(static_cast<std::size_t>(written));
  }
  size_bytes_ += static_cast<std::int64_t>(piece.size());
  return 0;
}

int SyncedFile::Sync() {
  if (!is_open()) return EBADF;
  return ::fdatasync(descriptor_) == 0 ? 0 : errno;
}

void SyncedFile::Close() {
  if (descriptor_ >= 0) ::close(descriptor_);
  descriptor_ = -1;
}

int WriteWhole(const std::string& path, std::string_view bytes) {
  const std::string beside = path + ".part";
  ::unlink(beside.c_str());
  SyncedFile file;
  int error = file.Create(beside);
  if (error == 0) error = file.Append(bytes);
  if (error == 0) error = file.Sync();
  file.Close();
  if (error == 0 && std::rename(beside.c_str(), path.c_str()) != 0) error = errno;
  if (error != 0) ::unlink(beside.c_str());
  return error;
}

int SyncFolder(const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return errno;
  const int error = ::fsync(descriptor) == 0 ? 0 : errno;
  ::close(descriptor);
  return error;
}

std::int64_t FreeBytes(const std::string& path) {
  struct statvfs disk = {};
  if (::statvfs(path.c_str(), &disk) != 0) return -1;
  return static_cast<std::int64_t>(disk.f_bavail) * static_cast<std::int64_t>(disk.f_frsize);
}

bool MeansFull(int error) { return error == ENOSPC || error == EDQUOT || error == EFBIG; }

}  // namespace tbm
