// The 6 x 6 factor of the solvers, against Eigen's.
#include "pose/solve/normal_equations.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace tbm::test {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

Matrix6 WithEigenvalues(const Vector6& eigenvalues, Random& random) {
  Matrix6 any;
  for (int i = 0; i < 36; ++i) any(i / 6, i % 6) = random.Normal();
  const Matrix6 axes = Eigen::HouseholderQR<Matrix6>(any).householderQ();
  return axes * eigenvalues.asDiagonal() * axes.transpose();
}

// Of random axes, with eigenvalues from 1 down to `smallest`.
Matrix6 Information(double smallest, Random& random) {
  Vector6 eigenvalues;
  for (int i = 0; i < 6; ++i) eigenvalues[i] = std::pow(smallest, i / 5.0);
  return WithEigenvalues(eigenvalues, random);
}

Vector6 AnyVector(Random& random) {
  Vector6 any;
  for (double& value : any) value = random.Normal();
  return any;
}

TEST(Factor6, SolvesAndInvertsAlsoWhatIsKnownUnevenly) {
  Random random("Factor6.Solves");
  for (const double smallest : {1.0, 1e-3, 1e-8, 1e-11}) {
    for (int draw = 0; draw < 100; ++draw) {
      const Matrix6 information = Information(smallest, random);
      const Vector6 x = AnyVector(random);
      Factor6 factor;
      ASSERT_TRUE(Factorise(information, 0.0, factor)) << smallest;
      const double exactness = 1e-13 / smallest;
      EXPECT_LT((SolveWith(factor, information * x) - x).norm(), exactness * x.norm());
      EXPECT_LT((InverseOf(factor) * information - Matrix6::Identity()).norm(), 10.0 * exactness);
    }
  }
}

TEST(Factor6, DampingAddsToTheDiagonal) {
  Random random("Factor6.Damping");
  for (const double damping : {1e-4, 0.5, 1e6}) {
    const Matrix6 information = Information(1e-2, random);
    Matrix6 damped = information;
    damped.diagonal() *= 1.0 + damping;
    const Vector6 right = AnyVector(random);
    Factor6 factor;
    ASSERT_TRUE(Factorise(information, damping, factor));
    const Vector6 expected = damped.ldlt().solve(right);
    EXPECT_LT((SolveWith(factor, right) - expected).norm(), 1e-11 * expected.norm());
  }
}

TEST(Factor6, RefusesWhatIsSingularButForRounding) {
  Random random("Factor6.Singular");
  int refused = 0;
  for (int missing = 1; missing <= 6; ++missing) {
    for (int draw = 0; draw < 100; ++draw) {
      Vector6 eigenvalues = Vector6::Ones();
      eigenvalues.head(missing).setZero();
      Factor6 factor;
      // Where rounding leaves a pivot all the same, the variance says it.
      if (!Factorise(WithEigenvalues(eigenvalues, random), 0.0, factor)) {
        ++refused;
      } else {
        EXPECT_GT(InverseOf(factor).trace(), 1e12) << missing;
      }
    }
  }
  EXPECT_GT(refused, 550);
}

}  // namespace
}  // namespace tbm::test
