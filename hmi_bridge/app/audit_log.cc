#include "hmi_bridge/app/audit_log.h"

#include <cstdio>
#include <utility>

#include <fcntl.h>
#include <nlohmann/json.hpp>
#include <sys/stat.h>
#include <unistd.h>

#include "hmi_bridge/server/auth_files.h"

namespace tbm::hmi {
namespace {

bool WriteAll(int descriptor, const std::string& text) {
  std::size_t done = 0;
  while (done < text.size()) {
    const ssize_t written = write(descriptor, text.data() + done, text.size() - done);
    if (written <= 0) return false;
    done += static_cast<std::size_t>(written);
  }
  return fdatasync(descriptor) == 0;
}

}  // namespace

AuditLog::AuditLog(std::string file, std::int64_t limit_bytes)
    : file_(std::move(file)), limit_bytes_(limit_bytes) {}

AuditLog::~AuditLog() {
  if (descriptor_ >= 0) close(descriptor_);
}

bool AuditLog::OpenFile() {
  if (descriptor_ >= 0) return true;
  descriptor_ = open(file_.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
  if (descriptor_ < 0) return false;
  struct stat facts {};
  size_bytes_ = fstat(descriptor_, &facts) == 0 ? facts.st_size : 0;
  // A line that a power cut has cut in two is ended, so that the next one stands alone.
  if (size_bytes_ == 0) return true;
  const int reader = open(file_.c_str(), O_RDONLY | O_CLOEXEC);
  char last = '\n';
  if (reader >= 0) {
    if (pread(reader, &last, 1, size_bytes_ - 1) != 1) last = '\n';
    close(reader);
  }
  return last == '\n' || WriteAll(descriptor_, "\n");
}

bool AuditLog::Add(Timestamp at,
                   const std::string& user,
                   Role role,
                   const CommandRequest& request,
                   const std::string& outcome) {
  nlohmann::ordered_json line = {{"at_utc_ns", at.ns},
                                 {"user", user},
                                 {"role", std::string(Word(role))},
                                 {"addressee", request.addressee},
                                 {"verb", request.verb},
                                 {"argument", request.argument},
                                 {"because", request.because},
                                 {"outcome", outcome}};
  const std::string text =
      line.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
  const std::lock_guard lock(mutex_);
  if (!OpenFile()) return false;
  if (size_bytes_ + static_cast<std::int64_t>(text.size()) > limit_bytes_ && size_bytes_ > 0) {
    close(std::exchange(descriptor_, -1));
    if (std::rename(file_.c_str(), (file_ + ".1").c_str()) != 0 || !OpenFile()) return false;
  }
  size_bytes_ += static_cast<std::int64_t>(text.size());
  return WriteAll(descriptor_, text);
}

}  // namespace tbm::hmi
