#pragma once

#include <functional>
#include <memory>
#include <stop_token>
#include <string>

#include "guidance/app/exit_code.h"
#include "guidance/app/rail_run.h"
#include "guidance/app/run_folders.h"
#include "guidance/config/rail_line_file.h"
#include "idl/cpp/alarm.h"
#include "idl/cpp/participant.h"
#include "pose/base/clock.h"

namespace tbm {

// The trolley's process, for one run: follows it live, keeps what is measured, and when the run has
// ended makes its line from what was kept, by the way of `tbm line`. The line appears whole or not
// at all, and goes out on DDS.
//
// Threads: DDS' own, which only put commands into an inbox; one that makes the line; and the
// caller's, which does everything else.
class RailLineProcess {
 public:
  // What stands beside the measurements, as texts: rail.yaml, targets.csv (may be empty).
  struct Texts {
    std::string rail_yaml;
    std::string targets_csv;
  };

  // All outlive the process. `run`: the one that is played; of instruments its setup and targets.
  // `folders`: those of the config, taken for this process; released when the line is made.
  RailLineProcess(const RailLineConfig& config,
                  const RailRun& run,
                  const Texts& texts,
                  RunFolders& folders,
                  dds::Participant& participant,
                  const Clock& clock);
  ~RailLineProcess();

  // Until the run has ended, by itself, by `stop`, or by the command end_run; and the line is made,
  // told and held (`publish.hold_s`, a second at most where `stop` asks). kBadInput: there is no
  // line, the reason has been told.
  ExitCode Run(const std::stop_token& stop, const std::function<void()>& on_alive = {});

  // What DDS complains of; goes out as an event. From any thread.
  void Report(const dds::Alarm& alarm);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tbm
