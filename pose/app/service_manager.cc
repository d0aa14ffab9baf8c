#include "pose/app/service_manager.h"

#include <systemd/sd-daemon.h>

namespace tbm {

void ServiceManager::TellAlive() {
  constexpr std::chrono::milliseconds kBetweenFeedings(500);
  const auto now = clock_.Steady();
  if (is_started_ && now - fed_at_ < kBetweenFeedings) return;
  sd_notify(0, is_started_ ? "WATCHDOG=1" : "READY=1\nWATCHDOG=1");
  is_started_ = true;
  fed_at_ = now;
}

void ServiceManager::TellStopping() { sd_notify(0, "STOPPING=1"); }

}  // namespace tbm
