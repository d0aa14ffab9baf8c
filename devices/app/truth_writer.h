#pragma once

#include <cstdio>
#include <memory>
#include <string>

#include "devices/sim/world.h"

namespace tbm {

// Writes what was true at each exposure, in the layout of a recorded run's truth.csv, so that poses
// published by the product can be compared with it; of a world with a tunnel also where the shields
// were, in NAME_shields.csv beside it. One thread.
class TruthWriter {
 public:
  // An empty path writes nothing.
  TruthWriter(const std::string& path, std::shared_ptr<const sim::World> world);

  bool is_open() const { return file_ && (shields_ || !world_->has_tunnel()); }
  void Write(Timestamp sensed_at);

 private:
  struct CloseFile {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::shared_ptr<const sim::World> world_;
  using File = std::unique_ptr<std::FILE, CloseFile>;
  static File Open(const std::string& path);
  void WriteShields(Timestamp sensed_at);

  File file_;
  File shields_;
};

}  // namespace tbm
