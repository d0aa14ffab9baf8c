#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "devices/sim/world.h"
#include "pose/centres/image_view.h"

namespace tbm::sim {

// How the simulated sensor and light look. Grey values are those of an 8-bit image, and hold at the
// reference exposure; all light grows in proportion to the exposure.
struct ViewOptions {
  double reference_exposure_us = 5000.0;
  double led_peak_dn = 170.0;              // of an LED at reference_distance_m
  double reference_distance_m = 4.0;       // brightness falls with the square of the distance
  double led_spread_px = 2.2;              // sigma of the spot
  double led_spread_of_brightness = 0.15;  // LEDs differ by up to +- this part
  double flicker = 0.0;  // rms part by which every LED's brightness varies per frame
  double background_dn = 12.0;
  Eigen::Vector2d background_slope_dn_per_px = {0.004, -0.003};
  double black_dn = 4.0;  // offset of the dark image, whatever the exposure
  double read_noise_dn = 0.9;
  double gain_dn_per_electron = 0.02;
  int hot_pixels = 40;
  std::uint64_t seed = 1;
};

// Renders what the camera sees of a world, fast enough to serve a stream: the noise comes from a
// bank drawn once and read from a different place in every row of every frame. Made for simulators;
// tests of the centre finder bring their own images.
//
// Not thread-safe; one per rendering thread.
class CameraView {
 public:
  CameraView(std::shared_ptr<const World> world, const ViewOptions& options);

  // Mono8, rows without padding, into `pixels` of width * height bytes. Every image is a function
  // of (world, options, sensed_at, exposure) alone.
  void Render(Timestamp sensed_at, double exposure_us, std::uint8_t* pixels);

  int width_px() const { return width_px_; }
  int height_px() const { return height_px_; }
  std::size_t size_bytes() const;

 private:
  struct Spot {
    Eigen::Vector2d pixel_px;
    Eigen::Vector2d spread_px;
    double peak_dn;
  };

  void DrawBackground(double light, std::uint64_t key, std::uint8_t* pixels) const;
  void CollectSpots(Timestamp sensed_at, double light, std::uint64_t key);
  void DrawSpot(const Spot& spot, std::uint64_t key, std::uint8_t* pixels);
  void DrawHotPixels(double light, std::uint8_t* pixels) const;

  std::shared_ptr<const World> world_;
  ViewOptions options_;
  int width_px_;
  int height_px_;
  std::vector<std::int16_t> noise_;  // standard normal, times 256
  std::vector<double> led_strength_;
  std::vector<Spot> spots_;
  std::vector<double> profile_;  // of one spot across its columns
};

}  // namespace tbm::sim
