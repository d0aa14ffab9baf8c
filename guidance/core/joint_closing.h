#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "pose/base/time.h"

namespace tbm {

// By how much the telescopic joint has closed, as the relative pose shows it. In a double shield
// one of the two is always gripped: while the joint opens the front shield advances and the rear
// one stands; while it closes the front one stands and the rear one is pulled after it. So what has
// closed is how far the rear shield has come, also while no total station sees it.
//
// What vibration and noise close and open again does not count. No heap.
class JointClosing {
 public:
  // `length_m`: forward distance from one shield's datum to the other's. In the order of time.
  // After a gap, or a jump that no shield makes, nothing is known of what was before.
  void Add(Timestamp at, double length_m);

  // From one moment to a later one; negative when the later one is given first. Empty where either
  // lies outside of what was watched without a gap.
  std::optional<double> Between(Timestamp from, Timestamp to) const;

  // Until when the joint was watched.
  const std::optional<Timestamp>& last() const { return last_; }

  void Forget() { *this = JointClosing(); }

 private:
  static constexpr std::int64_t kBinNs = 1'000'000'000;
  static constexpr std::size_t kBins = 1024;  // seconds

  // All that had closed by the end of a second.
  struct Bin {
    std::int64_t number = -1;  // of the second; -1: empty
    double closed_m = 0.0;
  };
  std::optional<double> Until(Timestamp at) const;

  std::array<Bin, kBins> bins_{};
  std::optional<Timestamp> first_;
  std::optional<Timestamp> last_;
  double last_length_m_ = 0.0;
  double longest_m_ = 0.0;  // since it closed last
  double closed_m_ = 0.0;
};

}  // namespace tbm
