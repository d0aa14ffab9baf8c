#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "pose/centres/assign_leds.h"
#include "tests/support/random.h"
#include "tests/support/scene.h"

namespace tbm::test {

enum class FalseSpots {
  kUniform,    // anywhere in the image
  kClustered,  // around the target, within about its own size
  kMirrored,   // each LED seen in wet steel: reflected in a horizontal, then in a vertical plane
  kGhosts,     // one beside each visible LED, 4 to 16 px away
};

struct DrawOptions {
  int least_visible = 4;
  int most_visible = 5;
  FalseSpots kind = FalseSpots::kUniform;
  int least_false = 10;
  int most_false =
      10;  // kMirrored and kGhosts make as many as their rule gives, and no more than this
  double centre_sigma_px = 0.1;
  double tilt_sigma_rad = 8.7266e-5;  // 0.005 degree
  double mirror_jitter_px = 2.0;
  // A prior drawn around the truth with these sigmas; none when zero.
  double prior_rotation_sigma_rad = 0.0;
  double prior_translation_sigma_m = 0.0;
  TruthRange range;
};

// That many LEDs visible and that many false spots, otherwise as above.
DrawOptions Visible(int least, int most, FalseSpots kind, int false_spots);

// The same with a prior of 1 mrad and 2 mm.
DrawOptions WithPrior(DrawOptions options);

// FieldRig with everything a field calibration leaves uncertain, and one draw of those errors.
Rig DeclaredRig();
Rig AsBuilt(const Rig& declared, Random& random);

// What one frame shows: spots in random order, and which of them is which LED.
struct Draw {
  Truth truth;
  Centres centres;
  std::vector<int> led_of_spot;  // -1: none
  std::optional<TiltObservation> target_tilt;
  std::optional<TiltObservation> camera_tilt;
  std::optional<PosePrior> prior;
};

// `as_built` makes the image; the caller solves with a rig of its own.
Draw DrawFrame(const Rig& as_built, const DrawOptions& options, Random& random);

enum class Answer { kRight, kAmbiguous, kNoMatch, kWrong };
// Right: every LED used stands on its own spot. Wrong: any LED stands on another.
Answer AnswerTo(const Draw& draw, const Result<Assignment, AssignFailure>& result);

struct Tally {
  int draws = 0;
  int right = 0;
  int ambiguous = 0;
  int no_match = 0;
  int wrong = 0;
  int leds_missed = 0;  // visible but not used, in right answers
  void Add(Answer answer);
  double RightShare() const { return static_cast<double>(right) / draws; }
  double WrongShare() const { return static_cast<double>(wrong) / draws; }
};

// Draws `count` frames from the stream of that name and assigns each.
Tally AssignDraws(const Rig& as_built,
                  const Rig& rig,
                  const DrawOptions& options,
                  int count,
                  std::string_view stream);

// What ctest prints beside each statistical test.
void Print(std::string_view name, const Tally& tally);

}  // namespace tbm::test
