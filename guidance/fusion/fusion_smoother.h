#pragma once

#include <vector>

#include "guidance/fusion/fusion_filter.h"

namespace tbm {

// State and covariance at one epoch.
struct FusionEpoch {
  Timestamp at;
  FusionState state;
  FusionMatrix covariance;
};

// Rauch-Tung-Striebel: what the measurements after an epoch say of it. Remembers each epoch twice,
// before and after its measurements, in half of a matrix each: about 3 kB for fifteen states.
class FusionSmoother {
 public:
  explicit FusionSmoother(const FusionLayout& layout) : layout_(layout) {}

  // In the order of time, for each epoch: the filter brought forward, then the filter with the
  // epoch's measurements.
  void Before(const FusionFilter& filter);
  void After(const FusionFilter& filter);

  std::size_t size() const { return epochs_.size(); }
  Timestamp at(std::size_t epoch) const { return epochs_[epoch].at; }

  // As the filter had it after the epoch's measurements.
  FusionEpoch Filtered(std::size_t epoch) const;

  // Calls `visit(epoch, smoothed)` from the last epoch to the first (docs/filter.md, "Smoother").
  template <class Visit>
  void Smooth(const Visit& visit) const {
    if (epochs_.empty()) return;
    FusionEpoch later = Filtered(epochs_.size() - 1);
    visit(epochs_.size() - 1, later);
    for (std::size_t i = epochs_.size() - 1; i-- > 0;) {
      later = Smoothed(i, later);
      visit(i, later);
    }
  }

 private:
  struct Half {
    FusionState state;
    std::vector<double> covariance;  // lower triangle, row by row
  };
  struct Epoch {
    Timestamp at;
    FusionStep from_last;
    Half before;
    Half after;
  };

  FusionEpoch Smoothed(std::size_t epoch, const FusionEpoch& later) const;
  Half Pack(const FusionFilter& filter) const;
  FusionMatrix Unpack(const Half& half) const;

  FusionLayout layout_;
  std::vector<Epoch> epochs_;
};

}  // namespace tbm
