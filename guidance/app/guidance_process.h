#pragma once

#include <functional>
#include <memory>
#include <stop_token>

#include "guidance/config/guidance_file.h"
#include "idl/cpp/participant.h"
#include "pose/base/clock.h"

namespace tbm {

// The guidance: listens to camera box and total station, takes a step for each relative pose and at
// least five a second, publishes what the operator steers by, and keeps the journal. Starts without
// its neighbours and says who is missing.
//
// Threads: DDS' own, which only put messages into an inbox or a journal queue; the journal's; and
// the caller's, which takes the steps.
class GuidanceProcess {
 public:
  // All outlive the process.
  GuidanceProcess(const GuidanceConfig& config,
                  const GuidedMachine& machine,
                  dds::Participant& participant,
                  const Clock& clock);
  ~GuidanceProcess();

  // Until `stop` is asked for. `on_alive` (may be empty) is called with each step.
  void Run(const std::stop_token& stop, const std::function<void()>& on_alive = {});

  // What DDS complains of; goes out as an event. From any thread.
  void Report(const dds::Alarm& alarm);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tbm
