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
        why_(targets.size(), TargetRefusal::kNotFound),
        seen_(targets.size()) {
    if (ahead.expected) gates_.emplace(*ahead.expected);
  }

  TargetsInImage Go(CentreFinder* centres) {
    TakeCodes();
    for (const SoughtBoard& board : BoardsAmong(targets_)) TakeBoard(board);
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

  void TakeCodes() {
    const auto coded = Of(TargetKind::kCoded);
    if (coded.empty()) return;
    const FoundCodes found = FindCodes(grey_, camera_);
    std::vector<TargetSeen> candidates;
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
        candidates.push_back({target, fitting[0]->pixel_px, fitting[0]->sigma_px});
      } else if (is_seen) {
        why_[target] = fitting.empty() ? TargetRefusal::kTooFar : TargetRefusal::kAmbiguous;
      }
    }
    for (const TargetSeen& one : Agreeing(candidates)) Take(one);
  }

  // Names may be exchanged, and wide gates do not show it: only a majority that agrees is believed.
  std::vector<TargetSeen> Agreeing(const std::vector<TargetSeen>& candidates) {
    if (!gates_ || candidates.size() < 2) return candidates;
    std::vector<TargetSeen> best;
    for (const TargetSeen& first : candidates) {
      TargetGates gates = *gates_;
      gates.Take(first.target, first.pixel_px, first.sigma_px);
      std::vector<TargetSeen> agreeing;
      for (const TargetSeen& other : candidates) {
        const bool is_first = other.target == first.target;
        if (!is_first && !gates.At(other.target, other.sigma_px).Has(other.pixel_px)) continue;
        if (!is_first) gates.Take(other.target, other.pixel_px, other.sigma_px);
        agreeing.push_back(other);
      }
      if (agreeing.size() > best.size()) best = std::move(agreeing);
    }
    const bool is_majority = 2 * best.size() > candidates.size();
    for (const TargetSeen& one : candidates) {
      why_[one.target] = is_majority ? TargetRefusal::kTooFar : TargetRefusal::kAmbiguous;
    }
    if (!is_majority) best.clear();
    return best;
  }

  void TakeBoard(const SoughtBoard& board) {
    const BoardOutcome outcome = FindBoardPoints(
        image_, grey_, camera_, targets_, board, gates_ ? &*gates_ : nullptr, ahead_.up_in_camera);
    for (const std::size_t target : board.targets) why_[target] = outcome.why;
    for (const TargetSeen& one : outcome.seen) Take(one);
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
      candidates.push_back({mark.pixel_px, mark.sigma_px, mark.diameter_px});
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
      candidates.push_back({centre.pixel_px, std::hypot(centre.sigma_px, kLedFloor_px), 0.0});
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
        seen_[match.target] = TargetSeen{match.target, one.pixel_px, one.sigma_px};
      } else if (match.verdict == MatchVerdict::kAmbiguous) {
        why_[match.target] = TargetRefusal::kAmbiguous;
      }
    }
  }

  // Each against what all others say; the worst goes first.
  void DropWhatDoesNotFit() {
    for (;;) {
      std::vector<std::size_t> all;
      for (std::size_t i = 0; i < seen_.size(); ++i) {
        // A board's points were taken together, and checked by its own plane.
        if (seen_[i] && Expects(i) && targets_[i].mark.kind != TargetKind::kBoard) all.push_back(i);
      }
      std::optional<std::size_t> worst;
      double most = 0.0;
      for (const std::size_t one : all) {
        TargetGates others(*ahead_.expected);
        for (const std::size_t other : all) {
          if (other != one) others.Take(other, seen_[other]->pixel_px, seen_[other]->sigma_px);
        }
        const auto gate = others.At(one, seen_[one]->sigma_px);
        const double distance = gate.Distance(seen_[one]->pixel_px);
        if (gate.Has(seen_[one]->pixel_px) || distance < most) continue;
        most = distance;
        worst = one;
      }
      if (!worst) return;
      seen_[*worst].reset();
      why_[*worst] = TargetRefusal::kTooFar;
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
