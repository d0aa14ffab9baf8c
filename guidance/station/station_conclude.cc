// What a whole round comes to: a set-up, the verdict of a check, a station move.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "guidance/station/station_keeper.h"
#include "pose/base/check.h"
#include "pose/solve/tails.h"

namespace tbm {
namespace {

constexpr std::size_t kLeastReferences = 2;  // that a set-up or a check rests on
constexpr int kMostMissedChecks = 2;

std::string Mm(double metres) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f mm", 1e3 * metres);
  return text;
}

std::string Words(SetUpFailure failure) {
  switch (failure) {
    case SetUpFailure::kNoSuchReference:
    case SetUpFailure::kNotFinite:
      return "a reading or a reference is no number";
    case SetUpFailure::kTooFewSightings:
    case SetUpFailure::kNoStart:
      return "too few references were measured with a distance, or they stand at one place";
    case SetUpFailure::kWeakGeometry:
      return "the references that were measured leave a coordinate or the orientation uncertain";
    case SetUpFailure::kNotConverged:
    case SetUpFailure::kInconsistent:
      return "the references contradict each other, and leaving out no single one mends it";
  }
  return "unknown";
}

bool Contains(const std::vector<int>& numbers, int number) {
  return std::ranges::find(numbers, number) != numbers.end();
}

std::vector<int> SeenIn(const std::vector<ReferenceSighting>& sightings) {
  std::vector<int> seen;
  for (const ReferenceSighting& sighting : sightings) {
    if (!Contains(seen, sighting.reference)) seen.push_back(sighting.reference);
  }
  return seen;
}

std::vector<ReferenceSighting> Without(std::vector<ReferenceSighting> sightings,
                                       const std::vector<int>& references) {
  std::erase_if(sightings, [&](const ReferenceSighting& sighting) {
    return Contains(references, sighting.reference);
  });
  return sightings;
}

std::vector<int> MovedIn(const KeptSetUp& kept) {
  std::vector<int> moved;
  for (std::size_t i = 0; i < kept.references.size(); ++i) {
    if (kept.references[i].reason == "moved") moved.push_back(static_cast<int>(i));
  }
  return moved;
}

}  // namespace

void StationKeeper::EndRound(Timestamp now) {
  const Round ended = round_;
  switch (ended) {
    case Round::kSetUp:
      EndSetUp(now);
      break;
    case Round::kCheck:
      EndCheck(now);
      break;
    case Round::kPrisms:
      if (is_pausing_) pause_has_prisms_ = true;
      break;
    case Round::kMoveReferences:
      EndMoveReferences(now);
      break;
    case Round::kMovePrisms:
      EndMovePrisms();
      break;
    case Round::kNone:
      break;
  }
  if (ended == Round::kCheck && is_pausing_ && pause_has_prisms_) {
    is_pausing_ = false;
    is_paused_ = true;
    Say(KeeperNews::Kind::kPaused,
        health() == SetUpHealth::kGood
            ? "paused: the references are where they were, and the prisms are measured"
            : "paused, but the set-up is suspect: " + reason_);
  }
  round_ = Round::kNone;
  readings_.clear();
}

StationKeeper::RoundSightings StationKeeper::Sightings(const KeptSetUp* known) const {
  RoundSightings round;
  std::vector<const Reading*> singles;
  AxisErrors sum;
  int pairs = 0;
  for (const Reading& reading : readings_) {
    const auto other = std::ranges::find_if(readings_, [&](const Reading& candidate) {
      return candidate.target == reading.target && candidate.face != reading.face;
    });
    if (other == readings_.end()) {
      singles.push_back(&reading);
      continue;
    }
    if (reading.face == Face::kTwo) continue;  // joined with face one
    const auto faces =
        MeanOfFaces(reading.raw, other->raw, reading.to_be_added, options_.largest_axis_error_rad);
    if (!faces) continue;  // two different prisms
    sum.collimation_rad += faces->axis_errors.collimation_rad;
    sum.index_rad += faces->axis_errors.index_rad;
    ++pairs;
    round.sightings.push_back({reading.target.index, faces->mean, SigmaOf(faces->mean, {})});
  }
  AxisErrors axis_errors;
  if (pairs > 0) {
    round.shown = AxisErrors{sum.collimation_rad / pairs, sum.index_rad / pairs};
    axis_errors = *round.shown;
    round.axis_sigma_rad = options_.angle_sigma_rad * std::sqrt(0.5 / pairs);
  } else if (known != nullptr) {
    axis_errors = known->axis_errors;
    round.axis_sigma_rad = known->axis_sigma_rad;
  } else {
    return round;
  }
  for (const Reading* single : singles) {
    Reduction reduction = single->to_be_added;
    reduction.axis_errors = axis_errors;
    const PolarReading reading = Reduced(single->raw, reduction);
    round.sightings.push_back(
        {single->target.index, reading, SigmaOf(reading, round.axis_sigma_rad)});
  }
  return round;
}

Result<KeptSetUp, std::string> StationKeeper::Solve(const Station& start,
                                                    bool with_known,
                                                    Timestamp now) const {
  KeptSetUp kept;
  RoundSightings round = Sightings(nullptr);
  if (!round.shown) return Failure{std::string("no reference was measured in both faces")};
  kept.sightings = std::move(round.sightings);
  kept.axis_errors = *round.shown;
  kept.axis_sigma_rad = round.axis_sigma_rad;
  std::vector<int> controls;
  for (std::size_t i = 0; i < options_.references.size(); ++i) {
    if (options_.references[i].is_control) controls.push_back(static_cast<int>(i));
  }
  const auto used = Without(kept.sightings, controls);
  StationPrior prior;
  if (with_known) prior = {options_.start, options_.known};
  const auto solved = SolveSetUp(references_, used, prior, options_.set_up);
  if (!solved) return Failure{Words(solved.error())};
  if (solved->dof < 1) return Failure{std::string("nothing checks the set-up: one reference more")};
  const double off_m = (solved->station.p_axes_in_site - start.p_axes_in_site).norm();
  const double off_rad =
      std::abs(HalfTurn(solved->station.circle_zero_bearing_rad - start.circle_zero_bearing_rad));
  if (off_m > options_.start_within_m || off_rad > options_.start_within_rad) {
    return Failure{"it comes out " + Mm(off_m) +
                   " from where it was said to stand, or turned: references taken for each other?"};
  }
  kept.number = state_.last_number + 1;
  kept.station = solved->station;
  kept.covariance = solved->covariance;
  kept.set_up_at = now;
  kept.last_good_check_at = now;
  kept.chi2 = solved->chi2;
  kept.dof = solved->dof;
  kept.instrument = instrument_.value_or(0);
  kept.sees_m =
      CheckReferences(kept.station, references_, kept.sightings, kept.sightings, options_.check)
          .sees_m;
  for (std::size_t i = 0; i < options_.references.size(); ++i) {
    const int index = static_cast<int>(i);
    KeptReference row{options_.references[i].name, false, "not_seen", {}};
    for (const SightingResidual& residual : solved->residuals) {
      if (residual.reference != index) continue;
      row.is_used = solved->left_out != index;
      row.reason = row.is_used ? "" : "left_out";
      row.residual = residual;
    }
    if (Contains(controls, index) && Contains(SeenIn(kept.sightings), index)) {
      row.reason = "control";
    }
    kept.references.push_back(std::move(row));
  }
  UpdateRows(kept.sightings, &kept);
  return kept;
}

// The residuals as the newest readings show them. Those of the set-up carry what the others know of
// each; they stay where nothing newer is there.
void StationKeeper::UpdateRows(const std::vector<ReferenceSighting>& now, KeptSetUp* kept) const {
  for (const ReferenceSighting& sighting : now) {
    const auto place = static_cast<std::size_t>(sighting.reference);
    KeptReference& row = kept->references[place];
    const auto computed = Sight(kept->station, references_[place].p_in_site, options_.set_up.sight);
    if (!computed) continue;
    SightingResidual residual = row.residual.value_or(SightingResidual{});
    residual.reference = sighting.reference;
    residual.circle_rad = HalfTurn(sighting.reading.circle_rad - computed->circle_rad);
    residual.zenith_rad = sighting.reading.zenith_rad - computed->zenith_rad;
    residual.slope_m.reset();
    if (sighting.reading.slope_m) residual.slope_m = *sighting.reading.slope_m - *computed->slope_m;
    residual.across_m = residual.circle_rad * *computed->slope_m * std::sin(computed->zenith_rad);
    residual.up_m = -residual.zenith_rad * *computed->slope_m;
    row.residual = residual;
  }
}

void StationKeeper::EndSetUp(Timestamp now) {
  const Station start = *StationFor(Round::kSetUp);
  asked_start_.reset();
  auto solved = Solve(start, true, now);
  if (!solved) {
    if (!state_.in_use && reason_ != "other_instrument") reason_ = "not_set_up";
    Say(KeeperNews::Kind::kSetUpFailed, "no set-up: " + solved.error());
    return;
  }
  if (state_.in_use) state_.previous = std::move(state_.in_use);
  state_.last_number = solved->number;
  state_.in_use = std::move(solved).value();
  Settled(now);
  const Eigen::Vector3d sigma = state_.in_use->covariance.diagonal().head<3>().cwiseSqrt();
  Say(KeeperNews::Kind::kSetUpDone,
      "set up as number " + std::to_string(state_.in_use->number) + ", sigma " +
          Mm(sigma.maxCoeff()) + " in the worst coordinate");
}

// A set-up that was just measured: good, with nothing that belongs to the one before.
void StationKeeper::Settled(Timestamp now) {
  reason_.clear();
  ++revision_;
  next_check_ = now + options_.check_period;
  is_check_asked_ = false;
  last_verdict_ = CheckVerdict::kGood;
  station_shift_.reset();
  moved_once_.reset();
  must_be_seen_.clear();
  checks_missed_ = 0;
  watch_.Forget();
  std::fill(latest_.begin(), latest_.end(), std::nullopt);
}

void StationKeeper::EndCheck(Timestamp now) {
  TBM_CHECK(state_.in_use.has_value());
  KeptSetUp& kept = *state_.in_use;
  const RoundSightings round = Sightings(&kept);
  const auto& all = round.sightings;
  const std::vector<int> moved = MovedIn(kept);
  // Only what the set-up has seen can be compared with it.
  std::vector<int> passed_over = moved;
  for (const int reference : SeenIn(all)) {
    if (!Contains(SeenIn(kept.sightings), reference)) passed_over.push_back(reference);
  }
  const auto seen = Without(all, passed_over);
  for (std::size_t i = 0; i < kept.references.size(); ++i) {
    KeptReference& row = kept.references[i];
    const bool is_seen = Contains(SeenIn(all), static_cast<int>(i));
    if (!is_seen && row.reason.empty()) row.reason = "not_seen";
    if (is_seen && row.reason == "not_seen") row.reason = row.is_used ? "" : "not_in_set_up";
  }
  UpdateRows(all, &kept);
  ++revision_;
  if (is_pausing_ || health() == SetUpHealth::kSuspect) next_check_ = now + options_.doubt_period;

  const ReferenceCheck check =
      CheckReferences(kept.station, references_, kept.sightings, seen, options_.check);
  kept.sees_m = check.sees_m;
  last_verdict_ = check.verdict;
  station_shift_ = check.station_shift;
  const bool has_few = options_.references.size() < kLeastReferences;
  const bool is_weak = !has_few && (SeenIn(seen).size() < kLeastReferences || !check.sees_m ||
                                    *check.sees_m > options_.must_see_m);
  if (check.verdict == CheckVerdict::kNothingSeen) {
    CheckSaysNothing("references_not_seen");
  } else if (check.verdict != CheckVerdict::kGood) {
    CheckIsBad(check, seen);
  } else if (is_weak) {
    CheckSaysNothing("check_weak");
  } else {
    CheckIsGood(check, seen);
    // They drift with the instrument's temperature.
    if (round.shown && round.axis_sigma_rad <= kept.axis_sigma_rad) kept.axis_errors = *round.shown;
    for (const int index : moved) {
      // It stands as at the set-up again: it counts from the next check on.
      auto with = seen;
      for (const auto& sighting : all) {
        if (sighting.reference == index) with.push_back(sighting);
      }
      if (with.size() == seen.size()) continue;
      const auto again =
          CheckReferences(kept.station, references_, kept.sightings, with, options_.check);
      if (again.verdict == CheckVerdict::kGood) {
        kept.references[static_cast<std::size_t>(index)].reason.clear();
      }
    }
  }
}

void StationKeeper::CheckIsGood(const ReferenceCheck& check,
                                const std::vector<ReferenceSighting>& seen) {
  checks_missed_ = 0;
  moved_once_.reset();
  if (!reason_.empty()) {
    const std::vector<int> there = SeenIn(seen);
    const bool all_seen = std::ranges::all_of(
        must_be_seen_, [&](int reference) { return Contains(there, reference); });
    if (!all_seen || ChiSquaredTail(check.chi2, check.dof) < options_.lifting_risk) {
      is_check_asked_ = all_seen;  // once more at once: good, and not good enough to lift a doubt
      if (!all_seen)
        Say(KeeperNews::Kind::kCheckBad, "a reference that had disagreed was not seen");
      return;
    }
  }
  reason_.clear();
  must_be_seen_.clear();
  KeptSetUp& kept = *state_.in_use;
  // What moved while the check was under way is in some of its readings only.
  kept.last_good_check_at = std::max(kept.last_good_check_at, *first_reading_at_);
  next_check_ = round_began_ + options_.check_period;
  for (const auto& latest : latest_) {
    if (!latest || latest->at > *first_reading_at_) continue;
    std::erase_if(state_.controls, [&](const auto& old) { return old.name == latest->name; });
    state_.controls.push_back(*latest);
  }
  Say(KeeperNews::Kind::kCheckGood,
      "the references are where they were" +
          (check.sees_m ? "; a shift of " + Mm(*check.sees_m) + " would have been found" : ""));
}

void StationKeeper::CheckIsBad(const ReferenceCheck& check,
                               const std::vector<ReferenceSighting>& seen) {
  checks_missed_ = 0;
  for (const int reference : SeenIn(seen)) {
    if (!Contains(must_be_seen_, reference)) must_be_seen_.push_back(reference);
  }
  KeptSetUp& kept = *state_.in_use;
  const auto moved =
      check.verdict == CheckVerdict::kReferenceMoved ? check.moved_reference : std::nullopt;
  const bool is_confirmed = moved && moved_once_ == moved;
  // The first time it is measured once more, at once and in both faces.
  if (!is_confirmed) is_check_asked_ = reason_.empty() || moved != moved_once_;
  moved_once_ = moved;
  watch_.Forget();
  std::fill(latest_.begin(), latest_.end(), std::nullopt);
  if (is_confirmed) {
    const std::string name = kept.references[static_cast<std::size_t>(*moved)].name;
    const auto rest = Without(seen, {*moved});
    const auto again =
        CheckReferences(kept.station, references_, kept.sightings, rest, options_.check);
    const bool is_enough = SeenIn(rest).size() >= kLeastReferences && again.sees_m &&
                           *again.sees_m <= options_.must_see_m;
    kept.references[static_cast<std::size_t>(*moved)].reason = "moved";
    if (again.verdict == CheckVerdict::kGood && is_enough) {
      std::erase(must_be_seen_, *moved);
      kept.sees_m = again.sees_m;
      Say(KeeperNews::Kind::kCheckBad,
          "reference " + name + " has moved; the others stand, and the set-up rests on them");
      CheckIsGood(again, rest);
      return;
    }
    reason_ = "reference_disagrees";
    Say(KeeperNews::Kind::kCheckBad,
        "reference " + name + " has moved, and the others are too few to vouch for the station");
    return;
  }
  switch (check.verdict) {
    case CheckVerdict::kReferenceMoved:
      reason_ = "reference_disagrees";
      Say(KeeperNews::Kind::kCheckBad,
          "reference " + kept.references[static_cast<std::size_t>(*moved)].name +
              " disagrees with the others");
      return;
    case CheckVerdict::kStationMoved:
      reason_ = "station_moved";
      Say(KeeperNews::Kind::kCheckBad,
          "the station has moved by " + Mm(check.station_shift->head<3>().norm()) +
              " since the set-up");
      return;
    default:
      reason_ = "check_unclear";
      Say(KeeperNews::Kind::kCheckBad,
          "something has moved, and the references do not tell what it was");
      return;
  }
}

// No verdict either way: it is tried again soon, and after two in a row the set-up is suspect.
void StationKeeper::CheckSaysNothing(std::string_view why) {
  ++checks_missed_;
  next_check_ = round_began_ + options_.doubt_period;
  if (checks_missed_ >= kMostMissedChecks) Doubt(why);
  Say(KeeperNews::Kind::kCheckBad,
      why == "check_weak" ? "too few references were seen to vouch for the station"
                          : "no reference was seen");
}

StationKeeper::Asked StationKeeper::ProposeMove(const Station& start, Timestamp now) {
  if (!state_.in_use) {
    return Failure{std::string("there is no set-up to move from: ask for set_up")};
  }
  const bool has_control = std::ranges::any_of(state_.controls, [&](const ControlPoint& control) {
    return now - control.at <= options_.control_max_age;
  });
  if (!has_control) {
    return Failure{std::string(
        "no prism was measured and vouched for by the set-up in use: nothing to close on")};
  }
  AbandonRound();
  Doubt("station_moving");
  is_moving_ = is_move_asked_ = true;
  is_pausing_ = false;
  is_set_up_asked_ = is_check_asked_ = false;
  proposed_.reset();
  asked_start_ = start;
  return std::string("measuring the references from the new place, then the prisms");
}

void StationKeeper::EndMoveReferences(Timestamp now) {
  auto solved = Solve(*asked_start_, false, now);
  if (!solved) {
    Say(KeeperNews::Kind::kMoveFailed,
        "no set-up at the new place: " + solved.error() +
            "; the set-up in use is unchanged and suspect");
    return;
  }
  proposed_ = ProposedMove{std::move(solved).value(), {}};
}

void StationKeeper::EndMovePrisms() {
  Closure closure;
  new_controls_.clear();
  const SightModel& sight = options_.set_up.sight;
  const auto add =
      [&](const std::string& name, const Eigen::Vector3d& by_new, const Eigen::Vector3d& by_old) {
        const Eigen::Vector3d off = by_new - by_old;
        closure.mean_m += off;
        ++closure.points;
        if (closure.worst_point.empty() || off.norm() > closure.worst_m) {
          closure.worst_m = off.norm();
          closure.worst_point = name;
        }
      };
  const KeptSetUp& moved = proposed_->set_up;
  for (const Reading& reading : readings_) {
    const std::string& name = options_.prisms[static_cast<std::size_t>(reading.target.index)].name;
    const auto control = std::ranges::find(state_.controls, name, &ControlPoint::name);
    Reduction reduction = reading.to_be_added;
    reduction.axis_errors = moved.axis_errors;
    const auto by_new = PointSighted(moved.station, Reduced(reading.raw, reduction), sight);
    if (control == state_.controls.end() || !by_new) continue;
    add(name, *by_new, control->p_in_site);
    new_controls_.push_back({name, reading.at, *by_new});
  }
  const bool has_prism = closure.points > 0;
  for (std::size_t i = 0; i < options_.references.size(); ++i) {
    if (!options_.references[i].is_control) continue;
    const auto point_by = [&](const KeptSetUp& kept) -> std::optional<Eigen::Vector3d> {
      for (const ReferenceSighting& sighting : kept.sightings) {
        if (sighting.reference != static_cast<int>(i)) continue;
        if (const auto p = PointSighted(kept.station, sighting.reading, sight)) return *p;
      }
      return {};
    };
    const auto by_old = point_by(*state_.in_use);
    const auto by_new = point_by(moved);
    if (by_old && by_new) add(options_.references[i].name, *by_new, *by_old);
  }
  if (!has_prism) {
    proposed_.reset();
    Say(KeeperNews::Kind::kMoveFailed,
        "no prism of the rear shield was measured from the new place: nothing to close on; the "
        "set-up in use is unchanged and suspect");
    return;
  }
  closure.mean_m /= closure.points;
  proposed_->closure = closure;
  ++revision_;
  Say(KeeperNews::Kind::kMoveProposed,
      "closure " + Mm(closure.worst_m) + " at " + closure.worst_point + ", tolerance " +
          Mm(options_.closure_tolerance_m) + ", " + std::to_string(closure.points) + " points: " +
          (closure.worst_m <= options_.closure_tolerance_m ? "may be taken over"
                                                           : "too large, give the move up"));
}

Result<KeptStation, std::string> StationKeeper::TakenOver(Timestamp) const {
  if (!proposed_ || !proposed_->closure) {
    return Failure{std::string("there is no proposed move: ask for propose_move first")};
  }
  if (!(proposed_->closure->worst_m <= options_.closure_tolerance_m)) {
    return Failure{"the closure is " + Mm(proposed_->closure->worst_m) + " at " +
                   proposed_->closure->worst_point + ", allowed are " +
                   Mm(options_.closure_tolerance_m)};
  }
  KeptStation state = state_;
  state.last_number = proposed_->set_up.number;
  state.previous = std::move(state.in_use);
  state.in_use = proposed_->set_up;
  state.controls = new_controls_;
  return state;
}

void StationKeeper::AdoptTakenOver(KeptStation state) {
  state_ = std::move(state);
  AbandonRound();
  proposed_.reset();
  is_moving_ = is_paused_ = false;
  Settled(state_.in_use->set_up_at);
}

StationKeeper::Asked StationKeeper::GiveUpMove() {
  if (!is_moving_) return Failure{std::string("no station move is under way")};
  AbandonRound();
  proposed_.reset();
  is_moving_ = is_move_asked_ = false;
  reason_ = "move_given_up";
  is_check_asked_ = true;
  ++revision_;
  return std::string("given up; the old set-up is suspect until its references are found again");
}

Result<KeptStation, std::string> StationKeeper::Undone() const {
  if (is_moving_) return Failure{std::string("a move is proposed: give it up instead")};
  if (!state_.previous) return Failure{std::string("there is no earlier set-up to go back to")};
  KeptStation state = state_;
  std::swap(state.in_use, state.previous);
  state.controls.clear();
  return state;
}

void StationKeeper::AdoptUndone(KeptStation state) {
  state_ = std::move(state);
  AbandonRound();
  reason_ = "undone";
  must_be_seen_.clear();
  is_check_asked_ = true;
  is_paused_ = false;
  watch_.Forget();
  std::fill(latest_.begin(), latest_.end(), std::nullopt);
  ++revision_;
}

}  // namespace tbm
