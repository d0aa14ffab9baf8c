#pragma once

#include <chrono>

#include "pose/base/clock.h"

namespace tbm {

// What systemd hears of the process (sd_notify): that it runs, and that all its loops go round.
// Says nothing when no service manager listens. One thread.
class ServiceManager {
 public:
  explicit ServiceManager(const Clock& clock) : clock_(clock) {}

  // Call it about ten times a second while all is well: the first time the service counts as
  // started, and twice a second the watchdog is fed.
  void TellAlive();
  void TellStopping();

 private:
  const Clock& clock_;
  bool is_started_ = false;
  std::chrono::steady_clock::time_point fed_at_{};
};

}  // namespace tbm
