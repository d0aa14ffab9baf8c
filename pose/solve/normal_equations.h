#pragma once

#include <array>

#include <Eigen/Core>

#include "pose/solve/rows.h"

namespace tbm {

// The pose problem at one pose, before weighting. Left uninitialised beyond `count`.
struct LinearPose {
  int count = 0;  // LEDs
  bool has_tilts = false;
  std::array<LedRows, kMaxLeds> leds;
  TiltConstraint::Rows tilts;
};

// False when an LED is behind the camera. `tilts` null: without them.
bool LinearisePose(const PoseProblem& problem,
                   const TiltConstraint* tilts,
                   const Rigid3& camera_from_target,
                   LinearPose& linear);

// Inverse square root of a 2x2 covariance: whitened = (row0 / l00, (row1 - l10 whitened0) / l11).
struct Whitener {
  double inverse_l00 = 0.0;
  double l10 = 0.0;
  double inverse_l11 = 0.0;
};

// The noise model frozen at one pose. The covariance that linearised.h writes as one dense matrix
// is block-diagonal but for the intrinsics; those four enter as unknowns of unit variance that are
// eliminated again (the same estimate by the matrix inversion lemma, at a cost that grows with the
// number of LEDs instead of its cube).
struct Weights {
  bool has_intrinsics = false;
  Eigen::Vector4d intrinsics_sigma_px;
  std::array<Whitener, kMaxLeds> leds;
  std::array<Eigen::Vector2d, kMaxLeds> by_focal_length;
  Whitener tilts;
};

void Weigh(const PoseProblem& problem, const LinearPose& linear, Weights& weights);

// information * e = gradient is the Gauss-Newton step; cost is the chi2 at the linearisation point.
struct NormalEquations {
  Eigen::Matrix<double, 6, 6> information;
  Eigen::Matrix<double, 6, 1> gradient;
  double cost = 0.0;
};

void FormNormal(const LinearPose& linear, const Weights& weights, NormalEquations& normal);

// L D L^T of a 6x6 positive matrix, unit lower triangular L.
struct Factor6 {
  Eigen::Matrix<double, 6, 6> lower;
  Eigen::Matrix<double, 6, 1> inverse_pivot;
};

// Of information + damping * its diagonal. False when a pivot drowns in rounding: singular.
bool Factorise(const Eigen::Matrix<double, 6, 6>& information, double damping, Factor6& factor);
Eigen::Matrix<double, 6, 1> SolveWith(const Factor6& factor,
                                      const Eigen::Matrix<double, 6, 1>& right);
Eigen::Matrix<double, 6, 6> InverseOf(const Factor6& factor);

}  // namespace tbm
