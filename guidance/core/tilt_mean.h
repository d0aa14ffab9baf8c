#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "pose/base/time.h"
#include "pose/geometry/tilt.h"

namespace tbm {

// Readings of one inclinometer in half seconds of time, as far back as a round of the total station
// takes: what the tilt was when a prism was measured, told only when the answer has come. No heap.
class TiltMean {
 public:
  void Add(Timestamp sensed_at, const Inclination& inclination);

  struct Mean {
    Inclination inclination;
    int count = 0;
  };
  // Over the half seconds that touch at +- 1 s; empty where there is no reading.
  std::optional<Mean> Around(Timestamp at) const;

  std::optional<Timestamp> newest() const { return newest_; }
  void Forget() { *this = TiltMean(); }

 private:
  static constexpr std::int64_t kBinNs = 500'000'000;
  static constexpr std::size_t kBins = 256;

  struct Bin {
    std::int64_t number = -1;  // of the half second; -1: empty
    double beta_rad = 0.0;     // sums
    double gamma_rad = 0.0;
    int count = 0;
  };
  std::array<Bin, kBins> bins_{};
  std::optional<Timestamp> newest_;
};

}  // namespace tbm
