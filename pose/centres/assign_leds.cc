#include "pose/centres/assign_leds.h"

#include <algorithm>

#include "pose/centres/assign_judge.h"
#include "pose/centres/assign_scene.h"
#include "pose/centres/assign_search.h"

namespace tbm {
namespace {

using namespace assign;

// What image and tilts say on their own.
Decision DecideByImage(const Scene& scene, const Candidates& by_image, bool any_basis) {
  Decision decision = Decide(scene, by_image, UsePrior::kNo);
  if (decision.outcome == Outcome::kNone && any_basis) decision.outcome = Outcome::kAmbiguous;
  return decision;
}

// One that has every LED of the rig and agrees with the prior: its rivals must have as many, and
// with sharp tilts the image alone has brought them all.
bool ExplainsAll(const Scene& scene, const Candidates& by_prior) {
  if (!scene.ups_are_sharp || by_prior.size() == 0) return false;
  const Candidate& best = by_prior[0];
  const std::size_t leds = scene.rig->leds.size();
  const double dof = 2.0 * static_cast<double>(leds) + 2.0;
  return best.matches.size() == leds && best.fit.chi2 <= Chi2Gate(dof, scene.options.gate_sigma);
}

Decision DecideByPrior(const Scene& scene, const Candidates& by_image) {
  Candidates by_prior;
  for (const Candidate& seen : by_image) {
    Candidate candidate = seen;
    if (Refine(scene, candidate.matches, UsePrior::kYes, candidate.fit)) by_prior.Offer(candidate);
  }
  if (!ExplainsAll(scene, by_prior)) SearchByPrior(scene, by_prior);
  return Decide(scene, by_prior, UsePrior::kYes);
}

Assignment AssignmentOf(const Scene& scene,
                        const Centres& centres,
                        const Verdict& verdict,
                        bool used_prior) {
  Assignment assignment;
  for (const Match& match : verdict.matches) {
    const int index = scene.spots[static_cast<std::size_t>(match.spot)].index;
    const Centre& centre = centres[static_cast<std::size_t>(index)];
    assignment.leds.push_back({match.led, centre.pixel_px, centre.sigma_px});
    assignment.spot_of_led.push_back(index);
  }
  assignment.camera_from_target = verdict.camera_from_target;
  assignment.used_prior = used_prior;
  assignment.without_tilts = !scene.ups_are_sharp;
  return assignment;
}

// Four LEDs that agree outweigh any prior: the machine may have been moved while nobody looked.
bool OutweighsPrior(const Decision& by_image, const Decision& by_prior) {
  const std::size_t leds = by_image.best.matches.size();
  return leds >= 4 && leds > by_prior.best.matches.size();
}

// Three LEDs that agree with wrong tilts by chance, while four agree among themselves.
bool ImageContradictsTilts(const Scene& scene, const Decision& by_image) {
  if (!scene.ups_are_sharp || by_image.best.matches.size() > 3 || scene.spots.size() < 4)
    return false;
  Candidates doubting;
  SearchByVision(Doubting(scene), doubting);
  return std::any_of(doubting.begin(), doubting.end(), [&](const Candidate& candidate) {
    return !Contains(candidate.matches, by_image.best.matches);
  });
}

Result<Assignment, AssignFailure> AssignIn(const Scene& scene, const Centres& centres) {
  const std::size_t fewest = scene.ups_are_sharp ? 2 : 3;
  if (scene.spots.size() < fewest) return Failure{AssignFailure::kTooFewCentres};

  Candidates by_image;
  bool any_basis = false;
  if (scene.ups_are_sharp) any_basis = SearchByTilts(scene, by_image);
  Decision prior_says;
  if (scene.prior) prior_says = DecideByPrior(scene, by_image);
  const bool prior_clear = prior_says.outcome == Outcome::kClear;
  if (!scene.ups_are_sharp) {
    if (prior_clear) return AssignmentOf(scene, centres, prior_says.best, true);
    any_basis = SearchByVision(scene, by_image);
  }
  const Decision image_says = DecideByImage(scene, by_image, any_basis);

  if (image_says.outcome == Outcome::kClear) {
    const bool same = prior_clear && SameMatches(image_says.best.matches, prior_says.best.matches);
    if (same || (prior_clear && OutweighsPrior(image_says, prior_says))) {
      return AssignmentOf(scene, centres, image_says.best, false);
    }
    if (prior_clear || ImageContradictsTilts(scene, image_says)) {
      return Failure{AssignFailure::kAmbiguous};
    }
    return AssignmentOf(scene, centres, image_says.best, false);
  }
  if (prior_clear) return AssignmentOf(scene, centres, prior_says.best, true);
  return Failure{image_says.outcome == Outcome::kAmbiguous ? AssignFailure::kAmbiguous
                                                           : AssignFailure::kNoMatch};
}

}  // namespace

Result<Assignment, AssignFailure> AssignLeds(const Rig& rig,
                                             const Centres& centres,
                                             const std::optional<TiltObservation>& target_tilt,
                                             const std::optional<TiltObservation>& camera_tilt,
                                             const std::optional<PosePrior>& prior,
                                             const AssignOptions& options) {
  return AssignIn(MakeScene(rig, centres, target_tilt, camera_tilt, prior, options), centres);
}

Result<Assignment, AssignFailure> AssignLedsDoubtingTilts(
    const Rig& rig,
    const Centres& centres,
    const std::optional<TiltObservation>& target_tilt,
    const std::optional<TiltObservation>& camera_tilt,
    const std::optional<PosePrior>& prior,
    const AssignOptions& options) {
  const Scene scene = MakeScene(rig, centres, target_tilt, camera_tilt, prior, options);
  return AssignIn(Doubting(scene), centres);
}

}  // namespace tbm
