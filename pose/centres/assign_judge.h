#pragma once

#include "pose/centres/assign_search.h"

namespace tbm::assign {

// An explanation measured with everything the rig declares uncertain.
struct Verdict {
  Matches matches;
  Rigid3 camera_from_target;
  double chi2 = 0.0;
  int dof = 0;
  // Natural logarithm of how many explanations with as many LEDs and no larger chi2 are expected
  // when every spot is false and lies anywhere among the others.
  double log_chance = 0.0;
};

enum class Outcome { kNone, kAmbiguous, kClear };

struct Decision {
  Outcome outcome = Outcome::kNone;
  Verdict best;  // set unless kNone
};

// Most LEDs first, then smallest chi2; ambiguous when another explanation with as many LEDs is
// close, or when as good a one is likely enough by chance.
Decision Decide(const Scene& scene, const Candidates& candidates, UsePrior use_prior);

}  // namespace tbm::assign
