#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace tbm {

// A file that is only ever appended to, whole pieces at a time. Errors are errno values, 0 is fine.
class SyncedFile {
 public:
  SyncedFile() = default;
  ~SyncedFile() { Close(); }
  SyncedFile(const SyncedFile&) = delete;
  SyncedFile& operator=(const SyncedFile&) = delete;

  // Makes a new file; one that is there already is an error.
  int Create(const std::string& path);
  // Appends all of `piece` or nothing: a part that was written is taken back.
  int Append(std::string_view piece);
  int Sync();
  void Close();

  bool is_open() const { return descriptor_ >= 0; }
  std::int64_t size_bytes() const { return size_bytes_; }

 private:
  int descriptor_ = -1;
  std::int64_t size_bytes_ = 0;
};

// A file that appears under its name only whole: written beside it, brought to the disk, renamed.
// On an error nothing of it is left.
int WriteWhole(const std::string& path, std::string_view bytes);

// Brings the names in a folder to the disk.
int SyncFolder(const std::string& path);

// Bytes free for us on the disk that holds `path`; -1 when that cannot be told.
std::int64_t FreeBytes(const std::string& path);

// Whether an errno says that there is no room (disk, quota, limit on file size).
bool MeansFull(int error);

}  // namespace tbm
