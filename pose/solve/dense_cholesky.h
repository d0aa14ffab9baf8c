#pragma once

#include <cmath>

#include <Eigen/Core>

namespace tbm {

// Cholesky factors of a dozen rows, written out. Eigen's own are made for large matrices: for these
// sizes most of their work on a small processor is packing and dispatch.

// Lower triangle of `matrix` in, its factor L (matrix = L L^T) out; the upper triangle is neither
// read nor written. False when the matrix is not positive definite.
template <class Matrix>
bool FactoriseCholesky(Matrix& matrix) {
  const Eigen::Index rows = matrix.rows();
  for (Eigen::Index j = 0; j < rows; ++j) {
    double pivot = matrix(j, j);
    for (Eigen::Index k = 0; k < j; ++k) pivot -= matrix(j, k) * matrix(j, k);
    if (!(pivot > 0.0)) return false;
    const double root = std::sqrt(pivot);
    const double inverse = 1.0 / root;
    matrix(j, j) = root;
    for (Eigen::Index i = j + 1; i < rows; ++i) {
      double sum = matrix(i, j);
      for (Eigen::Index k = 0; k < j; ++k) sum -= matrix(i, k) * matrix(j, k);
      matrix(i, j) = sum * inverse;
    }
  }
  return true;
}

// columns := L^-1 columns.
template <class Matrix, class Columns>
void SolveLower(const Matrix& lower, Columns& columns) {
  const Eigen::Index rows = lower.rows();
  for (Eigen::Index column = 0; column < columns.cols(); ++column) {
    for (Eigen::Index i = 0; i < rows; ++i) {
      double sum = columns(i, column);
      for (Eigen::Index k = 0; k < i; ++k) sum -= lower(i, k) * columns(k, column);
      columns(i, column) = sum / lower(i, i);
    }
  }
}

// inverse := L^-1; above its diagonal zeros.
template <class Matrix>
void InvertLower(const Matrix& lower, Matrix& inverse) {
  const Eigen::Index rows = lower.rows();
  inverse.setZero(rows, rows);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const double pivot = 1.0 / lower(i, i);
    for (Eigen::Index j = 0; j < i; ++j) {
      double sum = 0.0;
      for (Eigen::Index k = j; k < i; ++k) sum += lower(i, k) * inverse(k, j);
      inverse(i, j) = -sum * pivot;
    }
    inverse(i, i) = pivot;
  }
}

// Logarithm of the determinant of L L^T: of the product, which for a dozen rows neither overflows
// nor vanishes, in blocks of eight.
template <class Matrix>
double LogDeterminantOfFactor(const Matrix& lower) {
  double sum = 0.0;
  double product = 1.0;
  for (Eigen::Index i = 0; i < lower.rows(); ++i) {
    product *= lower(i, i);
    if (i % 8 == 7) {
      sum += std::log(product);
      product = 1.0;
    }
  }
  return 2.0 * (sum + std::log(product));
}

// columns^T columns and columns^T right, both sums over the rows.
template <class Rows, class Right>
void NormalOf(const Rows& rows,
              const Right& right,
              Eigen::Matrix<double, 6, 6>& information,
              Eigen::Matrix<double, 6, 1>& gradient) {
  const Eigen::Index count = rows.rows();
  for (int a = 0; a < 6; ++a) {
    for (int b = 0; b <= a; ++b) {
      double sum = 0.0;
      for (Eigen::Index i = 0; i < count; ++i) sum += rows(i, a) * rows(i, b);
      information(a, b) = information(b, a) = sum;
    }
    double sum = 0.0;
    for (Eigen::Index i = 0; i < count; ++i) sum += rows(i, a) * right[i];
    gradient[a] = sum;
  }
}

}  // namespace tbm
