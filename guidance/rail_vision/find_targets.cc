#include "guidance/rail_vision/find_targets.h"

#include <algorithm>
#include <cmath>

#include <opencv2/core.hpp>

#include "guidance/rail_vision/board_points.h"
#include "guidance/rail_vision/found_mark.h"
#include "pose/calibrate/grey_mat.h"

namespace tbm {
namespace {

constexpr int kLeastSide_px = 32;
// A lamp's centre is not better than this: it is no point, and the lens does not picture it so.
constexpr double kLedFloor_px = 0.01;
constexpr double kLedSize_px = 3.0;
// What stays the same from image to image does not average out, as the filter takes it to do.
constexpr double kMostBias_px = 0.05;

// What was found under one name, and is right or wrong as one: a coded target, the points of a
// board.
using Found = std::vector<TargetSeen>;

// The furthest of it.
double Distance(const TargetGates& gates, const Found& found) {
  double most = 0.0;
  for (const TargetSeen& one : found) {
    most = std::max(most, gates.At(one.target, one.sigma_px).Distance(one.pixel_px));
  }
  return most;
}

bool Fits(const TargetGates& gates, const Found& found) {
  return std::all_of(found.begin(), found.end(), [&](const TargetSeen& one) {
    return gates.At(one.target, one.sigma_px).Has(one.pixel_px);
  });
}

// As a witness: where one of its points is wrong all are, so all weigh as much as one.
void TakeAsOne(const Found& found, TargetGates* gates) {
  const auto count = static_cast<double>(found.size());
  for (const TargetSeen& one : found) {
    // The survey's error the gates add once themselves.
    const double survey_px = gates->Expected(one.target).survey_sigma_px;
    const double of_image = count * one.sigma_px * one.sigma_px;
    const double of_survey = (count - 1.0) * survey_px * survey_px;
    gates->Take(one.target, one.pixel_px, std::sqrt(of_image + of_survey));
  }
}

// One image, from what names itself to what only its place tells.
class Search {
 public:
  Search(const ImageView& image,
         const CameraModel& camera,
         std::span<const SoughtTarget> targets,
         const TargetsAhead& ahead)
      : image_(image),
        grey_(GreyOf(image)),
        camera_(camera),
        targets_(targets),
        ahead_(ahead),
        boards_(BoardsAmong(targets)),
        why_(targets.size(), TargetRefusal::kNotFound),
        seen_(targets.size()) {
    if (ahead.expected) gates_.emplace(*ahead.expected);
  }

  TargetsInImage Go(CentreFinder* centres) {
    TakeNamed();
    if (gates_) TakeRestOfBoards();
    TakeCircles();
    TakeLeds(centres);
    if (gates_) DropWhatDoesNotFit();
    return Outcome();
  }

 private:
  bool Expects(std::size_t target) const { return gates_ && gates_->Expects(target); }

  void Take(const TargetSeen& seen) {
    seen_[seen.target] = seen;
    if (Expects(seen.target)) gates_->Take(seen.target, seen.pixel_px, seen.sigma_px);
  }

  std::vector<std::size_t> Of(TargetKind kind) const {
    std::vector<std::size_t> of_kind;
    for (std::size_t i = 0; i < targets_.size(); ++i) {
      if (targets_[i].mark.kind == kind) of_kind.push_back(i);
    }
    return of_kind;
  }

  void TakeNamed() {
    std::vector<Found> candidates = FindCoded();
    for (Found& board : FindWholeBoards()) candidates.push_back(std::move(board));
    for (const Found& found : Agreeing(candidates)) {
      for (const TargetSeen& one : found) Take(one);
    }
  }

  std::vector<Found> FindCoded() {
    std::vector<Found> candidates;
    const auto coded = Of(TargetKind::kCoded);
    if (coded.empty()) return candidates;
    const FoundCodes found = FindCodes(grey_, camera_);
    for (const std::size_t target : coded) {
      const int code = targets_[target].mark.code;
      const auto has = [&](const std::vector<int>& codes) {
        return std::find(codes.begin(), codes.end(), code) != codes.end();
      };
      if (has(found.too_small)) why_[target] = TargetRefusal::kTooSmall;
      if (has(found.unclear)) why_[target] = TargetRefusal::kCovered;
      std::vector<const FoundMark*> fitting;
      bool is_seen = false;
      for (const FoundMark& mark : found.marks) {
        if (mark.code != code) continue;
        is_seen = true;
        if (!gates_ ||
            (gates_->Expects(target) && gates_->At(target, mark.sigma_px).Has(mark.pixel_px))) {
          fitting.push_back(&mark);
        }
      }
      if (fitting.size() == 1) {
        candidates.push_back(Found{{target, fitting[0]->pixel_px, fitting[0]->sigma_px}});
      } else if (is_seen) {
        why_[target] = fitting.empty() ? TargetRefusal::kTooFar : TargetRefusal::kAmbiguous;
      }
    }
    return candidates;
  }

  // Those of one form name themselves only by where they are: without that they are not looked for,
  // and what two took for theirs is nobody's.
  std::vector<Found> FindWholeBoards() {
    std::vector<BoardOutcome> outcomes;
    for (const SoughtBoard& board : boards_) {
      const auto is_like = [&](const SoughtBoard& other) { return IsSameForm(board, other); };
      if (!gates_ && std::count_if(boards_.begin(), boards_.end(), is_like) > 1) {
        outcomes.push_back({{}, {}, TargetRefusal::kAmbiguous});
        continue;
      }
      outcomes.push_back(FindWholeBoard(
          grey_, camera_, targets_, board, gates_ ? &*gates_ : nullptr, ahead_.up_in_camera));
    }
    std::vector<Found> candidates;
    for (std::size_t i = 0; i < boards_.size(); ++i) {
      bool is_shared = false;
      for (std::size_t j = 0; j < boards_.size(); ++j) {
        is_shared = is_shared || (i != j && HaveTheSame(outcomes[i], outcomes[j]));
      }
      for (const std::size_t target : boards_[i].targets) {
        why_[target] = is_shared ? TargetRefusal::kAmbiguous : outcomes[i].why;
      }
      if (!is_shared && !outcomes[i].seen.empty()) candidates.push_back(outcomes[i].seen);
    }
    return candidates;
  }

  // Names may be exchanged, and wide gates do not show it: only a majority that agrees is believed.
  std::vector<Found> Agreeing(const std::vector<Found>& candidates) {
    if (!gates_ || candidates.size() < 2) return candidates;
    std::vector<Found> best;
    for (std::size_t first = 0; first < candidates.size(); ++first) {
      TargetGates gates = *gates_;
      TakeAsOne(candidates[first], &gates);
      std::vector<Found> agreeing = {candidates[first]};
      for (std::size_t other = 0; other < candidates.size(); ++other) {
        if (other == first || !Fits(gates, candidates[other])) continue;
        TakeAsOne(candidates[other], &gates);
        agreeing.push_back(candidates[other]);
      }
      if (agreeing.size() > best.size()) best = std::move(agreeing);
    }
    const bool is_majority = 2 * best.size() > candidates.size();
    for (const Found& found : candidates) {
      for (const TargetSeen& one : found) {
        why_[one.target] = is_majority ? TargetRefusal::kTooFar : TargetRefusal::kAmbiguous;
      }
    }
    if (!is_majority) best.clear();
    return best;
  }

  // Of boards that are partly hidden: the points have no names, but places.
  void TakeRestOfBoards() {
    for (const SoughtBoard& board : boards_) {
      const bool is_left =
          std::all_of(board.targets.begin(), board.targets.end(), [&](std::size_t target) {
            return Expects(target) && !seen_[target] && why_[target] == TargetRefusal::kNotFound;
          });
      if (!is_left) continue;
      for (const TargetSeen& one : FindBoardPoints(grey_, targets_, board, *gates_)) Take(one);
    }
  }

  void TakeCircles() {
    std::vector<std::size_t> circles = Of(TargetKind::kCircle);
    for (const std::size_t target : circles) {
      if (!gates_) why_[target] = TargetRefusal::kNoExpectation;
    }
    std::erase_if(circles, [&](std::size_t target) { return !Expects(target); });
    double least_px = 1e9;
    double most_px = 0.0;
    std::vector<double> diameters_m;
    std::vector<std::size_t> large;
    for (const std::size_t target : circles) {
      const double diameter_m = targets_[target].mark.diameter_m;
      const double expected_px = diameter_m * gates_->Expected(target).px_per_m;
      if (expected_px < kLeastCircle_px) {
        why_[target] = TargetRefusal::kTooSmall;
        continue;
      }
      least_px = std::min(least_px, 0.7 * expected_px);
      most_px = std::max(most_px, 1.3 * expected_px + 2.0);
      diameters_m.push_back(diameter_m);
      large.push_back(target);
    }
    if (large.empty()) return;
    const auto found =
        FindCircles(grey_, camera_, std::max(least_px, 0.8 * kLeastCircle_px), most_px);
    std::vector<GateCandidate> candidates;
    for (const FoundMark& mark : found) {
      candidates.push_back({mark.pixel_px, mark.sigma_px, mark.diameter_px, mark.bias_px});
    }
    TakeMatches(large, diameters_m, candidates);
  }

  void TakeLeds(CentreFinder* centres) {
    std::vector<std::size_t> leds = Of(TargetKind::kLed);
    for (const std::size_t target : leds) {
      if (!gates_) why_[target] = TargetRefusal::kNoExpectation;
    }
    std::erase_if(leds, [&](std::size_t target) { return !Expects(target); });
    if (leds.empty()) return;
    const auto found = centres->Find(image_);
    if (!found) return;
    std::vector<GateCandidate> candidates;
    for (const Centre& centre : (*found)->centres) {
      candidates.push_back({centre.pixel_px, std::hypot(centre.sigma_px, kLedFloor_px), 0.0, 0.0});
    }
    TakeMatches(leds, std::vector<double>(leds.size(), 0.0), candidates);
  }

  void TakeMatches(const std::vector<std::size_t>& targets,
                   const std::vector<double>& diameters_m,
                   const std::vector<GateCandidate>& candidates) {
    const double area_px2 = static_cast<double>(image_.width_px) * image_.height_px;
    for (const GateMatch& match :
         MatchInGates(targets, diameters_m, candidates, area_px2, &*gates_)) {
      if (match.verdict == MatchVerdict::kMatched) {
        const GateCandidate& one = candidates[match.candidate];
        if (one.bias_px > kMostBias_px) {
          why_[match.target] = TargetRefusal::kTilted;
          continue;
        }
        seen_[match.target] = TargetSeen{match.target, one.pixel_px, one.sigma_px};
      } else if (match.verdict == MatchVerdict::kAmbiguous) {
        why_[match.target] = TargetRefusal::kAmbiguous;
      }
    }
  }

  // All that was taken, the points of a board together.
  std::vector<Found> Taken() const {
    std::vector<Found> taken;
    const auto add = [&](const std::vector<std::size_t>& targets) {
      Found found;
      for (const std::size_t target : targets) {
        if (seen_[target] && Expects(target)) found.push_back(*seen_[target]);
      }
      if (!found.empty()) taken.push_back(std::move(found));
    };
    for (const SoughtBoard& board : boards_) add(board.targets);
    for (std::size_t i = 0; i < targets_.size(); ++i) {
      if (targets_[i].mark.kind != TargetKind::kBoard) add({i});
    }
    return taken;
  }

  // Each against what all others say; the worst goes first.
  void DropWhatDoesNotFit() {
    for (;;) {
      const std::vector<Found> all = Taken();
      const Found* worst = nullptr;
      double most = 0.0;
      for (const Found& found : all) {
        TargetGates others(*ahead_.expected);
        for (const Found& other : all) {
          if (&other != &found) TakeAsOne(other, &others);
        }
        const double distance = Distance(others, found);
        if (Fits(others, found) || distance < most) continue;
        most = distance;
        worst = &found;
      }
      if (worst == nullptr) return;
      for (const TargetSeen& one : *worst) {
        seen_[one.target].reset();
        why_[one.target] = TargetRefusal::kTooFar;
      }
    }
  }

  // Where it is expected in the image: not at all, at the edge, or within.
  enum class Where { kOutside, kAtEdge, kInside };
  Where ExpectedAt(std::size_t target) const {
    if (!ahead_.expected) return Where::kInside;
    if (!Expects(target)) return Where::kOutside;
    const auto gate = gates_->At(target, 1.0);
    const TargetMark& mark = targets_[target].mark;
    const double size_px = mark.kind == TargetKind::kCircle
                               ? 0.5 * mark.diameter_m * gates_->Expected(target).px_per_m
                               : kLedSize_px;
    const double from_edge_px = std::min({gate.pixel_px.x(),
                                          gate.pixel_px.y(),
                                          image_.width_px - 1.0 - gate.pixel_px.x(),
                                          image_.height_px - 1.0 - gate.pixel_px.y()});
    const double margin_px = gate.HalfWidth_px() + size_px;
    if (from_edge_px < -margin_px) return Where::kOutside;
    return from_edge_px < margin_px ? Where::kAtEdge : Where::kInside;
  }

  TargetsInImage Outcome() const {
    TargetsInImage outcome;
    for (std::size_t i = 0; i < seen_.size(); ++i) {
      if (seen_[i]) {
        outcome.seen.push_back(*seen_[i]);
        continue;
      }
      const Where where = ExpectedAt(i);
      const bool is_missing = why_[i] == TargetRefusal::kNotFound;
      if (is_missing && where == Where::kOutside) continue;
      const bool is_at_edge = is_missing && where == Where::kAtEdge;
      outcome.refused.push_back({i, is_at_edge ? TargetRefusal::kAtEdge : why_[i]});
    }
    return outcome;
  }

  const ImageView& image_;
  const cv::Mat grey_;
  const CameraModel& camera_;
  const std::span<const SoughtTarget> targets_;
  const TargetsAhead& ahead_;
  std::optional<TargetGates> gates_;
  const std::vector<SoughtBoard> boards_;
  std::vector<TargetRefusal> why_;
  std::vector<std::optional<TargetSeen>> seen_;
};

}  // namespace

std::string_view Word(TargetRefusal refusal) {
  switch (refusal) {
    case TargetRefusal::kNotFound:
      return "not_found";
    case TargetRefusal::kAmbiguous:
      return "ambiguous";
    case TargetRefusal::kTooFar:
      return "too_far";
    case TargetRefusal::kTooSmall:
      return "too_small";
    case TargetRefusal::kAtEdge:
      return "at_edge";
    case TargetRefusal::kCovered:
      return "covered";
    case TargetRefusal::kNoExpectation:
      return "no_expectation";
    case TargetRefusal::kTilted:
      return "tilted";
  }
  return "";
}

TargetFinder::TargetFinder() : centres_(FinderOptions{}) {}

TargetsInImage TargetFinder::Find(const ImageView& image,
                                  const CameraModel& camera,
                                  std::span<const SoughtTarget> targets,
                                  const TargetsAhead& ahead) {
  const bool is_image = image.pixels != nullptr && image.width_px >= kLeastSide_px &&
                        image.height_px >= kLeastSide_px;
  if (!is_image) {
    TargetsInImage nothing;
    for (std::size_t i = 0; i < targets.size(); ++i) {
      nothing.refused.push_back({i, TargetRefusal::kNotFound});
    }
    return nothing;
  }
  return Search(image, camera, targets, ahead).Go(&centres_);
}

}  // namespace tbm
