// What is measured next, and what is said of each pointing. What a round comes to:
// station_conclude.cc.
#include "guidance/station/station_keeper.h"

#include <algorithm>
#include <cmath>

#include "pose/base/check.h"

namespace tbm {
namespace {

constexpr Duration kIdle = std::chrono::seconds(1);
constexpr int kMissedIsRough = 2;  // after so many misses a prism is looked for in the window

}  // namespace

StationKeeper::StationKeeper(KeeperOptions options)
    : options_(std::move(options)),
      watch_(options_.prisms, options_.watch),
      missed_(options_.prisms.size()),
      missed_because_(options_.prisms.size()),
      judged_(options_.prisms.size()),
      latest_(options_.prisms.size()) {
  for (const NamedReference& named : options_.references) references_.push_back(named.reference);
  if (options_.shield_start) watch_.SetAttitude(options_.shield_start->rotation);
}

// The config may have changed since: readings and rows find their reference by its name.
void StationKeeper::Restore(KeptStation state) {
  const auto place_of = [this](const std::string& name) -> std::optional<int> {
    for (std::size_t i = 0; i < options_.references.size(); ++i) {
      if (options_.references[i].name == name) return static_cast<int>(i);
    }
    return {};
  };
  const auto remap = [&](KeptSetUp& kept) {
    std::vector<KeptReference> rows;
    for (const NamedReference& named : options_.references)
      rows.push_back({named.name, false, "not_seen", {}});
    std::vector<ReferenceSighting> sightings;
    for (ReferenceSighting sighting : kept.sightings) {
      const auto place =
          place_of(kept.references[static_cast<std::size_t>(sighting.reference)].name);
      if (!place) continue;
      sighting.reference = *place;
      sightings.push_back(sighting);
    }
    for (const KeptReference& row : kept.references) {
      const auto place = place_of(row.name);
      if (!place) continue;
      auto& slot = rows[static_cast<std::size_t>(*place)];
      slot = row;
      if (slot.residual) slot.residual->reference = *place;
    }
    kept.references = std::move(rows);
    kept.sightings = std::move(sightings);
  };
  if (state.in_use) remap(*state.in_use);
  if (state.previous) remap(*state.previous);
  state_ = std::move(state);
  if (!state_.in_use) return;
  reason_ = "restarted";
  is_check_asked_ = true;
}

void StationKeeper::SetInstrument(std::int64_t serial_number) {
  instrument_ = serial_number;
  if (!state_.in_use || state_.in_use->instrument == serial_number) return;
  AbandonRound();
  state_.in_use.reset();
  state_.previous.reset();
  proposed_.reset();
  is_moving_ = is_move_asked_ = false;
  reason_ = "other_instrument";
  ++revision_;
}

void StationKeeper::DistrustUntilChecked(std::string_view reason) {
  Doubt(reason);
  is_check_asked_ = state_.in_use.has_value();
}

void StationKeeper::Doubt(std::string_view reason) {
  if (state_.in_use && reason_.empty()) reason_ = reason;
}

SetUpHealth StationKeeper::health() const {
  if (!state_.in_use) return SetUpHealth::kNone;
  return reason_.empty() ? SetUpHealth::kGood : SetUpHealth::kSuspect;
}

std::vector<std::string> StationKeeper::moved_references() const {
  std::vector<std::string> names;
  if (!state_.in_use) return names;
  for (const KeptReference& row : state_.in_use->references) {
    if (row.reason == "moved" || row.reason == "left_out") names.push_back(row.name);
  }
  return names;
}

void StationKeeper::Begin(Round round, Timestamp now) {
  round_ = round;
  round_began_ = now;
  first_reading_at_.reset();
  ++cycle_number_;
  readings_.clear();
  to_do_.clear();
  const bool prisms = round == Round::kPrisms || round == Round::kMovePrisms;
  const auto kind = prisms ? TargetKind::kPrism : TargetKind::kReference;
  const std::size_t count = prisms ? options_.prisms.size() : options_.references.size();
  const bool doubts = round == Round::kCheck && health() == SetUpHealth::kSuspect;
  const bool both = round == Round::kSetUp || round == Round::kMoveReferences || doubts ||
                    (round == Round::kCheck && options_.checks_in_two_faces);
  // Taken from the end: face one in order, then face two on the way back.
  for (std::size_t i = 0; both && i < count; ++i) {
    to_do_.emplace_back(StationTarget{kind, static_cast<int>(i)}, Face::kTwo);
  }
  for (std::size_t i = count; i > 0; --i) {
    to_do_.emplace_back(StationTarget{kind, static_cast<int>(i - 1)}, Face::kOne);
  }
  if (round == Round::kPrisms) next_cycle_ = now + options_.cycle_period;
  if (round == Round::kCheck) {
    is_check_asked_ = false;
    next_check_ = now + (doubts ? options_.doubt_period : options_.check_period);
  }
  if (round == Round::kSetUp) next_set_up_ = now + options_.retry_period;
  if (round == Round::kSetUp) is_set_up_asked_ = false;
  if (round == Round::kMoveReferences) is_move_asked_ = false;
}

void StationKeeper::AbandonRound() {
  round_ = Round::kNone;
  to_do_.clear();
  readings_.clear();
  aimed_.reset();
}

std::optional<Station> StationKeeper::StationFor(Round round) const {
  switch (round) {
    case Round::kSetUp:
      if (asked_start_) return asked_start_;
      // A rough start is enough, and the set-up so far is a better one.
      return state_.in_use ? state_.in_use->station : options_.start;
    case Round::kMoveReferences:
      return asked_start_;
    case Round::kMovePrisms:
      if (proposed_) return proposed_->set_up.station;
      return {};
    default:
      if (state_.in_use) return state_.in_use->station;
      return {};
  }
}

std::optional<Pointing> StationKeeper::Aimed(const StationTarget& target,
                                             Face face,
                                             Timestamp now) {
  Pointing pointing{target, face, 0.0, 0.0, false, cycle_number_};
  const auto station = StationFor(round_);
  if (!station) return {};
  Eigen::Vector3d p_in_site;
  if (target.kind == TargetKind::kReference) {
    p_in_site = references_[static_cast<std::size_t>(target.index)].p_in_site;
    pointing.is_rough = round_ == Round::kSetUp || round_ == Round::kMoveReferences;
  } else if (round_ == Round::kMovePrisms) {
    const std::string& name = options_.prisms[static_cast<std::size_t>(target.index)].name;
    const auto control = std::ranges::find(state_.controls, name, &ControlPoint::name);
    if (control == state_.controls.end()) return {};
    p_in_site = control->p_in_site;
  } else if (const auto where = watch_.Where(target.index, now)) {
    p_in_site = where->p_in_site;
    pointing.is_rough =
        !where->is_believed || missed_[static_cast<std::size_t>(target.index)] >= kMissedIsRough;
  } else if (options_.shield_start) {
    p_in_site = *options_.shield_start *
                options_.prisms[static_cast<std::size_t>(target.index)].p_in_rear_shield;
    pointing.is_rough = true;
  } else {
    return {};
  }
  const auto sight = Sight(*station, p_in_site, options_.set_up.sight);
  if (!sight) return {};
  pointing.circle_rad = sight->circle_rad;
  pointing.zenith_rad = sight->zenith_rad;
  for (const Reading& reading : readings_) {
    if (!(reading.target == target) || reading.face == face) continue;
    const PolarReading other = Reduced(reading.raw, {});
    pointing.circle_rad = other.circle_rad;
    pointing.zenith_rad = other.zenith_rad;
    pointing.is_rough = false;
  }
  return pointing;
}

std::optional<Round> StationKeeper::Choose(Timestamp now) const {
  if (is_moving_) {
    if (is_move_asked_) return Round::kMoveReferences;
    if (proposed_ && !proposed_->closure) return Round::kMovePrisms;
    return {};
  }
  if (is_set_up_asked_) return Round::kSetUp;
  if (!state_.in_use) {
    if (is_paused_ || (next_set_up_ && now < *next_set_up_)) return {};
    return Round::kSetUp;
  }
  if (is_check_asked_) return Round::kCheck;
  if (is_paused_) return {};
  if (is_pausing_) return pause_has_prisms_ ? Round::kCheck : Round::kPrisms;
  if (!next_check_ || now >= *next_check_) return Round::kCheck;
  if (!next_cycle_ || now >= *next_cycle_) return Round::kPrisms;
  return {};
}

std::optional<Pointing> StationKeeper::Next(Timestamp now) {
  if (aimed_) {
    to_do_.push_back(*aimed_);
    aimed_.reset();
  }
  WatchTheClock(now);
  // A round without anything that can be aimed at ends at once: one more may be begun, not many.
  for (int begun = 0; begun < 3; ++begun) {
    if (round_ == Round::kNone) {
      const auto round = Choose(now);
      if (!round) break;
      Begin(*round, now);
    }
    while (!to_do_.empty()) {
      const auto [target, face] = to_do_.back();
      to_do_.pop_back();
      const auto pointing = Aimed(target, face, now);
      if (!pointing) continue;
      aimed_ = {target, face};
      return pointing;
    }
    EndRound(now);
  }
  wait_until_ = now + kIdle;
  for (const auto& due : {next_cycle_, next_check_}) {
    if (due && *due > now) wait_until_ = std::min(wait_until_, *due);
  }
  return {};
}

// A set-up that nothing has vouched for in two periods is not one of now; and a clock that was set
// back must not stop the schedule.
void StationKeeper::WatchTheClock(Timestamp now) {
  const auto reset = [now](std::optional<Timestamp>& due, Duration period) {
    if (due && *due - now > period + kClockSetBack) due.reset();
  };
  reset(next_cycle_, options_.cycle_period);
  reset(next_check_, options_.check_period);
  reset(next_set_up_, options_.retry_period);
  if (!state_.in_use || !reason_.empty()) return;
  if (now - state_.in_use->last_good_check_at > 2 * options_.check_period) Doubt("check_overdue");
}

PolarSigma StationKeeper::SigmaOf(const PolarReading& reading,
                                  std::optional<double> axis_sigma_rad) const {
  const double share = axis_sigma_rad ? 1.0 : std::sqrt(0.5);
  const double slope_m = reading.slope_m.value_or(0.0);
  const double angle_rad =
      std::hypot(share * options_.angle_sigma_rad, axis_sigma_rad.value_or(0.0));
  return {angle_rad / std::max(0.1, std::sin(reading.zenith_rad)),
          angle_rad,
          share * std::hypot(options_.slope_sigma_m, 1e-6 * options_.slope_sigma_ppm * slope_m)};
}

Judged StationKeeper::Take(const Pointed& pointed) {
  TBM_CHECK(aimed_.has_value());
  Judged judged;
  judged.target = aimed_->first;
  judged.face = aimed_->second;
  aimed_.reset();
  judged.cycle_number = cycle_number_;
  judged.set_up_number = state_.in_use ? state_.in_use->number : 0;
  const bool is_prism = judged.target.kind == TargetKind::kPrism;
  if (!pointed.failure.empty()) {
    judged.reason = pointed.failure;
    if (is_prism) {
      ++missed_[static_cast<std::size_t>(judged.target.index)];
      missed_because_[static_cast<std::size_t>(judged.target.index)] = pointed.failure;
    }
    return judged;
  }
  if (!is_prism && IsAnotherPrism(judged.target, pointed)) {
    judged.reason = "wrong_prism";
    return judged;
  }
  if (!first_reading_at_) first_reading_at_ = pointed.at;
  if (is_prism) missed_[static_cast<std::size_t>(judged.target.index)] = 0;
  readings_.push_back({judged.target, judged.face, pointed.at, pointed.raw, pointed.to_be_added});
  judged.trust = Trust::kDegraded;
  if (!state_.in_use) {
    judged.reason = "no_set_up";
  } else if (is_moving_) {
    judged.reason = "station_moving";
  } else if (round_ == Round::kSetUp) {
    judged.reason = "setting_up";
  } else if (health() != SetUpHealth::kGood) {
    judged.reason = "set_up_suspect";
  } else if (!pointed.raw.slope_m) {
    judged.reason = "angles_only";
  } else {
    return Place(pointed, std::move(judged));
  }
  return judged;
}

bool StationKeeper::IsAnotherPrism(const StationTarget& target, const Pointed& pointed) const {
  const auto station = StationFor(round_);
  if (!station) return false;
  const PolarReading reading = Reduced(pointed.raw, pointed.to_be_added);
  const auto p_in_site = PointSighted(*station, reading, options_.set_up.sight);
  if (!p_in_site) return false;  // angles only
  const Reference& reference = references_[static_cast<std::size_t>(target.index)];
  const double off_m = (*p_in_site - reference.p_in_site).norm();
  const bool is_rough = round_ == Round::kSetUp || round_ == Round::kMoveReferences;
  const double turned_m = is_rough ? options_.start_within_rad * *reading.slope_m : 0.0;
  return off_m > options_.gross_m + (is_rough ? options_.start_within_m + turned_m : 0.0);
}

Judged StationKeeper::Place(const Pointed& pointed, Judged judged) {
  const KeptSetUp& kept = *state_.in_use;
  Reduction reduction = pointed.to_be_added;
  reduction.axis_errors = kept.axis_errors;
  const PolarReading reading = Reduced(pointed.raw, reduction);
  const SightModel& sight = options_.set_up.sight;
  const auto p_in_site = PointSighted(kept.station, reading, sight);
  if (!p_in_site) {
    judged.trust = Trust::kNone;
    judged.reason = "implausible";
    return judged;
  }
  judged.p_in_site = *p_in_site;
  judged.covariance =
      CovarianceSighted(kept.station, *p_in_site, sight, SigmaOf(reading, kept.axis_sigma_rad));
  judged.trust = pointed.doubt.empty() ? Trust::kGood : Trust::kDegraded;
  judged.reason = pointed.doubt;
  if (judged.target.kind == TargetKind::kReference) return judged;

  const int prism = judged.target.index;
  judged.prism = watch_.Judge({prism, pointed.at, *p_in_site, judged.covariance.of_reading});
  const auto place = static_cast<std::size_t>(prism);
  judged_[place] = judged.prism;
  switch (judged.prism->verdict) {
    case PrismVerdict::kConfirmed:
      break;
    case PrismVerdict::kUnchecked:
      judged.trust = Trust::kDegraded;
      judged.reason = "prism_unchecked";
      break;
    case PrismVerdict::kWrong:
    case PrismVerdict::kSwapped:
      judged.trust = Trust::kNone;
      judged.reason =
          judged.prism->verdict == PrismVerdict::kWrong ? "wrong_prism" : "swapped_prism";
      judged.p_in_site.reset();
      return judged;
  }
  latest_[place] = ControlPoint{options_.prisms[place].name, pointed.at, *p_in_site};
  return judged;
}

StationKeeper::Asked StationKeeper::AskSetUp(const std::optional<Station>& start) {
  if (is_moving_)
    return Failure{std::string("a station move is under way: take it over or give it up first")};
  AbandonRound();
  asked_start_ = start;
  is_set_up_asked_ = true;
  return std::string("measuring the references in both faces");
}

StationKeeper::Asked StationKeeper::AskCheck() {
  if (is_moving_)
    return Failure{std::string("a station move is under way: take it over or give it up first")};
  if (!state_.in_use) return Failure{std::string("there is no set-up to check: ask for set_up")};
  AbandonRound();
  is_check_asked_ = true;
  return std::string("measuring the references");
}

StationKeeper::Asked StationKeeper::Pause() {
  if (is_moving_)
    return Failure{std::string("a station move is under way: take it over or give it up first")};
  if (is_paused_) return Failure{std::string("it is paused already")};
  is_pausing_ = true;
  pause_has_prisms_ = false;
  if (!state_.in_use) {
    is_pausing_ = false;
    is_paused_ = true;
    AbandonRound();
    return std::string("paused; there is no set-up");
  }
  return std::string(
      "one more round over the prisms and the references, then the instrument rests");
}

StationKeeper::Asked StationKeeper::Resume() {
  if (!is_paused_ && !is_pausing_) return Failure{std::string("it is not paused")};
  is_pausing_ = is_paused_ = false;
  DistrustUntilChecked("resumed");
  return std::string("checking the references first");
}

std::optional<double> StationKeeper::CircleZeroFrom(const Eigen::Vector3d& p_axes_in_site,
                                                    std::string_view reference,
                                                    double circle_rad) const {
  const auto named = std::ranges::find(options_.references, reference, &NamedReference::name);
  if (named == options_.references.end()) return {};
  const auto sight =
      Sight({p_axes_in_site, 0.0}, named->reference.p_in_site, options_.set_up.sight);
  if (!sight) return {};
  return Turn(sight->circle_rad - circle_rad);
}

}  // namespace tbm
