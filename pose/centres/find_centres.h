#pragma once

#include <memory>
#include <optional>

#include "pose/base/result.h"
#include "pose/centres/centre.h"
#include "pose/centres/image_view.h"

namespace tbm {

// Why a whole image is unusable.
enum class ImageFailure {
  kDark,       // nothing rises above the noise anywhere
  kSaturated,  // more than FinderOptions::saturated_fraction of it is at full scale
};

struct FinderOptions {
  // The sensor's photon transfer: variance = read_noise^2 + gain * (signal above black). Estimated
  // from the image where absent.
  std::optional<double> gain_dn_per_electron;
  std::optional<double> read_noise_dn;
  double min_spread_px = 0.7;   // narrower is a hot pixel
  double max_spread_px = 8.0;   // wider is glare
  double max_elongation = 3.0;  // longer is a streak or two lamps in one
  double min_snr = 8.0;         // peak above the background by the noise there
  double saturated_fraction = 0.5;
};

// What the whole image looked like, for health and exposure control.
struct ImageLevels {
  double background_dn = 0.0;  // median
  double noise_dn = 0.0;       // sigma of the dark pixels
  int rejected_spots = 0;      // hot pixels, glare, streaks
  int dropped_spots = 0;       // good ones beyond kMaxCentres; the faintest are dropped
};

struct FoundCentres {
  Centres centres;  // brightest first
  ImageLevels levels;
};

// Finds LED-like spots and measures their centres in one pass over the image. Holds its work space:
// no allocation after the first image of a size. One object per thread.
class CentreFinder {
 public:
  explicit CentreFinder(const FinderOptions& options);
  ~CentreFinder();
  CentreFinder(CentreFinder&&) noexcept;
  CentreFinder& operator=(CentreFinder&&) noexcept;

  // The result stays valid until the next call.
  Result<const FoundCentres*, ImageFailure> Find(const ImageView& image);

 private:
  struct WorkSpace;
  FinderOptions options_;
  std::unique_ptr<WorkSpace> work_;
};

}  // namespace tbm
