#pragma once

#include <array>

namespace tbm {

// A symmetric 3 x 3 system, written out: it is solved several times a spot.
struct Symmetric3 {
  double m00 = 0.0, m01 = 0.0, m02 = 0.0, m11 = 0.0, m12 = 0.0, m22 = 0.0;

  double c00() const { return m11 * m22 - m12 * m12; }
  double c11() const { return m00 * m22 - m02 * m02; }
  double c22() const { return m00 * m11 - m01 * m01; }
  double c01() const { return m02 * m12 - m01 * m22; }
  double c02() const { return m01 * m12 - m02 * m11; }
  double c12() const { return m01 * m02 - m00 * m12; }
  double Determinant() const { return m00 * c00() + m01 * c01() + m02 * c02(); }

  // Not finite when singular.
  std::array<double, 3> Solve(double r0, double r1, double r2) const {
    const double inverse = 1.0 / Determinant();
    return {inverse * (c00() * r0 + c01() * r1 + c02() * r2),
            inverse * (c01() * r0 + c11() * r1 + c12() * r2),
            inverse * (c02() * r0 + c12() * r1 + c22() * r2)};
  }
};

}  // namespace tbm
