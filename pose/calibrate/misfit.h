#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include <Eigen/Core>

namespace tbm {

// Which measurements of an adjustment do not belong to the others. A measurement is what is taken
// or left as a whole: a point with its three coordinates, a reading with its two angles. Equations
// and sources: docs/calibration.md, section 4.

// One measurement against all others.
struct Misfit {
  double chi2 = 0.0;                // by so much that of the adjustment would fall without it
  int dof = 0;                      // in so many directions the others control it; 0: nothing does
  double from_others_sigmas = 0.0;  // how far it is, in those, from where the others put it
};

// `control`: which share of an error of the measurement shows in its residual, symmetric, 1 to 3
// rows; directions in which less than a fiftieth does are not judged. `off_sigmas`: the residual
// over the measurement's sigma.
Misfit MisfitOf(const Eigen::MatrixXd& control, const Eigen::VectorXd& off_sigmas);

// What a misfit of `dof` 1 .. 3 directions exceeds by chance once in 70 000, and once in 1000.
double MostMisfit(int dof);
double DoubtfulMisfit(int dof);

// By this measurements scatter more than was declared: root of chi2 over its degrees of freedom
// where that is beyond chance, else 1.
double ScatterFactor(double chi2, int dof);
// More than three times, which no honest sigma explains.
bool IsBeyondScatter(double chi2, int dof);

// All measurements after an adjustment in which some were left out.
struct AdjustedFit {
  std::vector<Misfit> misfits;  // of those left out: not looked at
  double chi2 = 0.0;            // of the others
  int dof = 0;
};
using AdjustWithout = std::function<AdjustedFit(const std::vector<bool>& is_out)>;

struct WrongMeasurement {
  std::size_t which = 0;
  Misfit misfit;                       // with the other wrong ones left out
  std::vector<std::size_t> or_rather;  // fit almost as badly: one of them is wrong, or this one is
};

// Those that do not belong to the others, however many hide one another, while half of the degrees
// of freedom are left: the worst is taken out and all is adjusted again, over and over; all taken
// out before the last that misfits beyond chance are wrong (generalised extreme studentized
// deviate, Rosner 1983), unless they fit once they are put back. Where the rest scatters more than
// was declared a misfit is judged by that; where it is beyond scatter even so, nobody can say which
// are wrong, and none is. `slack`: how much larger a measurement's variance may be along its worst
// direction than was declared for all.
std::vector<WrongMeasurement> FindWrong(std::size_t count,
                                        const AdjustWithout& adjust,
                                        double slack = 1.0);

}  // namespace tbm
