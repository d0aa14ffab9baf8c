#include "devices/app/service_run.h"

#include <thread>

#include "devices/app/end_signals.h"
#include "pose/app/service_manager.h"

namespace tbm {

void RunService(const Clock& clock, const ServiceLoop& loop) {
  std::stop_source stop;
  std::jthread ending([&stop] {
    WaitForEnd(0.0);
    stop.request_stop();
  });
  ServiceManager manager(clock);
  loop(stop.get_token(), [&manager] { manager.TellAlive(); });
  manager.TellStopping();
  if (!stop.stop_requested()) EndTheWait();
}

}  // namespace tbm
