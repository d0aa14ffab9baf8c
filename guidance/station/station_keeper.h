#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "guidance/station/kept_station.h"
#include "guidance/station/prism_watch.h"
#include "pose/base/result.h"

namespace tbm {

struct AimWindow {
  double horizontal_rad = 0.0;
  double vertical_rad = 0.0;
};

struct KeeperOptions {
  std::vector<NamedReference> references;  // 1 .. 16
  std::vector<StationPrism> prisms;        // 1 .. 8

  // Roughly where the instrument stands and where its circle's zero points, so that the first
  // references are found; with `known` set, a forced centring that takes part in the set-up.
  Station start;
  std::array<std::optional<double>, 4> known;
  double start_within_m = 3.0;  // a set-up that comes out further away has taken a wrong prism
  double start_within_rad = 0.1;
  // A reference that reads further than this from where it belongs is another prism; in a set-up
  // start_within_m comes on top.
  double gross_m = 0.3;
  AimWindow window{0.05, 0.03};  // full width of a search when a target is not where it should be
  // Roughly where the rear shield stands, for the first look at its prisms.
  std::optional<Rigid3> shield_start;

  double angle_sigma_rad = 5e-6;  // of one pointing
  double slope_sigma_m = 1e-3;
  double slope_sigma_ppm = 1.5;
  double largest_axis_error_rad = 1e-4;
  SetUpOptions set_up;
  CheckOptions check;
  PrismWatchOptions watch;

  Duration cycle_period = std::chrono::seconds(20);  // from the start of one round to the next
  Duration check_period = std::chrono::minutes(10);
  Duration doubt_period = std::chrono::seconds(60);  // between checks while the set-up is suspect
  Duration retry_period = std::chrono::seconds(30);  // between attempts at the first set-up
  bool checks_in_two_faces = true;
  // A check that could not have found a shift of so much says nothing.
  double must_see_m = 0.02;
  // A good check lifts a doubt only when it is as good as this: of unmoved ones one in twenty
  // fails.
  double lifting_risk = 0.05;

  double closure_tolerance_m = 0.005;  // of the worst control point after a station move
  Duration control_max_age = std::chrono::hours(12);
};

enum class TargetKind { kPrism, kReference };
struct StationTarget {
  TargetKind kind = TargetKind::kPrism;
  int index = 0;
  bool operator==(const StationTarget&) const = default;
};

// What to measure next.
struct Pointing {
  StationTarget target;
  Face face = Face::kOne;
  double circle_rad = 0.0;  // where it should be, in terms of the first face
  double zenith_rad = 0.0;
  bool is_rough = false;  // nobody knows it well: a search in the window goes with it
  std::uint64_t cycle_number = 0;
};

// What came of it.
struct Pointed {
  Timestamp at;  // middle of the measurement or of the attempt
  double within_s = 0.0;
  std::string failure;    // a word; empty: measured
  std::string doubt;      // a word; the reading is usable and something is odd about it
  RawReading raw;         // as displayed
  Reduction to_be_added;  // prism constant and air that the instrument has not applied
};

// What is to be said of one pointing.
enum class Trust { kNone, kDegraded, kGood };
struct Judged {
  StationTarget target;
  Face face = Face::kOne;
  std::uint64_t cycle_number = 0;
  std::uint64_t set_up_number = 0;
  Trust trust = Trust::kNone;
  std::string reason;  // empty exactly when good
  std::optional<Eigen::Vector3d> p_in_site;
  SightedCovariance covariance;
  std::optional<PrismJudgement> prism;
};

enum class SetUpHealth { kNone, kSuspect, kGood };

// What the keeper is busy with.
enum class Round { kNone, kSetUp, kCheck, kPrisms, kMoveReferences, kMovePrisms };

// The end of something that was asked for, or that matters by itself.
struct KeeperNews {
  enum class Kind {
    kSetUpDone,
    kSetUpFailed,
    kCheckGood,
    kCheckBad,
    kPaused,
    kMoveProposed,
    kMoveFailed,
  };
  Kind kind = Kind::kCheckGood;
  std::string text;  // a sentence
};

struct Closure {
  int points = 0;
  Eigen::Vector3d mean_m = Eigen::Vector3d::Zero();  // new minus old
  double worst_m = 0.0;
  std::string worst_point;
};

struct ProposedMove {
  KeptSetUp set_up;
  std::optional<Closure> closure;  // once the control points are measured
};

// Keeps a total station's set-up: says what is to be measured next, takes what came of it, and
// decides what may be believed. Pure: instants come as arguments, and it touches no instrument.
//
// Of a set-up that is suspect nothing is published as a position. Only a check that sees every
// reference that had disagreed, and finds them where they were, lifts the doubt.
class StationKeeper {
 public:
  explicit StationKeeper(KeeperOptions options);

  // What was kept before a restart. It is suspect until a check is good.
  void Restore(KeptStation state);
  // The instrument that answers; another one than that of the set-up has another circle.
  void SetInstrument(std::int64_t serial_number);
  // The connection was away for long: check before anything else.
  void DistrustUntilChecked(std::string_view reason);
  void Believe(const ShieldBelief& belief) { watch_.Believe(belief); }

  // The next pointing; empty until `wait_until`.
  std::optional<Pointing> Next(Timestamp now);
  Timestamp wait_until() const { return wait_until_; }
  // The answer to the last Next.
  Judged Take(const Pointed& pointed);
  // The round under way cannot be ended: instrument gone.
  void AbandonRound();

  // Asked for by an operator. An error is a sentence that says why not.
  using Asked = Result<std::string, std::string>;
  Asked AskSetUp(const std::optional<Station>& start);
  Asked AskCheck();
  Asked ProposeMove(const Station& start, Timestamp now);
  Asked GiveUpMove();
  Asked Pause();   // after one more round over the prisms and a check
  Asked Resume();  // with a check first
  // What the state would be; Adopt makes it so, once it is safe on disk.
  Result<KeptStation, std::string> TakenOver(Timestamp now) const;
  Result<KeptStation, std::string> Undone() const;
  void AdoptTakenOver(KeptStation state);
  void AdoptUndone(KeptStation state);

  SetUpHealth health() const;
  const std::string& reason() const { return reason_; }
  const KeptStation& state() const { return state_; }
  // Counts what is worth keeping: when it has changed, the state is to be written.
  std::uint64_t revision() const { return revision_; }
  const std::optional<ProposedMove>& proposed() const { return proposed_; }
  bool is_paused() const { return is_paused_; }
  Round round() const { return round_; }
  const CheckVerdict& last_verdict() const { return last_verdict_; }
  const std::optional<Eigen::Vector4d>& station_shift() const { return station_shift_; }
  std::vector<std::string> moved_references() const;
  // For an alarm: how often in a row a prism was not found, and how it was last judged.
  int times_missed(int prism) const { return missed_[static_cast<std::size_t>(prism)]; }
  const std::string& missed_because(int prism) const {
    return missed_because_[static_cast<std::size_t>(prism)];
  }
  const std::optional<PrismJudgement>& judged(int prism) const {
    return judged_[static_cast<std::size_t>(prism)];
  }
  const KeeperOptions& options() const { return options_; }
  std::vector<KeeperNews> TakeNews() { return std::exchange(news_, {}); }
  // A rough station that a person gave; where no circle zero is known, the one at which the
  // telescope now looks at a reference.
  std::optional<double> CircleZeroFrom(const Eigen::Vector3d& p_axes_in_site,
                                       std::string_view reference,
                                       double circle_rad) const;

 private:
  struct Reading {
    StationTarget target;
    Face face;
    Timestamp at;
    RawReading raw;
    Reduction to_be_added;
  };

  void Begin(Round round, Timestamp now);
  std::optional<Pointing> Aimed(const StationTarget& target, Face face, Timestamp now);
  std::optional<Station> StationFor(Round round) const;
  // `axis_sigma_rad` of a single face; empty: the mean of both, which is free of axis errors.
  PolarSigma SigmaOf(const PolarReading& reading, std::optional<double> axis_sigma_rad) const;
  // The references of the round, both faces joined where there are both, and what those show of the
  // axis errors. Single faces are corrected by that, else by `known`, else left out.
  struct RoundSightings {
    std::vector<ReferenceSighting> sightings;
    std::optional<AxisErrors> shown;
    double axis_sigma_rad = 0.0;
  };
  RoundSightings Sightings(const KeptSetUp* known) const;
  std::optional<Round> Choose(Timestamp now) const;
  void WatchTheClock(Timestamp now);
  Judged Place(const Pointed& pointed, Judged judged);
  bool IsAnotherPrism(const StationTarget& target, const Pointed& pointed) const;

  void EndRound(Timestamp now);
  void EndSetUp(Timestamp now);
  void EndCheck(Timestamp now);
  void CheckIsGood(const ReferenceCheck& check, const std::vector<ReferenceSighting>& now_seen);
  void CheckIsBad(const ReferenceCheck& check, const std::vector<ReferenceSighting>& now_seen);
  void CheckSaysNothing(std::string_view why);
  void EndMoveReferences(Timestamp now);
  void EndMovePrisms();
  void Settled(Timestamp now);
  Result<KeptSetUp, std::string> Solve(const Station& start, bool with_known, Timestamp now) const;
  void UpdateRows(const std::vector<ReferenceSighting>& now, KeptSetUp* kept) const;
  void Doubt(std::string_view reason);
  void Say(KeeperNews::Kind kind, std::string text) { news_.push_back({kind, std::move(text)}); }

  KeeperOptions options_;
  std::vector<Reference> references_;  // of the options, without names
  PrismWatch watch_;
  KeptStation state_;
  std::string reason_ = "not_set_up";  // why it is not good; empty: it is
  std::uint64_t revision_ = 0;
  std::optional<std::int64_t> instrument_;

  std::optional<ProposedMove> proposed_;
  std::optional<Station> asked_start_;  // of the set-up or the move under way
  bool is_set_up_asked_ = false;
  bool is_check_asked_ = false;
  bool is_move_asked_ = false;
  bool is_moving_ = false;  // from the proposal on until it is taken over or given up
  bool is_pausing_ = false;
  bool is_paused_ = false;
  bool pause_has_prisms_ = false;

  Round round_ = Round::kNone;
  std::vector<std::pair<StationTarget, Face>> to_do_;  // of the round, the next one last
  std::vector<Reading> readings_;
  std::optional<std::pair<StationTarget, Face>> aimed_;
  std::uint64_t cycle_number_ = 0;
  Timestamp round_began_;
  std::optional<Timestamp> first_reading_at_;  // of the round
  Timestamp wait_until_;
  std::optional<Timestamp> next_cycle_;
  std::optional<Timestamp> next_check_;
  std::optional<Timestamp> next_set_up_;

  CheckVerdict last_verdict_ = CheckVerdict::kNothingSeen;
  std::optional<Eigen::Vector4d> station_shift_;
  std::optional<int> moved_once_;  // the reference that the last check named
  std::vector<int> must_be_seen_;  // by the check that lifts a doubt
  int checks_missed_ = 0;
  std::vector<int> missed_;
  std::vector<std::string> missed_because_;
  std::vector<std::optional<PrismJudgement>> judged_;
  std::vector<std::optional<ControlPoint>> latest_;  // prisms by the set-up in use
  std::vector<ControlPoint> new_controls_;           // the prisms by the proposed set-up
  std::vector<KeeperNews> news_;
};

}  // namespace tbm
