#include "devices/sim/camera_view.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "devices/sim/hash_noise.h"

namespace tbm::sim {
namespace {

// Long enough that a row's piece hardly ever repeats within a frame, short enough for the cache.
constexpr std::size_t kNoiseBank = std::size_t{1} << 17;
constexpr double kFullScale = 255.0;

// The part of a Gaussian of unit peak that falls on the pixel `at`, averaged over the pixel.
double PixelMean(double at, double centre, double spread) {
  const double scale = 1.0 / (spread * std::sqrt(2.0));
  const double area = std::erf((at + 0.5 - centre) * scale) - std::erf((at - 0.5 - centre) * scale);
  return area * spread * std::sqrt(std::numbers::pi / 2.0);
}

std::uint8_t Clipped(double value) {
  return static_cast<std::uint8_t>(std::clamp(value + 0.5, 0.0, kFullScale));
}

}  // namespace

CameraView::CameraView(std::shared_ptr<const World> world, const ViewOptions& options)
    : world_(std::move(world)),
      options_(options),
      width_px_(world_->rig().camera.image_width_px),
      height_px_(world_->rig().camera.image_height_px),
      noise_(kNoiseBank + static_cast<std::size_t>(width_px_)) {
  for (std::size_t i = 0; i < kNoiseBank; ++i) {
    const double value = NormalFrom(Mixed(options_.seed) + 2 * i);
    noise_[i] =
        static_cast<std::int16_t>(std::lround(std::clamp(256.0 * value, -32000.0, 32000.0)));
  }
  // A row may start anywhere in the bank and runs on past its end.
  std::copy_n(noise_.begin(), width_px_, noise_.begin() + static_cast<std::ptrdiff_t>(kNoiseBank));
  for (std::size_t led = 0; led < world_->rig().leds.size(); ++led) {
    const double draw = 2.0 * UnitFrom(Mixed(options_.seed ^ (0x1ED0 + led))) - 1.0;
    led_strength_.push_back(1.0 + options_.led_spread_of_brightness * draw);
  }
}

std::size_t CameraView::size_bytes() const {
  return static_cast<std::size_t>(width_px_) * static_cast<std::size_t>(height_px_);
}

void CameraView::Render(Timestamp sensed_at, double exposure_us, std::uint8_t* pixels) {
  const double light = exposure_us / options_.reference_exposure_us;
  const std::uint64_t key = Mixed(options_.seed ^ static_cast<std::uint64_t>(sensed_at.ns));
  DrawBackground(light, key, pixels);
  CollectSpots(sensed_at, light, key);
  for (std::size_t i = 0; i < spots_.size(); ++i) DrawSpot(spots_[i], Mixed(key + i), pixels);
  DrawHotPixels(light, pixels);
}

// In integers of 1/256 DN, so that the compiler can do many pixels at a time.
void CameraView::DrawBackground(double light, std::uint64_t key, std::uint8_t* pixels) const {
  for (int v = 0; v < height_px_; ++v) {
    const double from_middle = v - 0.5 * height_px_;
    const double left_dn = options_.background_dn +
                           options_.background_slope_dn_per_px.y() * from_middle -
                           options_.background_slope_dn_per_px.x() * 0.5 * width_px_;
    const double signal_dn = std::max(0.0, light * options_.background_dn);
    const double sigma_dn = std::sqrt(options_.read_noise_dn * options_.read_noise_dn +
                                      options_.gain_dn_per_electron * signal_dn);
    // Beyond a few times full scale noise is noise, and the sums below stay in an int.
    const int sigma_256 = static_cast<int>(std::lround(256.0 * std::min(sigma_dn, 1000.0)));
    const int left_65536 = static_cast<int>(
        65536.0 * std::clamp(options_.black_dn + light * left_dn + 0.5, -1000.0, 4000.0));
    const int slope_65536 = static_cast<int>(
        65536.0 * std::clamp(light * options_.background_slope_dn_per_px.x(), -8.0, 8.0));
    const std::size_t start = Mixed(key + static_cast<std::uint64_t>(v)) % kNoiseBank;
    const std::int16_t* const noise = noise_.data() + start;
    std::uint8_t* const row =
        pixels + static_cast<std::size_t>(v) * static_cast<std::size_t>(width_px_);
    for (int u = 0; u < width_px_; ++u) {
      const int value =
          (left_65536 / 256 + slope_65536 * u / 256 + sigma_256 * noise[u] / 256) / 256;
      row[u] = static_cast<std::uint8_t>(std::min(std::max(value, 0), 255));
    }
  }
}

void CameraView::CollectSpots(Timestamp sensed_at, double light, std::uint64_t key) {
  spots_.clear();
  const Rig& rig = world_->rig();
  const Rigid3 camera_from_target = world_->At(sensed_at).camera_from_target;
  const double t_s = world_->SecondsAt(sensed_at);
  const Eigen::Vector2d spread_px(options_.led_spread_px, options_.led_spread_px);

  for (std::size_t led = 0; led < rig.leds.size(); ++led) {
    const Eigen::Vector3d p_in_camera = camera_from_target * rig.leds[led].p_led_in_target;
    const auto projection = Project(rig.camera, p_in_camera);
    if (!projection || world_->IsHidden(led, sensed_at)) continue;
    const double nearness = options_.reference_distance_m / p_in_camera.norm();
    const double flicker = 1.0 + options_.flicker * NormalFrom(key ^ (0xF11C << 8) ^ led);
    const double peak_dn = options_.led_peak_dn * light * nearness * nearness * led_strength_[led] *
                           std::max(0.0, flicker);
    spots_.push_back({projection->pixel_px, spread_px, peak_dn});
  }
  const std::size_t leds_in_view = spots_.size();
  for (const Reflection& reflection : world_->faults().reflections) {
    if (!reflection.window.Contains(t_s)) continue;
    for (std::size_t i = 0; i < leds_in_view; ++i) {
      Spot ghost = spots_[i];
      if (reflection.is_mirrored)
        ghost.pixel_px.x() = 2.0 * reflection.mirror_u_px - ghost.pixel_px.x();
      ghost.pixel_px += reflection.shift_px;
      ghost.peak_dn *= reflection.strength;
      spots_.push_back(ghost);
    }
  }
  for (const Lamp& lamp : world_->faults().lamps) {
    if (lamp.window.Contains(t_s))
      spots_.push_back({lamp.pixel_px, lamp.spread_px, lamp.peak_dn * light});
  }
}

void CameraView::DrawSpot(const Spot& spot, std::uint64_t key, std::uint8_t* pixels) {
  const Eigen::Vector2d reach = 5.0 * spot.spread_px + Eigen::Vector2d(1.0, 1.0);
  const auto first = [](double at) { return static_cast<int>(std::floor(std::max(at, 0.0))); };
  const auto last = [](double at, int size) {
    return static_cast<int>(std::floor(std::min(at, size - 1.0)));
  };
  const int u0 = first(spot.pixel_px.x() - reach.x());
  const int u1 = last(spot.pixel_px.x() + reach.x(), width_px_);
  const int v0 = first(spot.pixel_px.y() - reach.y());
  const int v1 = last(spot.pixel_px.y() + reach.y(), height_px_);
  if (u1 < u0 || v1 < v0) return;

  profile_.clear();
  for (int u = u0; u <= u1; ++u)
    profile_.push_back(PixelMean(u, spot.pixel_px.x(), spot.spread_px.x()));
  for (int v = v0; v <= v1; ++v) {
    const double across = spot.peak_dn * PixelMean(v, spot.pixel_px.y(), spot.spread_px.y());
    const std::size_t start = Mixed(key + static_cast<std::uint64_t>(v)) % kNoiseBank;
    std::uint8_t* const row =
        pixels + static_cast<std::size_t>(v) * static_cast<std::size_t>(width_px_);
    for (int u = u0; u <= u1; ++u) {
      const auto column = static_cast<std::size_t>(u - u0);
      const double signal_dn = across * profile_[column];
      // The background's noise is in the pixel already; this is the spot's own photon noise.
      const double sigma_dn = std::sqrt(options_.gain_dn_per_electron * signal_dn);
      row[u] = Clipped(row[u] + signal_dn + sigma_dn * noise_[start + column] / 256.0);
    }
  }
}

void CameraView::DrawHotPixels(double light, std::uint8_t* pixels) const {
  for (int i = 0; i < options_.hot_pixels; ++i) {
    const std::uint64_t draw =
        Mixed(options_.seed ^ (0xB07ull << 32) ^ static_cast<std::uint64_t>(i));
    const double dark_dn = 30.0 + 200.0 * UnitFrom(Mixed(draw));
    std::uint8_t& pixel = pixels[draw % size_bytes()];
    pixel = Clipped(pixel + dark_dn * std::min(light, 2.0));
  }
}

}  // namespace tbm::sim
