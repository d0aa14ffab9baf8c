#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>

namespace tbm {

// One LED in one image, as far as its brightness goes.
struct LedLevel {
  double peak_dn = 0.0;  // grey value of its brightest pixel, background included
  bool is_clipped = false;
};

// What one frame says about its exposure.
struct ExposureSample {
  double exposure_us = 0.0;  // that this frame was taken with
  double full_scale_dn = 255.0;
  std::span<const LedLevel> leds;  // the LEDs that were recognised; may be empty
  bool is_saturated = false;       // most of the image is at full scale
};

struct ExposureLimits {
  double min_us = 20.0;
  double max_us = 50'000.0;
};

// Holds the LEDs' peaks between 40 and 90 % of full scale by the exposure time.
//
// A grey value is proportional to the exposure until it clips, so one multiplication is enough
// where nothing clips: the geometric mean of the brightest and the faintest LED goes to kTarget,
// but the brightest never above kBrightest. Of LEDs that differ by more than 0.9 / 0.4 = 2.25 times
// the bright ones decide: a clipped peak costs more than a dim one. Nothing is done inside the
// band.
//
// Decisions rest on the median of kFrames frames, so one lamp that flickers past moves nothing.
// Only one step is in flight: after a step, frames with another exposure and kSettle frames with
// the new one are not looked at; a camera that never gets there is asked again after kPatience
// frames.
//
// Without any LED the exposure is kept for kHold frames (somebody stands in the way), then all
// exposures are searched by factors of kSearch: up to the limit, then round to the lowest.
class ExposureControl {
 public:
  static constexpr double kLowest = 0.40;
  static constexpr double kHighest = 0.90;
  static constexpr double kTarget = 0.62;
  static constexpr double kBrightest = 0.80;
  static constexpr double kLargestStep = 4.0;
  static constexpr double kClippedStep = 0.4;
  static constexpr double kSearch = 3.0;
  static constexpr std::size_t kFrames = 5;
  static constexpr int kSettle = 2;
  static constexpr int kPatience = 30;
  static constexpr int kHold = 20;

  explicit ExposureControl(const ExposureLimits& limits) : limits_(limits) {}

  // The exposure to request now, if it should change. One call per frame, in order.
  std::optional<double> Update(const ExposureSample& sample);

 private:
  struct Levels {
    double brightest = 0.0;  // parts of full scale
    double faintest = 0.0;
    bool is_clipped = false;
  };

  bool IsWaiting(double exposure_us);
  double Factor() const;
  std::optional<double> Search(const ExposureSample& sample);
  std::optional<double> Step(double from_us, double to_us);

  ExposureLimits limits_;
  std::optional<double> requested_us_;
  int waited_ = 0;
  int settled_ = 0;
  int without_leds_ = 0;
  std::array<Levels, kFrames> recent_{};
  std::size_t count_ = 0;
};

}  // namespace tbm
