#pragma once

#include <cstdint>
#include <string>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"

namespace tbm {

struct StudyRequest {
  std::string out = "published_study";  // folder
  int draws = 1000;                     // of each noise level
  std::uint64_t seed = 1;
  int threads = 0;  // 0: one per core. The figures do not depend on it.
  bool force = false;
};

// Repeats the simulation of the pose paper's section 4.1 with all three estimators and writes
// study.csv, study.txt, and study_rmse.png and study_mean.png in the manner of its Fig. 3.
ExitCode RunStudy(const StudyRequest& request, const Console& console);

}  // namespace tbm
