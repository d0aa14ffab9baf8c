#include "pose/centres/split_blobs.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "pose/centres/elementary.h"

namespace tbm {
namespace {

constexpr std::size_t kMaxGuesses = 512;
constexpr std::size_t kMaxPieces = 256;
constexpr double kTwoPi = 2.0 * std::numbers::pi;

// Light above the offset of the Gaussian that was guessed, cut off at full scale.
double ExpectedWeight(const SpotGuess& guess, double offset_dn, double ceiling_dn) {
  const double a = std::max(guess.amplitude_dn, 1.001 * offset_dn);
  const double top = std::min(a, ceiling_dn);
  return kTwoPi * guess.spread_px * guess.spread_px *
         (top * LogOf(a / top) + top - offset_dn - offset_dn * LogOf(a / offset_dn));
}

// One round, Gaussian-like spot: nothing to take apart.
bool LooksLikeOneSpot(const RaisedBlob& raised,
                      const SpotGuess& guess,
                      const SplitOptions& options,
                      std::uint32_t max_value) {
  if (guess.spread_px > options.max_spread_px || guess.elongation > 1.15) return false;
  if (raised.blob.pixels > MostSpotPixels(options.max_spread_px)) return false;
  const double ceiling_dn = static_cast<double>(max_value) - raised.background_dn;
  const double share = guess.weight_dn / ExpectedWeight(guess, raised.offset_dn, ceiling_dn);
  return share > 0.75 && share < 1.33;
}

// The next higher cut, by one grey value at least; 0 when the top is reached. In steps fine enough
// that one falls between a spot of half the brightness and the saddle to its neighbour 3.4 sigmas
// away; two equal spots part at 0.87 of the peak when they are 2.4 sigmas apart. A streak that has
// room for a few spots only is cut once, at half its height.
// And so is what is too large for a spot: a lamp, in whose halo only bright spots can be told.
double NextOffset(const RaisedBlob& raised, double elongation, int most_pixels) {
  constexpr int kFewSpotsPixels = 300;
  constexpr double kStreak = 4.0;
  const double amplitude_dn = raised.blob.peak_dn - raised.background_dn;
  if (elongation > kStreak && raised.blob.pixels < kFewSpotsPixels) {
    const double offset_dn = 0.5 * amplitude_dn;
    return offset_dn > 1.05 * raised.offset_dn + 1.0 ? offset_dn : 0.0;
  }
  if (raised.blob.pixels > most_pixels) {
    for (const double share : {0.11, 0.3, 0.6}) {
      if (share * amplitude_dn > 1.05 * raised.offset_dn + 1.0) return share * amplitude_dn;
    }
    return 0.0;
  }
  if (1.5 * raised.offset_dn < 0.22 * amplitude_dn) {
    return std::max(1.5 * raised.offset_dn, raised.offset_dn + 1.0);
  }
  for (const double share : {0.22, 0.28, 0.35, 0.43, 0.52, 0.62, 0.74, 0.87}) {
    if (share * amplitude_dn > 1.05 * raised.offset_dn + 1.0) return share * amplitude_dn;
  }
  return 0.0;
}

}  // namespace

double GuessSpread(const Blob& blob, double background_dn, double offset_dn) {
  const double amplitude_dn = std::max(blob.peak_dn - background_dn, 1.0);
  const double log_height = std::max(LogOf(amplitude_dn / offset_dn), 0.2);
  return std::sqrt(std::max(blob.pixels - blob.clipped, 1) / (kTwoPi * log_height));
}

SpotGuess GuessSpot(const RaisedBlob& raised, std::uint32_t max_value) {
  const Blob& blob = raised.blob;
  const double ceiling_dn = static_cast<double>(max_value) - raised.background_dn;
  SpotGuess guess;
  const BlobShape shape = ShapeOf(blob);
  guess.u_px = shape.u_px;
  guess.v_px = shape.v_px;
  guess.weight_dn = shape.weight_dn;
  guess.elongation = shape.elongation;
  guess.background_dn = raised.background_dn;
  guess.amplitude_dn = std::max(blob.peak_dn - raised.background_dn, 1.0);
  guess.spread_px = GuessSpread(blob, raised.background_dn, raised.offset_dn);
  if (blob.clipped > 0) {
    const double area = kTwoPi * guess.spread_px * guess.spread_px;
    guess.amplitude_dn = ceiling_dn / DecayOf(std::min(blob.clipped / area, 4.0));
  }
  return guess;
}

BlobSplitter::BlobSplitter(std::size_t max_runs) : labeller_(max_runs) {
  pieces_.reserve(kMaxPieces);
  guesses_.reserve(kMaxGuesses);
}

bool BlobSplitter::Split(const ImageView& image,
                         const RaisedBlob& raised,
                         const SpotGuess& whole,
                         const SplitOptions& options) {
  const int most_pixels = MostSpotPixels(options.max_spread_px);
  if (LooksLikeOneSpot(raised, whole, options, image.max_value)) return Keep(whole);
  pieces_.clear();
  pieces_.push_back({raised, raised, false});
  while (!pieces_.empty()) {
    Piece piece = pieces_.back();
    pieces_.pop_back();
    SpotGuess guess = GuessSpot(piece.raised, image.max_value);
    if (!LooksLikeOneSpot(piece.raised, guess, options, image.max_value)) {
      if (!piece.has_widest && guess.spread_px <= options.max_spread_px) {
        piece.widest = piece.raised;
        piece.has_widest = true;
      }
      const double offset_dn = NextOffset(piece.raised, guess.elongation, most_pixels);
      if (offset_dn > 0.0 && PushChildren(image, piece, offset_dn, options) > 0) continue;
      if (piece.has_widest) guess = GuessSpot(piece.widest, image.max_value);
    }
    if (!Keep(guess)) return false;
  }
  return true;
}

bool BlobSplitter::Keep(const SpotGuess& guess) {
  if (guesses_.size() == guesses_.capacity()) return false;
  guesses_.push_back(guess);
  return true;
}

std::size_t BlobSplitter::PushChildren(const ImageView& image,
                                       const Piece& parent,
                                       double offset_dn,
                                       const SplitOptions& options) {
  const Blob& box = parent.raised.blob;
  const double background_dn = parent.raised.background_dn;
  const int threshold_dn = static_cast<int>(background_dn + offset_dn);
  labeller_.Clear();
  for (int row = box.top; row <= box.bottom; ++row) {
    if (image.bytes_per_pixel == 1) {
      labeller_.Scan<std::uint8_t>(image, row, box.left, box.right + 1, threshold_dn);
    } else {
      labeller_.Scan<std::uint16_t>(image, row, box.left, box.right + 1, threshold_dn);
    }
  }
  const double noise_dn = std::sqrt(options.noise_dn * options.noise_dn +
                                    options.gain_dn_per_electron * std::max(offset_dn, 0.0));
  const std::size_t before = pieces_.size();
  for (Blob& blob : labeller_.Finish()) {
    if (blob.pixels < Blob::kFewestPixels) continue;
    labeller_.LookAt(image, MostSpotPixels(options.max_spread_px), blob);
    const bool rises = blob.peak_dn - threshold_dn > 4.0 * noise_dn || blob.clipped > 2;
    if (!rises || pieces_.size() == pieces_.capacity()) continue;
    const RaisedBlob raised{blob, background_dn, threshold_dn + 0.5 - background_dn};
    pieces_.push_back({raised, parent.widest, parent.has_widest});
  }
  const std::size_t pushed = pieces_.size() - before;
  if (pushed > 1) {
    for (std::size_t i = before; i < pieces_.size(); ++i) pieces_[i].has_widest = false;
  }
  return pushed;
}

}  // namespace tbm
