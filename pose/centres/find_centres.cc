#include "pose/centres/find_centres.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "pose/base/check.h"
#include "pose/centres/any_above.h"
#include "pose/centres/image_levels.h"
#include "pose/centres/label_runs.h"
#include "pose/centres/measure_spot.h"
#include "pose/centres/split_blobs.h"

namespace tbm {
namespace {

constexpr int kBlockHeight = 8;
constexpr std::size_t kPiecesPerBlock = kBlockWidth / LevelMap::kPieceWidth;
static_assert(kPiecesPerBlock == 4);
constexpr std::size_t kMaxRuns = 32768;
constexpr std::size_t kMaxNeighbours = 8;
constexpr int kMaxRounds = 10;       // of correcting neighbours for each other's light
constexpr double kSettledPx = 5e-4;  // a round that moves nothing further is the last

// What rises less than this above its surroundings is no lamp: pipes, wet walls.
constexpr double kLowestOffset = 1.0 / 28.0;  // of full scale
// Assumed until the spots themselves tell: a small sensor's well, so that sigmas err to the large.
constexpr double kAssumedWellElectrons = 10000.0;
constexpr double kLargestWellElectrons = 100000.0;
// Shape misfit, as a share of the spot's light, beyond which it is no spot.
constexpr double kLargestMisfit = 0.3;

struct Candidate {
  SpotGuess guess;
  SpotFit fit;
  bool failed = false;
  double moved_px = 0.0;  // in the last round, when the neighbours' light was corrected
  double left_px = 0.0;   // to go, if the rounds went on to shrink as the last two did
  double overlap = 0.0;   // of the neighbours' light, see Overlap
};

SpotFit AsFit(const SpotGuess& guess) {
  SpotFit fit;
  fit.u_px = guess.u_px;
  fit.v_px = guess.v_px;
  fit.amplitude_dn = guess.amplitude_dn;
  fit.sigma_u_px = fit.sigma_v_px = guess.spread_px;
  return fit;
}

bool Near(const SpotFit& a, const SpotFit& b) {
  const double reach =
      5.0 * (std::max(a.sigma_u_px, a.sigma_v_px)) + 4.0 * std::max(b.sigma_u_px, b.sigma_v_px);
  return std::abs(a.u_px - b.u_px) < reach && std::abs(a.v_px - b.v_px) < reach;
}

double PixelAt(const ImageView& image, double u_px, double v_px) {
  const int u = std::clamp(static_cast<int>(std::lround(u_px)), 0, image.width_px - 1);
  const int v = std::clamp(static_cast<int>(std::lround(v_px)), 0, image.height_px - 1);
  const std::byte* at = static_cast<const std::byte*>(image.pixels) + v * image.stride_bytes +
                        static_cast<std::ptrdiff_t>(u) * image.bytes_per_pixel;
  return image.bytes_per_pixel == 1 ? LoadPixel<std::uint8_t>(at) : LoadPixel<std::uint16_t>(at);
}

// A cheap look before the fit: on every line through a spot the light falls off to at least one
// side. On a pipe, a cable or the wall it goes on to both.
bool StandsOut(const ImageView& image, const SpotGuess& guess, double lowest_contrast_dn) {
  // Cosine and sine of eight directions, evenly over half a turn.
  constexpr std::array<std::array<double, 2>, 8> kLines = {{{1.0, 0.0},
                                                            {0.924, 0.383},
                                                            {0.707, 0.707},
                                                            {0.383, 0.924},
                                                            {0.0, 1.0},
                                                            {-0.383, 0.924},
                                                            {-0.707, 0.707},
                                                            {-0.924, 0.383}}};
  const double reach_px = 3.0 * guess.spread_px + 1.0;
  double lowest = image.max_value;
  double highest_of_lower = 0.0;
  for (const auto& line : kLines) {
    const double du = reach_px * line[0];
    const double dv = reach_px * line[1];
    const double lower = std::min(PixelAt(image, guess.u_px + du, guess.v_px + dv),
                                  PixelAt(image, guess.u_px - du, guess.v_px - dv));
    lowest = std::min(lowest, lower);
    highest_of_lower = std::max(highest_of_lower, lower);
  }
  const double peak = std::min<double>(guess.background_dn + guess.amplitude_dn, image.max_value);
  const double contrast = peak - lowest;
  return contrast > lowest_contrast_dn && peak - highest_of_lower > 0.4 * contrast;
}

// How much more variance a centre has because the neighbours under it are only estimated: the
// product of the two spots' derivatives, times four for amplitude and spread, which are less well
// told apart than the places (measured: spots three sigmas apart have 1.5 times the sigma).
double Overlap(const SpotFit& fit, std::span<const SpotFit* const> others) {
  double overlap = 0.0;
  const double spread2 = fit.sigma_u_px * fit.sigma_v_px;
  for (const SpotFit* other : others) {
    const double mean2 = 0.5 * (spread2 + other->sigma_u_px * other->sigma_v_px);
    const double du = fit.u_px - other->u_px;
    const double dv = fit.v_px - other->v_px;
    const double apart2 = (du * du + dv * dv) / mean2;
    overlap += 2.0 * apart2 * std::exp(-0.25 * apart2);
  }
  return overlap;
}

// Difference of the two axes' second moments and twice the mixed moment: what has a direction.
struct Stretch {
  double along_px2 = 0.0;
  double across_px2 = 0.0;
};
Stretch StretchOf(const SpotFit& fit) {
  return {fit.moment_uu_px2 - fit.moment_vv_px2, 2.0 * fit.moment_uv_px2};
}

}  // namespace

struct CentreFinder::WorkSpace {
  explicit WorkSpace(const FinderOptions& options)
      : labeller(kMaxRuns),
        splitter(kMaxRuns),
        meter(options.min_spread_px, options.max_spread_px) {
    candidates.reserve(splitter.guesses().capacity());
    order.reserve(candidates.capacity());
    sorted.reserve(candidates.capacity());
  }

  LevelMap levels;
  RunLabeller labeller;
  BlobSplitter splitter;
  SpotMeter meter;
  std::vector<Candidate> candidates;
  std::vector<std::size_t> order;
  std::vector<double> sorted;
  std::vector<int> thresholds;        // of a strip of blocks, per piece
  std::vector<int> lowest_threshold;  // of each block
  std::vector<std::size_t> bright_blocks;
  FoundCentres found;
  double offset_dn = 0.0;  // of the threshold above the level
  double gain = 0.0;

  template <class Pixel>
  void ScanImage(const ImageView& image);
  void SetThresholds(float v_px);
  template <class Pixel>
  void ScanRow(const std::byte* row_start, int row, const ImageView& image);
  std::size_t CollectGuesses(const ImageView& image, const FinderOptions& options);
  void MeasureAll(const ImageView& image, const FinderOptions& options);
  double MeasureRound(const ImageView& image, const SensorNoise& noise, bool first);
  void DropDoubles(double closer_than_spreads);
  double MedianOfSorted();
  void EstimateGain(const FinderOptions& options, double full_dn);
  Stretch CommonStretch();
  void Report(const FinderOptions& options);
};

CentreFinder::CentreFinder(const FinderOptions& options)
    : options_(options), work_(std::make_unique<WorkSpace>(options)) {}
CentreFinder::~CentreFinder() = default;
CentreFinder::CentreFinder(CentreFinder&&) noexcept = default;
CentreFinder& CentreFinder::operator=(CentreFinder&&) noexcept = default;

Result<const FoundCentres*, ImageFailure> CentreFinder::Find(const ImageView& image) {
  TBM_CHECK(image.bytes_per_pixel == 1 || image.bytes_per_pixel == 2);
  TBM_CHECK(image.width_px >= 0 && image.height_px >= 0 && image.max_value > 0);
  TBM_CHECK(image.stride_bytes >= std::ptrdiff_t{image.bytes_per_pixel} * image.width_px);
  WorkSpace& work = *work_;
  work.bright_blocks.reserve(static_cast<std::size_t>(image.width_px / kBlockWidth + 1));
  work.found.centres.clear();
  work.found.levels = {};
  if (image.width_px == 0 || image.height_px == 0) return Failure{ImageFailure::kDark};

  work.levels.Measure(image);
  work.found.levels.background_dn = static_cast<double>(work.levels.median_dn());
  work.found.levels.noise_dn = static_cast<double>(work.levels.noise_dn());
  if (static_cast<double>(work.levels.saturated_fraction()) > options_.saturated_fraction) {
    return Failure{ImageFailure::kSaturated};
  }
  // A noisy image can have more runs than there is room for: then only what is brighter is looked
  // at.
  work.offset_dn = std::max(
      {0.6 * options_.min_snr * work.found.levels.noise_dn, kLowestOffset * image.max_value, 1.0});
  do {
    work.labeller.Clear();
    if (image.bytes_per_pixel == 1) {
      work.ScanImage<std::uint8_t>(image);
    } else {
      work.ScanImage<std::uint16_t>(image);
    }
    if (!work.labeller.overflowed()) break;
    work.offset_dn *= 2.0;
  } while (work.offset_dn < image.max_value);
  if (work.CollectGuesses(image, options_) == 0) return Failure{ImageFailure::kDark};
  work.MeasureAll(image, options_);
  work.Report(options_);
  return &work.found;
}

// The one pass over the image: the brightest pixel of each block against the lowest threshold of
// its pieces. Only blocks that exceed it are looked at again, while they are in the cache.
template <class Pixel>
void CentreFinder::WorkSpace::ScanImage(const ImageView& image) {
  static_assert(LevelMap::kTileSize == kBlockWidth);
  const auto* first = static_cast<const std::byte*>(image.pixels);
  for (int row = 0; row < image.height_px; row += kBlockHeight) {
    const int rows = std::min(kBlockHeight, image.height_px - row);
    SetThresholds(static_cast<float>(row) + 0.5f * static_cast<float>(rows - 1));
    bright_blocks.clear();
    for (int column = 0; column < image.width_px; column += kBlockWidth) {
      const int columns = std::min(kBlockWidth, image.width_px - column);
      const std::byte* at = first + row * image.stride_bytes + column * int{sizeof(Pixel)};
      const auto block = static_cast<std::size_t>(column / kBlockWidth);
      const int threshold = lowest_threshold[block];
      const bool bright =
          columns == kBlockWidth
              ? AnyAbove<Pixel>(at, image.stride_bytes, rows, threshold)
              : AnyAbovePlain<Pixel>(at, image.stride_bytes, columns, rows, threshold);
      if (bright) bright_blocks.push_back(block);
    }
    for (int y = row; y < row + rows && !bright_blocks.empty(); ++y) {
      ScanRow<Pixel>(first + y * image.stride_bytes, y, image);
    }
  }
}

void CentreFinder::WorkSpace::SetThresholds(float v_px) {
  const std::span<const float> level = levels.AlongRow(v_px);
  thresholds.resize(level.size());
  lowest_threshold.resize(level.size() / kPiecesPerBlock);
  for (std::size_t i = 0; i < level.size(); ++i) {
    thresholds[i] = static_cast<int>(level[i] + static_cast<float>(offset_dn));
  }
  for (std::size_t i = 0; i < lowest_threshold.size(); ++i) {
    const int* piece = &thresholds[i * kPiecesPerBlock];
    lowest_threshold[i] = std::min(std::min(piece[0], piece[1]), std::min(piece[2], piece[3]));
  }
}

template <class Pixel>
void CentreFinder::WorkSpace::ScanRow(const std::byte* row_start, int row, const ImageView& image) {
  for (const std::size_t block : bright_blocks) {
    const int column = static_cast<int>(block) * kBlockWidth;
    for (std::size_t piece = 0; piece < kPiecesPerBlock; ++piece) {
      constexpr int kPiece = LevelMap::kPieceWidth;
      const int begin = column + static_cast<int>(piece) * kPiece;
      const int end = std::min(begin + kPiece, image.width_px);
      const int threshold = thresholds[block * kPiecesPerBlock + piece];
      const std::byte* at = row_start + begin * int{sizeof(Pixel)};
      if (end - begin == kPiece && !AnyAbove<Pixel, kPiece>(at, 0, 1, threshold)) continue;
      labeller.Scan<Pixel>(row_start, row, begin, end, threshold, image.max_value);
    }
  }
}

// Returns how many blobs there were that are more than a hot pixel.
std::size_t CentreFinder::WorkSpace::CollectGuesses(const ImageView& image,
                                                    const FinderOptions& options) {
  const double full_dn = image.max_value;
  SplitOptions split;
  split.max_spread_px = options.max_spread_px;
  split.noise_dn = found.levels.noise_dn;
  split.gain_dn_per_electron =
      options.gain_dn_per_electron.value_or(full_dn / kAssumedWellElectrons);
  std::size_t blobs = 0;
  splitter.guesses().clear();
  for (const Blob& blob : labeller.Finish()) {
    const float level = levels.At(static_cast<float>(blob.u_px()), static_cast<float>(blob.v_px()));
    RaisedBlob raised{blob, static_cast<double>(level), offset_dn};
    raised.offset_dn = std::floor(raised.background_dn + offset_dn) + 0.5 - raised.background_dn;
    raised.offset_dn = std::max(raised.offset_dn, 0.5);
    const SpotGuess guess = GuessSpot(raised, image.max_value);
    if (blob.pixels < 3 || guess.spread_px < 0.55 * options.min_spread_px) {
      ++found.levels.rejected_spots;
      continue;
    }
    ++blobs;
    if (!splitter.Split(image, raised, split)) ++found.levels.dropped_spots;
  }
  return blobs;
}

void CentreFinder::WorkSpace::MeasureAll(const ImageView& image, const FinderOptions& options) {
  const double full_dn = image.max_value;
  const double assumed_gain =
      options.gain_dn_per_electron.value_or(full_dn / kAssumedWellElectrons);
  SensorNoise noise{assumed_gain, found.levels.noise_dn * found.levels.noise_dn};
  if (options.read_noise_dn) {
    const double read = *options.read_noise_dn;
    noise.dark_variance_dn2 = std::max(noise.dark_variance_dn2, read * read + 1.0 / 12.0);
  }
  candidates.clear();
  for (const SpotGuess& guess : splitter.guesses()) {
    if (guess.spread_px > 1.5 * options.max_spread_px ||
        !StandsOut(image, guess, 0.7 * options.min_snr * found.levels.noise_dn)) {
      ++found.levels.rejected_spots;
      continue;
    }
    candidates.push_back({guess, AsFit(guess)});
  }
  DropDoubles(1.2);
  MeasureRound(image, noise, true);
  DropDoubles(0.7);
  for (int round = 0; round < kMaxRounds; ++round) {
    if (MeasureRound(image, noise, false) < kSettledPx) break;
  }
  DropDoubles(0.7);
  EstimateGain(options, full_dn);
}

// Two guesses can lead to one spot; the later one goes.
void CentreFinder::WorkSpace::DropDoubles(double closer_than_spreads) {
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    const SpotFit& a = candidates[i].fit;
    std::erase_if(candidates, [&](const Candidate& other) {
      const SpotFit& b = other.fit;
      return &other > &candidates[i] &&
             std::hypot(a.u_px - b.u_px, a.v_px - b.v_px) <
                 closer_than_spreads * std::min(a.sigma_u_px, b.sigma_u_px);
    });
  }
}

// Each spot without the light of the others in its window, as far as they are known by now. The
// first round measures all, further ones only those that have such neighbours. Returns the
// longest way that any has moved [px].
double CentreFinder::WorkSpace::MeasureRound(const ImageView& image,
                                             const SensorNoise& noise,
                                             bool first) {
  double longest_px = 0.0;
  for (Candidate& candidate : candidates) {
    std::array<const SpotFit*, kMaxNeighbours> others;
    std::size_t count = 0;
    for (const Candidate& other : candidates) {
      if (count == kMaxNeighbours) break;
      if (&other == &candidate || other.failed || !Near(candidate.fit, other.fit)) continue;
      others[count++] = &other.fit;
    }
    if (!first && count == 0) continue;
    SpotGuess start = candidate.guess;
    start.u_px = candidate.fit.u_px;
    start.v_px = candidate.fit.v_px;
    start.amplitude_dn = candidate.fit.amplitude_dn;
    start.spread_px = std::sqrt(candidate.fit.sigma_u_px * candidate.fit.sigma_v_px);
    SpotFit fit;
    const auto neighbours = std::span(others).first(count);
    if (meter.Measure(image, start, noise, neighbours, &fit) == SpotVerdict::kMeasured) {
      const double moved_px = std::hypot(fit.u_px - start.u_px, fit.v_px - start.v_px);
      const double rate = std::clamp(moved_px / std::max(candidate.moved_px, 1e-9), 0.5, 0.95);
      candidate.left_px = first ? 0.0 : moved_px * rate / (1.0 - rate);
      candidate.moved_px = moved_px;
      candidate.overlap = Overlap(fit, neighbours);
      longest_px = std::max(longest_px, moved_px);
      candidate.fit = fit;
    } else {
      candidate.failed = first;
    }
  }
  const auto failed = std::erase_if(candidates, [](const Candidate& c) { return c.failed; });
  found.levels.rejected_spots += static_cast<int>(failed);
  return longest_px;
}

double CentreFinder::WorkSpace::MedianOfSorted() {
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  return *middle;
}

// From the residuals of the spots: their variance grows with their light by the gain. A spot of
// another shape asks for more than the rest and has no say.
void CentreFinder::WorkSpace::EstimateGain(const FinderOptions& options, double full_dn) {
  gain = options.gain_dn_per_electron.value_or(full_dn / kAssumedWellElectrons);
  if (options.gain_dn_per_electron || candidates.empty()) return;
  sorted.clear();
  for (const Candidate& c : candidates) sorted.push_back(c.fit.gain_seen);
  const double median = MedianOfSorted();
  double weights = 0.0;
  double sum = 0.0;
  for (const Candidate& c : candidates) {
    if (c.fit.gain_seen > median + 2.0 * c.fit.gain_seen_sigma) continue;
    const double weight = 1.0 / (c.fit.gain_seen_sigma * c.fit.gain_seen_sigma);
    weights += weight;
    sum += weight * c.fit.gain_seen;
  }
  gain = std::max(sum / weights, full_dn / kLargestWellElectrons);
}

// Motion blur stretches every spot of an image alike.
Stretch CentreFinder::WorkSpace::CommonStretch() {
  if (candidates.size() < 3) return {};
  Stretch common;
  sorted.clear();
  for (const Candidate& c : candidates) sorted.push_back(StretchOf(c.fit).along_px2);
  common.along_px2 = MedianOfSorted();
  sorted.clear();
  for (const Candidate& c : candidates) sorted.push_back(StretchOf(c.fit).across_px2);
  common.across_px2 = MedianOfSorted();
  return common;
}

void CentreFinder::WorkSpace::Report(const FinderOptions& options) {
  order.clear();
  for (std::size_t i = 0; i < candidates.size(); ++i) order.push_back(i);
  std::sort(order.begin(), order.end(), [this](std::size_t a, std::size_t b) {
    return candidates[a].fit.amplitude_dn > candidates[b].fit.amplitude_dn;
  });
  const Stretch common = CommonStretch();
  for (const std::size_t i : order) {
    const SpotFit& fit = candidates[i].fit;
    const double spread = fit.SpreadPx();
    const double elongation = fit.Elongation();
    // What the residuals show beyond noise, as a share of the spot's light.
    const double excess = std::max(fit.gain_seen - gain - 2.5 * fit.gain_seen_sigma, 0.0);
    const double misfit = std::sqrt(2.0 * excess / fit.amplitude_dn);
    const bool good = spread >= options.min_spread_px && spread <= options.max_spread_px &&
                      elongation <= options.max_elongation && misfit <= kLargestMisfit &&
                      fit.amplitude_dn >= options.min_snr * std::sqrt(fit.background_variance_dn2);
    if (!good) {
      ++found.levels.rejected_spots;
      continue;
    }
    if (found.centres.full()) {
      ++found.levels.dropped_spots;
      continue;
    }
    // Longer than round, and longer than the rest: two lamps in one, their distance unknown.
    const Stretch own = StretchOf(fit);
    const double beyond_round = std::hypot(own.along_px2, own.across_px2);
    const double beyond_rest =
        std::hypot(own.along_px2 - common.along_px2, own.across_px2 - common.across_px2);
    const double beyond = std::min(beyond_round, beyond_rest);
    const double double_variance = beyond > 0.3 * spread * spread ? beyond : 0.0;
    double noise_variance = 0.5 * (fit.by_dark_u_px2 + fit.by_dark_v_px2) +
                            0.5 * gain * (fit.by_gain_u_px2 + fit.by_gain_v_px2);
    // A step of the background under the spot pulls the centre by about its height by the spot's,
    // in spreads, and the height is about twice the RMS; the same goes for light that has another
    // shape than the model.
    const double share = std::hypot(misfit, 2.0 * fit.background_structure_dn / fit.amplitude_dn);
    const double structure_variance = share * share * spread * spread;
    Centre centre;
    centre.pixel_px = {fit.u_px, fit.v_px};
    const double unsettled_px = candidates[i].left_px;
    noise_variance *= 1.0 + candidates[i].overlap;
    noise_variance += unsettled_px * unsettled_px;
    centre.sigma_px = std::sqrt(noise_variance + structure_variance + double_variance);
    centre.peak_dn = fit.amplitude_dn;
    centre.background_dn = fit.background_dn;
    centre.spread_px = spread;
    centre.elongation = elongation;
    centre.clipped_pixels = fit.clipped_pixels;
    found.centres.push_back(centre);
  }
}

}  // namespace tbm
