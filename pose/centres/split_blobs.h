#pragma once

#include <vector>

#include "pose/centres/image_view.h"
#include "pose/centres/label_runs.h"

namespace tbm {

// What a blob says about the spot inside it, before anything is fitted.
struct SpotGuess {
  double u_px = 0.0;
  double v_px = 0.0;
  double spread_px = 0.0;
  double amplitude_dn = 0.0;  // above the background; beyond full scale where clipped
  double background_dn = 0.0;
  double elongation = 1.0;  // of the blob
  double weight_dn = 0.0;   // of the blob
};

// A blob, and how far above the background its pixels are.
struct RaisedBlob {
  Blob blob;
  double background_dn = 0.0;
  double offset_dn = 0.0;
};

// Spread and amplitude of the Gaussian whose cut at the blob's offset has the blob's area; where it
// is clipped, the area of the clipped plateau gives the amplitude.
SpotGuess GuessSpot(const RaisedBlob& raised, std::uint32_t max_value);
// The spread alone, from area and peak.
double GuessSpread(const Blob& blob, double background_dn, double offset_dn);

// A blob of more pixels than this is no spot, however bright: its Gaussian's cut at 1/3000 of its
// height would still be smaller.
inline int MostSpotPixels(double max_spread_px) {
  return static_cast<int>(50.0 * max_spread_px * max_spread_px);
}

struct SplitOptions {
  double max_spread_px = 8.0;
  double noise_dn = 0.5;
  double gain_dn_per_electron = 0.02;
};

// Takes one blob of the image apart where it holds several spots: lamps close together, an LED on a
// bright pipe or in the halo of a work lamp. The blob is cut again and again at higher levels; each
// piece that looks like one spot, or cannot be cut further, becomes a guess.
class BlobSplitter {
 public:
  explicit BlobSplitter(std::size_t max_runs);

  // Appends to guesses() up to its capacity; false when there was no room for one.
  bool Split(const ImageView& image,
             const RaisedBlob& raised,
             const SpotGuess& guess,
             const SplitOptions& options);
  std::vector<SpotGuess>& guesses() { return guesses_; }

 private:
  struct Piece {
    RaisedBlob raised;
    RaisedBlob widest;  // the first cut on the way here that holds this one spot only
    bool has_widest = false;
  };

  bool Keep(const SpotGuess& guess);
  std::size_t PushChildren(const ImageView& image,
                           const Piece& parent,
                           double offset_dn,
                           const SplitOptions& options);

  RunLabeller labeller_;
  std::vector<Piece> pieces_;
  std::vector<SpotGuess> guesses_;
};

}  // namespace tbm
