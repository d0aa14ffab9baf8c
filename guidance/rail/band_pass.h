#pragma once

#include <optional>
#include <span>
#include <vector>

namespace tbm {

// A zero-phase band-pass over samples at equal distance: a Butterworth high-pass and low-pass of
// fourth order each, once forward and once backward. Both passes together have a gain of 0.707 at
// either end of the band (docs/settlement.md, section 6).
class BandPass {
 public:
  // `shortest_m` < `longest_m`; `step_m` at most a fourth of `shortest_m`.
  BandPass(double shortest_m, double longest_m, double step_m);

  double Gain(double wavelength_m) const;

  // So far from either end the filter still feels what lies beyond it.
  double room_m() const;

  // The samples, filtered; empty within room_m() of the ends, and everywhere when there is no more.
  std::vector<std::optional<double>> Filtered(std::span<const double> samples) const;

 private:
  // One second-order section, transposed direct form.
  struct Section {
    double b0, b1, b2, a1, a2;
  };
  void AddSections(double corner, bool is_high_pass);
  void Run(std::vector<double>* samples) const;

  double longest_m_;
  double step_m_;
  double high_corner_;  // tangent of half the angle of a step, where one pass has 3 dB
  double low_corner_;
  std::vector<Section> sections_;
};

}  // namespace tbm
