#include "pose/calibrate/tilt_rotation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>

#include "pose/base/angle.h"
#include "pose/calibrate/misfit.h"
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
// By this the sigmas of a placement that is left out grow.
constexpr double kSigmaOfLeftOut = 1e3;

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

using ByUnknowns = Eigen::Matrix<double, 2, 5>;

// One placement's two residuals: felt less seen, across the up that is seen.
struct Equation {
  Eigen::Vector2d off;
  ByUnknowns by;
  double sigma_rad = 0.0;
};

// Unknowns: turn of the rotation (3, about the camera's axes) and up (2, along its tangents).
class TiltAdjustment {
 public:
  TiltAdjustment(std::span<const TiltPlacement> placements,
                 const TiltRotationOptions& options,
                 const TiltRotation& start)
      : placements_(placements),
        options_(options),
        rotation_(start.camera_from_housing),
        up_(start.up_in_board),
        is_out_(placements.size(), false) {}

  // False where the placements do not tell the unknowns.
  bool Solve(const std::vector<bool>& is_out) {
    is_out_ = is_out;
    for (int i = 0; i < kRefinements; ++i) {
      Fill();
      const Vector5 e = information_.ldlt().solve(pull_);
      if (!e.allFinite()) return false;
      const Eigen::Vector3d turn = e.head<3>();
      rotation_ = ExpRotation(turn).toRotationMatrix() * rotation_;
      up_ = (up_ + TangentsOf(up_) * e.tail<2>()).normalized();
      if (e.norm() < 1e-13) break;
    }
    Fill();
    spread_ = information_.inverse();
    return true;
  }
  bool SolveAll() { return Solve(std::vector<bool>(placements_.size(), false)); }

  AdjustedFit Fit() const {
    AdjustedFit fit;
    fit.chi2 = chi2_;
    fit.dof = 2 * static_cast<int>(placements_.size()) - (options_.up_in_board ? 3 : 5);
    for (std::size_t i = 0; i < placements_.size(); ++i) {
      const Equation equation = EquationOf(i);
      const double weight = 1.0 / (equation.sigma_rad * equation.sigma_rad);
      const Eigen::Matrix2d control =
          Eigen::Matrix2d::Identity() - weight * equation.by * spread_ * equation.by.transpose();
      fit.misfits.push_back(MisfitOf(control, equation.off / equation.sigma_rad));
      if (is_out_[i]) fit.dof -= fit.misfits.back().dof;
    }
    return fit;
  }

  TiltRotation Found(int steps) const {
    const AdjustedFit fit = Fit();
    TiltRotation found;
    found.camera_from_housing = rotation_;
    found.covariance = spread_.topLeftCorner<3, 3>();
    found.up_in_board = up_;
    if (!options_.up_in_board) {
      const Eigen::Matrix2d up = spread_.bottomRightCorner<2, 2>();
      found.up_sigma_rad = std::sqrt(up.selfadjointView<Eigen::Lower>().eigenvalues().maxCoeff());
    }
    found.chi2 = fit.chi2;
    found.dof = fit.dof;
    found.steps = steps;
    for (std::size_t i = 0; i < placements_.size(); ++i) {
      const Equation equation = EquationOf(i);
      const Misfit& misfit = fit.misfits[i];
      found.readings.push_back({equation.off.norm(),
                                equation.sigma_rad,
                                misfit.chi2,
                                misfit.dof,
                                misfit.from_others_sigmas * equation.sigma_rad});
    }
    return found;
  }

 private:
  Equation EquationOf(std::size_t i) const {
    const TiltPlacement& one = placements_[i];
    const Eigen::Vector3d seen = one.camera_from_board * up_;
    const Eigen::Vector3d felt = rotation_ * one.up_in_housing;
    const Eigen::Matrix<double, 3, 2> plane = TangentsOf(seen);
    Equation equation;
    equation.off = plane.transpose() * (felt - seen);
    equation.by.leftCols<3>() = plane.transpose() * -Skew(felt);
    equation.by.rightCols<2>() = -plane.transpose() * one.camera_from_board * TangentsOf(up_);
    equation.sigma_rad =
        (is_out_[i] ? kSigmaOfLeftOut : 1.0) * std::hypot(one.camera_sigma_rad, one.tilt_sigma_rad);
    return equation;
  }

  void Fill() {
    information_.setZero();
    pull_.setZero();
    chi2_ = 0.0;
    for (std::size_t i = 0; i < placements_.size(); ++i) {
      const Equation equation = EquationOf(i);
      const double weight = 1.0 / (equation.sigma_rad * equation.sigma_rad);
      information_ += weight * equation.by.transpose() * equation.by;
      pull_ -= weight * equation.by.transpose() * equation.off;
      chi2_ += is_out_[i] ? 0.0 : weight * equation.off.squaredNorm();
    }
    if (options_.up_in_board) {
      const double sigma = std::max(options_.up_sigma_rad, 1e-9);
      const Eigen::Vector2d off =
          TangentsOf(up_).transpose() * (*options_.up_in_board - up_) / sigma;
      information_.bottomRightCorner<2, 2>() += Eigen::Matrix2d::Identity() / (sigma * sigma);
      pull_.tail<2>() += off / sigma;
      chi2_ += off.squaredNorm();
    }
  }

  std::span<const TiltPlacement> placements_;
  const TiltRotationOptions& options_;
  Eigen::Matrix3d rotation_;
  Eigen::Vector3d up_;
  std::vector<bool> is_out_;
  Matrix5 information_ = Matrix5::Zero();
  Matrix5 spread_ = Matrix5::Zero();
  Vector5 pull_ = Vector5::Zero();
  double chi2_ = 0.0;
};

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
  return {fault, sigma_rad, {}, 1.0};
}

double Sigma_rad(const TiltRotation& found) {
  return std::sqrt(found.covariance.selfadjointView<Eigen::Lower>().eigenvalues().maxCoeff());
}

// Why the placements contradict one another, if they do. `found` is of all of them.
std::optional<TiltRotationFailure> Contradiction(TiltAdjustment adjustment,
                                                 const TiltRotation& found) {
  TiltRotationFailure failure = FailureOf(TiltRotationFault::kDoesNotFit, Sigma_rad(found));
  const std::vector<TiltReading>& readings = found.readings;
  const auto add = [&](std::size_t i, double off_rad, std::vector<std::size_t> or_rather) {
    failure.wrong.push_back({i, off_rad, readings[i].sigma_rad, std::move(or_rather)});
  };
  const auto fit = [&](const std::vector<bool>& is_out) {
    const bool is_solved = adjustment.Solve(is_out);
    return is_solved ? adjustment.Fit() : AdjustedFit{std::vector<Misfit>(readings.size()), 0.0, 0};
  };
  // A placement's sigma is the mean of two directions.
  constexpr double kSlack = 2.0;
  const auto wrong = FindWrong(readings.size(), fit, kSlack);
  for (const WrongMeasurement& one : wrong) {
    add(one.which, one.misfit.from_others_sigmas * readings[one.which].sigma_rad, one.or_rather);
  }
  if (!wrong.empty()) return failure;
  if (!IsBeyondScatter(found.chi2, found.dof)) return {};
  failure.fault = TiltRotationFault::kNoRotation;
  failure.sigma_factor = ScatterFactor(found.chi2, found.dof);
  const auto worst = std::max_element(
      readings.begin(), readings.end(), [](const TiltReading& a, const TiltReading& b) {
        return a.misfit < b.misfit;
      });
  add(static_cast<std::size_t>(worst - readings.begin()), worst->from_others_rad, {});
  return failure;
}

void Scale(TiltRotation* found) {
  found->sigma_factor = ScatterFactor(found->chi2, found->dof);
  found->covariance *= found->sigma_factor * found->sigma_factor;
  found->up_sigma_rad *= found->sigma_factor;
}

// Empty where the sigma is small enough.
std::optional<TiltRotationFailure> Weakness(const TiltRotation& found,
                                            std::span<const TiltPlacement> placements,
                                            const TiltRotationOptions& options) {
  const double sigma_rad = Sigma_rad(found);
  if (sigma_rad <= options.most_sigma_rad) return {};
  const bool lacks_yaw =
      !options.up_in_board && YawSpread_rad(placements, found.up_in_board) < kLeastYaw_rad;
  return FailureOf(lacks_yaw ? TiltRotationFault::kNoYaw : TiltRotationFault::kTooWeak, sigma_rad);
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
    case TiltRotationFault::kDoesNotFit:
      return "see that each reading belongs to its picture, and that nothing moved while it was "
             "taken; take it again, or take the row out";
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
  // Of dynamic size: nine fixed ones take the compiler long.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(NormalMatrix(placements));
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
    const Eigen::MatrixXd left = 2.0 * normal + mu * Matrix9::Identity();
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
  TiltRotation start;
  if (up_is_given) {
    start.camera_from_housing = KnownUpTiltRotation(placements, *options.up_in_board);
    start.up_in_board = *options.up_in_board;
  } else {
    start.camera_from_housing =
        AugmentedLagrangianTiltRotation(placements, StartTiltRotation(placements), &start.steps);
    start.up_in_board = MeanUp(placements, start.camera_from_housing);
  }
  if (const auto missing = MissingIn(placements, up_is_given)) {
    return Failure{FailureOf(*missing)};
  }
  TiltAdjustment adjustment(placements, options, start);
  if (!adjustment.SolveAll()) return Failure{FailureOf(TiltRotationFault::kTooWeak)};
  TiltRotation found = adjustment.Found(start.steps);
  if (auto weakness = Weakness(found, placements, options)) return Failure{std::move(*weakness)};
  if (options.takes_misfits) return found;
  if (auto failure = Contradiction(adjustment, found)) return Failure{std::move(*failure)};
  Scale(&found);
  if (auto weakness = Weakness(found, placements, options)) return Failure{std::move(*weakness)};
  return found;
}

}  // namespace tbm
