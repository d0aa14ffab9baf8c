#include "pose/centres/find_centres.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <span>
#include <tuple>
#include <vector>

#include "pose/base/check.h"
#include "pose/centres/elementary.h"
#include "pose/centres/image_levels.h"
#include "pose/centres/label_runs.h"
#include "pose/centres/measure_spot.h"
#include "pose/centres/scan_image.h"
#include "pose/centres/split_blobs.h"
#include "pose/centres/vectors.h"

namespace tbm {
namespace {

constexpr std::size_t kMaxRuns = 32768;
constexpr std::size_t kMaxNeighbours = 8;
constexpr int kMaxRounds = 10;       // of correcting neighbours for each other's light
constexpr double kSettledPx = 5e-4;  // what moves no further does not disturb its neighbours
// With more spots than this, those that hardly overlap are measured once.
constexpr std::size_t kCrowd = 24;
// Twice as many as can be reported: among the brighter ones some turn out to be no spots.
constexpr std::size_t kMaxCandidates = 2 * kMaxCentres;

// What rises less than this above its surroundings is no lamp: pipes, wet walls.
constexpr double kLowestOffset = 1.0 / 28.0;  // of full scale
// Assumed until the spots themselves tell: a small sensor's well, so that sigmas err to the large.
constexpr double kAssumedWellElectrons = 10000.0;
constexpr double kLargestWellElectrons = 100000.0;
// Shape misfit, as a share of the spot's light, beyond which it is no spot.
constexpr double kLargestMisfit = 0.3;
// A guess of the spread is too large by some percent, never too small by as much.
constexpr double kNarrowGuess = 1.1;
constexpr double kLongGuess = 1.3;
// What rises so little above the threshold's offset says nothing of its width.
constexpr double kFaintest = 1.25;

struct Candidate {
  SpotGuess guess;
  SpotFit fit;  // of the guess, until measured
  bool measured = false;
  bool gone = false;       // no spot, or another candidate's
  bool unsettled = false;  // moved in the last round, so that its neighbours' light changed
  double moved_px = 0.0;   // in the last round, when the neighbours' light was corrected
  double left_px = 0.0;    // to go, if the rounds went on to shrink as the last two did
  double overlap = 0.0;    // of the neighbours' light, see Overlap
  // Whose light falls into the window or the frame around it.
  std::array<std::uint16_t, kMaxNeighbours> neighbours{};
  std::uint16_t neighbour_count = 0;
};

SpotFit AsFit(const SpotGuess& guess) {
  SpotFit fit;
  fit.u_px = guess.u_px;
  fit.v_px = guess.v_px;
  fit.amplitude_dn = guess.amplitude_dn;
  fit.sigma_u_px = fit.sigma_v_px = guess.spread_px;
  return fit;
}

bool Near(const SpotGuess& a, const SpotGuess& b) {
  const double reach = 5.5 * a.spread_px + 4.5 * b.spread_px;
  return std::abs(a.v_px - b.v_px) < reach && std::abs(a.u_px - b.u_px) < reach;
}

double SquaredDistance(const SpotFit& a, const SpotFit& b) {
  const double du = a.u_px - b.u_px;
  const double dv = a.v_px - b.v_px;
  return du * du + dv * dv;
}

// Whether the light of one falls on pixels that say where the other is: the product of both, in
// their common middle, is more than 1e-4 of their heights.
bool Overlapping(const SpotFit& a, const SpotFit& b) {
  const double mean2 = 0.5 * (a.sigma_u_px * a.sigma_v_px + b.sigma_u_px * b.sigma_v_px);
  return SquaredDistance(a, b) < 36.0 * mean2;
}

// Towards zero below -0.5, which no place in an image is.
int Rounded(double px) { return static_cast<int>(px + 0.5); }

double PixelAt(const ImageView& image, double u_px, double v_px) {
  const int u = std::clamp(Rounded(u_px), 0, image.width_px - 1);
  const int v = std::clamp(Rounded(v_px), 0, image.height_px - 1);
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
    const double apart2 = SquaredDistance(fit, *other) / mean2;
    overlap += 2.0 * apart2 * DecayOf(0.25 * apart2);
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

double Length(double a, double b) { return std::sqrt(a * a + b * b); }

}  // namespace

struct CentreFinder::WorkSpace {
  explicit WorkSpace(const FinderOptions& options)
      : labeller(kMaxRuns),
        splitter(kMaxRuns),
        meter(options.min_spread_px, options.max_spread_px) {
    candidates.reserve(kMaxCandidates);
    order.reserve(candidates.capacity());
    sorted.reserve(candidates.capacity());
  }

  LevelMap levels;
  ImageScanner scanner;
  RunLabeller labeller;
  BlobSplitter splitter;
  SpotMeter meter;
  std::vector<Candidate> candidates;
  std::vector<std::size_t> order;
  std::vector<double> sorted;
  FoundCentres found;
  double offset_dn = 0.0;  // of the threshold above the level
  double gain = 0.0;
  bool is_crowd = false;

  std::size_t CollectGuesses(const ImageView& image, const FinderOptions& options);
  void ChooseCandidates(const ImageView& image, const FinderOptions& options);
  void MeasureAll(const ImageView& image, const FinderOptions& options);
  void FindNeighbours();
  void DropDoubles(double closer_than_spreads);
  void MeasureFirst(const ImageView& image, const SensorNoise& noise);
  void MeasureAgain(const ImageView& image, const SensorNoise& noise);
  bool Measure(const ImageView& image, const SensorNoise& noise, Candidate& candidate);
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
    work.scanner.Scan(image, work.offset_dn, work.levels, work.labeller);
    if (!work.labeller.overflowed()) break;
    work.offset_dn *= 2.0;
  } while (work.offset_dn < image.max_value);
  if (work.CollectGuesses(image, options_) == 0) return Failure{ImageFailure::kDark};
  work.MeasureAll(image, options_);
  work.Report(options_);
  return &work.found;
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
  const double narrowest_px = kNarrowGuess * options.min_spread_px;
  // Whatever the peak: the area of a narrow spot cut at 1/50 of its height.
  const int few_pixels = static_cast<int>(25.0 * narrowest_px * narrowest_px);
  for (Blob& blob : labeller.Finish()) {
    if (blob.pixels < Blob::kFewestPixels) {
      ++found.levels.rejected_spots;
      continue;
    }
    const float level = levels.At(0.5f * static_cast<float>(blob.left + blob.right),
                                  0.5f * static_cast<float>(blob.top + blob.bottom));
    const auto background_dn = static_cast<double>(level);
    // Between the grey values on both sides of the threshold.
    const auto threshold_dn = static_cast<int>(background_dn + offset_dn);
    const double raised_dn = std::max(threshold_dn + 0.5 - background_dn, 0.5);
    if (blob.pixels <= few_pixels) {
      labeller.FindPeak(image, blob);
      if (GuessSpread(blob, background_dn, raised_dn) < narrowest_px) {
        ++found.levels.rejected_spots;
        continue;
      }
    }
    labeller.LookAt(image, MostSpotPixels(options.max_spread_px), blob);
    const RaisedBlob raised{blob, background_dn, raised_dn};
    const SpotGuess guess = GuessSpot(raised, image.max_value);
    ++blobs;
    if (!splitter.Split(image, raised, guess, split)) ++found.levels.dropped_spots;
  }
  return blobs;
}

// Brightest first.
void CentreFinder::WorkSpace::ChooseCandidates(const ImageView& image,
                                               const FinderOptions& options) {
  std::vector<SpotGuess>& guesses = splitter.guesses();
  std::sort(guesses.begin(), guesses.end(), [](const SpotGuess& a, const SpotGuess& b) {
    return std::tie(b.amplitude_dn, a.v_px, a.u_px) < std::tie(a.amplitude_dn, b.v_px, b.u_px);
  });
  candidates.clear();
  for (const SpotGuess& guess : guesses) {
    if (candidates.size() == kMaxCandidates) {
      ++found.levels.dropped_spots;
      continue;
    }
    if (guess.spread_px > 1.5 * options.max_spread_px ||
        guess.amplitude_dn < kFaintest * offset_dn ||
        guess.elongation > kLongGuess * options.max_elongation ||
        !StandsOut(image, guess, 0.7 * options.min_snr * found.levels.noise_dn)) {
      ++found.levels.rejected_spots;
      continue;
    }
    Candidate candidate;
    candidate.guess = guess;
    candidate.fit = AsFit(guess);
    candidates.push_back(candidate);
  }
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
  ChooseCandidates(image, options);
  is_crowd = candidates.size() > kCrowd;
  FindNeighbours();
  DropDoubles(1.2);
  MeasureFirst(image, noise);
  DropDoubles(0.7);
  MeasureAgain(image, noise);
  DropDoubles(0.7);
  std::erase_if(candidates, [](const Candidate& c) { return c.gone || !c.measured; });
  EstimateGain(options, full_dn);
}

void CentreFinder::WorkSpace::FindNeighbours() {
  const auto add = [](Candidate& to, std::size_t neighbour) {
    if (to.neighbour_count == kMaxNeighbours) return;
    to.neighbours[to.neighbour_count++] = static_cast<std::uint16_t>(neighbour);
  };
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    for (std::size_t j = i + 1; j < candidates.size(); ++j) {
      const SpotGuess& a = candidates[i].guess;
      const SpotGuess& b = candidates[j].guess;
      if (Near(a, b)) add(candidates[i], j);
      if (Near(b, a)) add(candidates[j], i);
    }
  }
}

// Two guesses can lead to one spot; the fainter one goes.
void CentreFinder::WorkSpace::DropDoubles(double closer_than_spreads) {
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    Candidate& candidate = candidates[i];
    if (candidate.gone) continue;
    for (std::size_t n = 0; n < candidate.neighbour_count; ++n) {
      if (candidate.neighbours[n] < i) continue;
      Candidate& other = candidates[candidate.neighbours[n]];
      const double closest =
          closer_than_spreads * std::min(candidate.fit.sigma_u_px, other.fit.sigma_u_px);
      if (SquaredDistance(candidate.fit, other.fit) < closest * closest) other.gone = true;
    }
  }
}

// The brightest that are spots, as many as can be reported; each without the light of the others
// in its window, as far as they are known by now.
void CentreFinder::WorkSpace::MeasureFirst(const ImageView& image, const SensorNoise& noise) {
  std::size_t measured = 0;
  for (Candidate& candidate : candidates) {
    if (candidate.gone) continue;
    if (measured == kMaxCentres) {
      ++found.levels.dropped_spots;
      continue;
    }
    candidate.measured = Measure(image, noise, candidate);
    candidate.gone = !candidate.measured;
    candidate.unsettled = true;
    candidate.left_px = 0.0;
    measured += candidate.measured;
    found.levels.rejected_spots += candidate.gone;
  }
}

// Spots in each other's windows in turn, until none moves.
void CentreFinder::WorkSpace::MeasureAgain(const ImageView& image, const SensorNoise& noise) {
  for (int round = 0; round < kMaxRounds; ++round) {
    bool any = false;
    for (Candidate& candidate : candidates) {
      if (candidate.gone || !candidate.measured) continue;
      bool disturbed = false;
      for (std::size_t n = 0; n < candidate.neighbour_count; ++n) {
        const Candidate& other = candidates[candidate.neighbours[n]];
        if (!other.unsettled) continue;
        disturbed |= Overlapping(candidate.fit, other.fit) || (round == 0 && !is_crowd);
      }
      if (!disturbed) {
        if (round > 0) candidate.unsettled = false;
        continue;
      }
      any = true;
      (void)Measure(image, noise, candidate);
      candidate.unsettled = candidate.moved_px > kSettledPx;
    }
    if (!any) return;
  }
}

bool CentreFinder::WorkSpace::Measure(const ImageView& image,
                                      const SensorNoise& noise,
                                      Candidate& candidate) {
  std::array<const SpotFit*, kMaxNeighbours> others;
  std::size_t count = 0;
  for (std::size_t n = 0; n < candidate.neighbour_count; ++n) {
    const Candidate& other = candidates[candidate.neighbours[n]];
    if (!other.gone) others[count++] = &other.fit;
  }
  SpotGuess start = candidate.guess;
  start.u_px = candidate.fit.u_px;
  start.v_px = candidate.fit.v_px;
  start.amplitude_dn = candidate.fit.amplitude_dn;
  start.spread_px = std::sqrt(candidate.fit.sigma_u_px * candidate.fit.sigma_v_px);
  SpotFit fit;
  const auto neighbours = std::span(others).first(count);
  const auto care = is_crowd ? SpotMeter::Care::kQuick : SpotMeter::Care::kFull;
  if (meter.Measure(image, start, noise, neighbours, care, &fit) != SpotVerdict::kMeasured) {
    return false;
  }
  const double moved_px = Length(fit.u_px - start.u_px, fit.v_px - start.v_px);
  const double rate = std::clamp(moved_px / std::max(candidate.moved_px, 1e-9), 0.5, 0.95);
  candidate.left_px = moved_px * rate / (1.0 - rate);
  candidate.moved_px = moved_px;
  candidate.overlap = Overlap(fit, neighbours);
  candidate.fit = fit;
  return true;
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
    const double beyond_round = Length(own.along_px2, own.across_px2);
    const double beyond_rest =
        Length(own.along_px2 - common.along_px2, own.across_px2 - common.across_px2);
    const double beyond = std::min(beyond_round, beyond_rest);
    const double double_variance = beyond > 0.3 * spread * spread ? beyond : 0.0;
    double noise_variance = 0.5 * (fit.by_dark_u_px2 + fit.by_dark_v_px2) +
                            0.5 * gain * (fit.by_gain_u_px2 + fit.by_gain_v_px2);
    // A step of the background under the spot pulls the centre by about its height by the spot's,
    // in spreads, and the height is about twice the RMS; the same goes for light that has another
    // shape than the model.
    const double share = Length(misfit, 2.0 * fit.background_structure_dn / fit.amplitude_dn);
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
