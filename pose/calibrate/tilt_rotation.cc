#include "pose/calibrate/tilt_rotation.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>

#include "pose/base/angle.h"
#include "pose/geometry/rigid3.h"

namespace tbm {
namespace {

using Matrix9 = Eigen::Matrix<double, 9, 9>;
using Vector9 = Eigen::Matrix<double, 9, 1>;
using Matrix5 = Eigen::Matrix<double, 5, 5>;
using Vector5 = Eigen::Matrix<double, 5, 1>;

constexpr std::size_t kLeastPlacements = 4;
constexpr std::size_t kLeastKnownUp = 2;
// Below this the housing stood the same way, or was turned no more than by accident.
const double kLeastTilt_rad = DegToRad(0.5);
const double kLeastYaw_rad = DegToRad(20.0);
constexpr int kMostSteps = 200;
constexpr int kRefinements = 30;

// vec() by columns, as in the paper's Kronecker products.
Eigen::Matrix3d MatrixOf(const Vector9& v) { return Eigen::Map<const Eigen::Matrix3d>(v.data()); }
Vector9 VectorOf(const Eigen::Matrix3d& m) { return Eigen::Map<const Vector9>(m.data()); }

Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& m) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d flip = Eigen::Matrix3d::Identity();
  flip(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  return svd.matrixU() * flip * svd.matrixV().transpose();
}

// A^T A of the paper's Eq. 6 over all pairs, divided by the number of pairs: its smallest singular
// vector is vec(R) of camera_from_housing.
Matrix9 NormalMatrix(std::span<const TiltPlacement> placements) {
  Matrix9 sum = Matrix9::Zero();
  double pairs = 0.0;
  for (std::size_t i = 0; i < placements.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const Eigen::Matrix3d to_i_from_j =
          placements[i].camera_from_board * placements[j].camera_from_board.transpose();
      Eigen::Matrix<double, 3, 9> rows;
      for (int k = 0; k < 3; ++k) {
        rows.middleCols<3>(3 * k) = placements[j].up_in_housing[k] * to_i_from_j -
                                    placements[i].up_in_housing[k] * Eigen::Matrix3d::Identity();
      }
      sum += rows.transpose() * rows;
      pairs += 1.0;
    }
  }
  return sum / pairs;
}

// Two axes square to a unit vector.
Eigen::Matrix<double, 3, 2> TangentsOf(const Eigen::Vector3d& direction) {
  Eigen::Matrix<double, 3, 2> tangents;
  tangents.col(0) = direction.unitOrthogonal();
  tangents.col(1) = direction.cross(tangents.col(0));
  return tangents;
}

Eigen::Vector3d MeanUp(std::span<const TiltPlacement> placements, const Eigen::Matrix3d& rotation) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const TiltPlacement& one : placements) {
    sum += one.camera_from_board.transpose() * (rotation * one.up_in_housing);
  }
  return sum.normalized();
}

// The normal equations of rotation (3, about the camera's axes) and up (2, tangents of it).
struct Normal {
  Matrix5 information = Matrix5::Zero();
  Vector5 pull = Vector5::Zero();
  double chi2 = 0.0;
};

Normal NormalOf(std::span<const TiltPlacement> placements,
                const Eigen::Matrix3d& rotation,
                const Eigen::Vector3d& up_in_board,
                const TiltRotationOptions& options) {
  Normal normal;
  const Eigen::Matrix<double, 3, 2> tangents = TangentsOf(up_in_board);
  for (const TiltPlacement& one : placements) {
    const Eigen::Vector3d seen = one.camera_from_board * up_in_board;
    const Eigen::Vector3d felt = rotation * one.up_in_housing;
    const Eigen::Matrix<double, 3, 2> plane = TangentsOf(seen);
    const double weight = 1.0 / (one.camera_sigma_rad * one.camera_sigma_rad +
                                 one.tilt_sigma_rad * one.tilt_sigma_rad);
    Eigen::Matrix<double, 2, 5> by;
    by.leftCols<3>() = plane.transpose() * -Skew(felt);
    by.rightCols<2>() = -plane.transpose() * one.camera_from_board * tangents;
    const Eigen::Vector2d residual = plane.transpose() * (felt - seen);
    normal.information += weight * by.transpose() * by;
    normal.pull -= weight * by.transpose() * residual;
    normal.chi2 += weight * residual.squaredNorm();
  }
  if (options.up_in_board) {
    const double sigma = std::max(options.up_sigma_rad, 1e-9);
    const Eigen::Vector2d off = tangents.transpose() * (*options.up_in_board - up_in_board);
    normal.information.bottomRightCorner<2, 2>() += Eigen::Matrix2d::Identity() / (sigma * sigma);
    normal.pull.tail<2>() += off / (sigma * sigma);
  }
  return normal;
}

// Which motion the placements lack, judged by what the sensors saw.
std::optional<TiltRotationFault> MissingIn(std::span<const TiltPlacement> placements,
                                           bool up_is_given) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const TiltPlacement& one : placements) mean += one.up_in_housing;
  mean.normalize();
  const Eigen::Matrix<double, 3, 2> tangents = TangentsOf(mean);
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const TiltPlacement& one : placements) {
    const Eigen::Vector2d off = tangents.transpose() * one.up_in_housing;
    scatter += off * off.transpose() / static_cast<double>(placements.size());
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(scatter);
  if (std::sqrt(axes.eigenvalues()[1]) < kLeastTilt_rad) return TiltRotationFault::kNoTilt;
  if (up_is_given) return {};
  if (std::sqrt(std::max(axes.eigenvalues()[0], 0.0)) < kLeastTilt_rad) {
    return TiltRotationFault::kOneAxis;
  }
  return {};
}

// How far the placements are turned about the plumb line, in all.
double YawSpread_rad(std::span<const TiltPlacement> placements,
                     const Eigen::Vector3d& up_in_board) {
  double least = 0.0;
  double most = 0.0;
  for (const TiltPlacement& one : placements) {
    const Eigen::Matrix3d turn =
        one.camera_from_board.transpose() * placements[0].camera_from_board;
    const double yaw = LogRotation(Eigen::Quaterniond(turn)).dot(up_in_board);
    least = std::min(least, yaw);
    most = std::max(most, yaw);
  }
  return most - least;
}

TiltRotationFailure FailureOf(TiltRotationFault fault,
                              double sigma_rad = std::numeric_limits<double>::quiet_NaN()) {
  return {fault, sigma_rad};
}

}  // namespace

const char* MissingMotion(TiltRotationFault fault) {
  switch (fault) {
    case TiltRotationFault::kTooFew:
      return "take at least four pictures, better twelve";
    case TiltRotationFault::kNoTilt:
      return "tilt the rig about both axes, by ten degrees or more; it was only turned about the "
             "plumb line";
    case TiltRotationFault::kOneAxis:
      return "tilt it about the other axis as well";
    case TiltRotationFault::kNoYaw:
      return "turn it about the plumb line between the pictures, by ninety degrees in all, or give "
             "the direction of gravity in the board's frame";
    case TiltRotationFault::kTooWeak:
      return "tilt it further, turn it further, or take more pictures";
    case TiltRotationFault::kNoRotation:
      return "do not move the board between the pictures, and see that each reading belongs to its "
             "picture";
  }
  return "";
}

double MountingSigma_rad(const Eigen::Matrix3d& covariance,
                         const Eigen::Matrix3d& housing_from_body,
                         double lean_rad) {
  const Eigen::Matrix3d in_housing = housing_from_body * covariance * housing_from_body.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> level(in_housing.topLeftCorner<2, 2>());
  const double lean = std::sin(lean_rad);
  return std::sqrt(level.eigenvalues()[1] + lean * lean * in_housing(2, 2));
}

Eigen::Matrix3d StartTiltRotation(std::span<const TiltPlacement> placements) {
  const Eigen::SelfAdjointEigenSolver<Matrix9> axes(NormalMatrix(placements));
  Eigen::Matrix3d start = MatrixOf(axes.eigenvectors().col(0));
  if (start.determinant() < 0.0) start = -start;
  return NearestRotation(start);
}

Eigen::Matrix3d AugmentedLagrangianTiltRotation(std::span<const TiltPlacement> placements,
                                                const Eigen::Matrix3d& start,
                                                int* steps) {
  constexpr double kGrowth = 1.2;
  constexpr double kConverged = 1e-12;
  const Matrix9 normal = 3.0 * NormalMatrix(placements);
  Eigen::Matrix3d m = start;
  Eigen::Matrix3d multiplier = Eigen::Matrix3d::Zero();
  double mu = 1e-2;
  for (*steps = 1; *steps <= kMostSteps; ++*steps) {
    const Matrix9 left = 2.0 * normal + mu * Matrix9::Identity();
    const Vector9 right = mu * VectorOf(m) + VectorOf(multiplier);
    const Eigen::Matrix3d r = MatrixOf(left.ldlt().solve(right));
    m = NearestRotation(r - multiplier / mu);
    multiplier += mu * (m - r);
    mu *= kGrowth;
    if ((m - r).squaredNorm() < kConverged) break;
  }
  return m;
}

Eigen::Matrix3d KnownUpTiltRotation(std::span<const TiltPlacement> placements,
                                    const Eigen::Vector3d& up_in_board) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const TiltPlacement& one : placements) {
    sum += (one.camera_from_board * up_in_board) * one.up_in_housing.transpose();
  }
  return NearestRotation(sum);
}

Result<TiltRotation, TiltRotationFailure> FindTiltRotation(
    std::span<const TiltPlacement> placements, const TiltRotationOptions& options) {
  const bool up_is_given = options.up_in_board.has_value();
  if (placements.size() < (up_is_given ? kLeastKnownUp : kLeastPlacements)) {
    return Failure{FailureOf(TiltRotationFault::kTooFew)};
  }
  TiltRotation found;
  if (up_is_given) {
    found.camera_from_housing = KnownUpTiltRotation(placements, *options.up_in_board);
    found.up_in_board = *options.up_in_board;
  } else {
    found.camera_from_housing =
        AugmentedLagrangianTiltRotation(placements, StartTiltRotation(placements), &found.steps);
    found.up_in_board = MeanUp(placements, found.camera_from_housing);
  }
  if (const auto missing = MissingIn(placements, up_is_given)) {
    return Failure{FailureOf(*missing)};
  }
  Normal normal;
  for (int i = 0; i < kRefinements; ++i) {
    normal = NormalOf(placements, found.camera_from_housing, found.up_in_board, options);
    const Vector5 e = normal.information.ldlt().solve(normal.pull);
    if (!e.allFinite()) return Failure{FailureOf(TiltRotationFault::kTooWeak)};
    const Eigen::Vector3d turn = e.head<3>();
    found.camera_from_housing = ExpRotation(turn).toRotationMatrix() * found.camera_from_housing;
    found.up_in_board =
        (found.up_in_board + TangentsOf(found.up_in_board) * e.tail<2>()).normalized();
    if (e.norm() < 1e-13) break;
  }
  const Matrix5 spread = normal.information.inverse();
  found.covariance = spread.topLeftCorner<3, 3>();
  found.chi2 = normal.chi2;
  found.dof = 2 * static_cast<int>(placements.size()) - (up_is_given ? 3 : 5);
  if (!up_is_given) {
    const Eigen::Matrix2d up = spread.bottomRightCorner<2, 2>();
    found.up_sigma_rad = std::sqrt(up.eigenvalues().real().maxCoeff());
  }
  const double sigma_rad = std::sqrt(found.covariance.eigenvalues().real().maxCoeff());
  if (!(sigma_rad <= options.most_sigma_rad)) {
    const bool lacks_yaw =
        !up_is_given && YawSpread_rad(placements, found.up_in_board) < kLeastYaw_rad;
    return Failure{
        FailureOf(lacks_yaw ? TiltRotationFault::kNoYaw : TiltRotationFault::kTooWeak, sigma_rad)};
  }
  // Twelve pictures that agree are near one; a board that moved is far beyond any sigma.
  constexpr double kMostChi2PerDof = 25.0;
  if (found.dof > 0 && found.chi2 > kMostChi2PerDof * found.dof) {
    return Failure{FailureOf(TiltRotationFault::kNoRotation, sigma_rad)};
  }
  return found;
}

}  // namespace tbm
