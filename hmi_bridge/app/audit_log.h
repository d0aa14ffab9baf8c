#pragma once

#include <cstdint>
#include <mutex>
#include <string>

#include "hmi_bridge/server/console_source.h"
#include "pose/base/time.h"

namespace tbm::hmi {

// Who asked for what and what came of it, a line of JSON each, on the disk before the command goes
// out. Safe from several threads. Bounded: at `limit_bytes` the file is renamed to `.1`, and the
// one of that name goes.
class AuditLog {
 public:
  AuditLog(std::string file, std::int64_t limit_bytes);
  ~AuditLog();
  AuditLog(const AuditLog&) = delete;
  AuditLog& operator=(const AuditLog&) = delete;

  // False when it could not be written: then nothing is to be done in anybody's name.
  bool Add(Timestamp at,
           const std::string& user,
           Role role,
           const CommandRequest& request,
           const std::string& outcome);

 private:
  bool OpenFile();

  const std::string file_;
  const std::int64_t limit_bytes_;
  std::mutex mutex_;  // guards all below
  int descriptor_ = -1;
  std::int64_t size_bytes_ = 0;
};

}  // namespace tbm::hmi
