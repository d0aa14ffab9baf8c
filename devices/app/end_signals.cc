#include "devices/app/end_signals.h"

#include <cerrno>
#include <cmath>
#include <csignal>
#include <ctime>

#include <unistd.h>

namespace tbm {
namespace {

sigset_t EndSignals() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGINT);
  sigaddset(&set, SIGTERM);
  return set;
}

}  // namespace

void HoldSignals() {
  const sigset_t set = EndSignals();
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
}

void WaitForEnd(double run_for_s) {
  const sigset_t set = EndSignals();
  if (run_for_s <= 0.0) {
    int signal = 0;
    sigwait(&set, &signal);
    return;
  }
  const double whole_s = std::floor(run_for_s);
  const timespec limit{static_cast<std::time_t>(whole_s),
                       static_cast<long>((run_for_s - whole_s) * 1e9)};
  while (sigtimedwait(&set, nullptr, &limit) < 0 && errno == EINTR) {
  }
}

void EndTheWait() { kill(getpid(), SIGTERM); }

}  // namespace tbm
