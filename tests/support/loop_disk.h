#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

#include <unistd.h>

namespace tbm::test {

inline bool Runs(const std::string& command) { return std::system(command.c_str()) == 0; }

// Disks for trying what a power cut leaves: a file with a journalling file system in it, mounted by
// a loop device. A cut is a copy of that file, taken while the writer stands still and nothing has
// been flushed for the occasion. Needs root.
class LoopDisk {
 public:
  // Makes an empty ext4 of that size; false when it cannot be made.
  static bool Make(const std::string& file, const std::string& size) {
    return Runs("truncate -s " + size + " '" + file + "' && mkfs.ext4 -q '" + file + "'");
  }

  LoopDisk(std::string file, std::string place) : file_(std::move(file)), place_(std::move(place)) {
    std::filesystem::create_directories(place_);
    is_mounted_ = Runs("mount -o loop '" + file_ + "' '" + place_ + "' 2>/dev/null");
  }
  ~LoopDisk() {
    if (is_mounted_) Runs("umount '" + place_ + "'");
  }
  LoopDisk(const LoopDisk&) = delete;
  LoopDisk& operator=(const LoopDisk&) = delete;

  bool is_mounted() const { return is_mounted_; }
  const std::string& place() const { return place_; }

 private:
  std::string file_;
  std::string place_;
  bool is_mounted_ = false;
};

}  // namespace tbm::test
