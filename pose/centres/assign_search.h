#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "pose/centres/assign_fit.h"

namespace tbm::assign {

struct Candidate {
  Matches matches;
  Fit fit;
};

// The best explanations met so far: more LEDs first, then smaller chi2. Room for kRoom; what is
// worse than all of a full list is not kept.
class Candidates {
 public:
  Candidates() = default;
  Candidates(const Candidates&) = delete;
  Candidates& operator=(const Candidates&) = delete;

  void Offer(const Candidate& candidate);
  // Whether some candidate already holds all of these matches.
  bool Covers(std::span<const Match> matches) const;
  std::size_t size() const { return size_; }
  const Candidate& operator[](std::size_t i) const { return begin()[i]; }
  const Candidate* begin() const { return reinterpret_cast<const Candidate*>(room_.data()); }
  const Candidate* end() const { return begin() + size_; }

 private:
  static constexpr std::size_t kRoom = 48;
  Candidate* At(std::size_t i) { return reinterpret_cast<Candidate*>(room_.data()) + i; }

  // Not an array of candidates: it would be filled with empty ones first.
  alignas(Candidate) std::array<std::byte, kRoom * sizeof(Candidate)> room_;
  std::size_t size_ = 0;
};

// Bounds of the work. Beyond them the faintest spots, then the last LED pairs, are not tried as
// seeds; they still may join a seed that others made.
inline constexpr int kSeedSpotsWithTilts = 32;
inline constexpr int kSeedLedPairs = 24;
inline constexpr int kSeedSpotsWithoutTilts = 12;
inline constexpr int kSeedLedTriples = 12;
inline constexpr int kMaxRefinedSeeds = 4000;

// Every pair of LEDs on every pair of spots gives at most two poses through the up vectors;
// wherever one of them explains a third spot, the three are fitted and extended. Returns whether
// any pair of spots could be a pair of LEDs at all. Needs scene.ups_are_sharp.
bool SearchByTilts(const Scene& scene, Candidates& found);

// Every triple of LEDs on every triple of spots gives at most four poses; wherever one of them
// explains a fourth spot, the four are fitted and extended. Returns whether any triple of spots
// could be a triple of LEDs at all. Where the scene has ups, poses that contradict them are left
// out.
bool SearchByVision(const Scene& scene, Candidates& found);

// Pairs of spots inside the gates that the prior (with the tilts, when there are any) leaves.
// Candidates have two LEDs or more. Needs scene.prior.
void SearchByPrior(const Scene& scene, Candidates& found);

}  // namespace tbm::assign
