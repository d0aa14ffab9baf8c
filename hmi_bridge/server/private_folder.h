#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "pose/base/result.h"

namespace tbm::hmi {

// Tells whether a file is still the one that was read.
struct FileStamp {
  bool exists = false;
  std::uint64_t inode = 0;
  std::int64_t modified_ns = 0;
  std::int64_t size_bytes = 0;

  bool operator==(const FileStamp&) const = default;
};

// A folder that nobody but its owner may read or write, and small files in it that are written
// whole or not at all. Errors are sentences that name the file and what to do.
class PrivateFolder {
 public:
  // Makes the folder when it is missing (its parent is there).
  static Result<PrivateFolder, std::string> Open(const std::string& path);

  const std::string& path() const { return path_; }
  std::string PathOf(std::string_view name) const { return path_ + "/" + std::string(name); }

  struct Content {
    std::string text;
    FileStamp stamp;
  };
  // Empty when there is no such file.
  Result<std::optional<Content>, std::string> Read(std::string_view name) const;
  FileStamp StampOf(std::string_view name) const;
  // Through a power cut: written beside, synced, renamed, the folder's names synced. Empty: done.
  std::optional<std::string> Write(std::string_view name, std::string_view text) const;
  std::optional<std::string> Remove(std::string_view name) const;

  // Held while one process reads, changes and writes; another one waits.
  class Lock {
   public:
    explicit Lock(const PrivateFolder& folder);
    ~Lock();
    Lock(const Lock&) = delete;
    Lock& operator=(const Lock&) = delete;
    bool is_held() const { return descriptor_ >= 0; }

   private:
    int descriptor_ = -1;
  };

 private:
  explicit PrivateFolder(std::string path) : path_(std::move(path)) {}

  std::string path_;
};

}  // namespace tbm::hmi
