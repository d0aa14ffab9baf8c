#pragma once

#include <string>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"
#include "pose/solve/problem.h"

namespace tbm {

struct SolveRequest {
  std::string run;  // folder
  std::string out;
  PoseMethod method = PoseMethod::kFused;
  bool as_json = false;
  bool force = false;
  int threads = 0;  // that decode images; 0: one per core. The poses do not depend on it.
};

// A pose for each row of frames.csv.
ExitCode RunSolve(const SolveRequest& request, const Console& console);

// The bright spots of each frame, and which LED each is.
ExitCode RunCentres(const SolveRequest& request, const Console& console);

}  // namespace tbm
