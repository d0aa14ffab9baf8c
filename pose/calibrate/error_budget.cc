#include "pose/calibrate/error_budget.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "pose/geometry/camera_model.h"
#include "pose/geometry/tilt.h"
#include "pose/solve/solve_pose.h"

namespace tbm {
namespace {

// Directions steeper than this have no horizontal part to speak of.
constexpr double kSteep = 0.8;

// The world as it may be: what the rig file does not know of.
struct Reality {
  Rig rig;
  std::vector<Eigen::Vector2d> centre_px;  // added to what the lens makes of each LED
  std::array<Eigen::Vector2d, 2> tilt_rad = {Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()};

  explicit Reality(const Rig& nominal)
      : rig(nominal), centre_px(nominal.leds.size(), Eigen::Vector2d::Zero()) {}
};

std::optional<Eigen::Vector3d> HorizontalPart(const Eigen::Vector3d& direction,
                                              const Eigen::Vector3d& up) {
  const Eigen::Vector3d unit = direction.normalized();
  if (!(std::abs(unit.dot(up)) < kSteep)) return {};
  return (unit - up * unit.dot(up)).normalized();
}

Eigen::Vector3d MeanLed(const Rig& rig) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Led& led : rig.leds) {
    mean += led.p_led_in_target / static_cast<double>(rig.leds.size());
  }
  return mean;
}

// The axis of the frame that is near a direction, else the direction: a board's frame has an axis
// square to its face, and one LED that stands out turns the plane of all.
Eigen::Vector3d NearAxis(const Eigen::Vector3d& direction) {
  constexpr double kNear = 0.94;  // 20 degrees
  Eigen::Index axis = 0;
  if (direction.cwiseAbs().maxCoeff(&axis) < kNear) return direction;
  return std::copysign(1.0, direction[axis]) * Eigen::Vector3d::Unit(axis);
}

// Square to the plane in which the LEDs lie best, away from the points.
std::optional<Eigen::Vector3d> FacingOf(const Rig& rig) {
  const Eigen::Vector3d middle = MeanLed(rig);
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Led& led : rig.leds) {
    const Eigen::Vector3d d = led.p_led_in_target - middle;
    scatter += d * d.transpose();
  }
  const Eigen::Vector3d normal =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvectors().col(0);
  double side_m = 0.0;
  for (const NamedPoint& point : rig.points) {
    side_m += normal.dot(point.p_point_in_target - middle) / static_cast<double>(rig.points.size());
  }
  // Clearly on one side: further than half the LEDs' own extent.
  const double extent_m = std::sqrt(scatter.trace() / static_cast<double>(rig.leds.size()));
  if (!(std::abs(side_m) > 0.5 * extent_m)) return {};
  return NearAxis(side_m > 0.0 ? Eigen::Vector3d(-normal) : normal);
}

// Rows right, up, along.
std::optional<Eigen::Matrix3d> DirectionsFromCamera(const Eigen::Vector3d& up_in_camera) {
  const auto along = HorizontalPart(Eigen::Vector3d::UnitZ(), up_in_camera);
  if (!along) return {};
  Eigen::Matrix3d rows;
  rows.row(0) = along->cross(up_in_camera);
  rows.row(1) = up_in_camera;
  rows.row(2) = *along;
  return rows;
}

// Asks the solver what it makes of a world that differs from the rig file.
class Experiment {
 public:
  Experiment(const Rig& rig,
             const BudgetPlacement& placement,
             double centre_sigma_px,
             const Eigen::Matrix3d& directions)
      : rig_(rig),
        placement_(placement),
        centre_sigma_px_(centre_sigma_px),
        directions_(directions) {}

  // The first thing that went wrong; all that came after is of no use.
  const std::optional<BudgetFailure>& failure() const { return failure_; }

  // Of each point, half the difference of its error between the two worlds: its error by one sigma
  // of what was moved.
  std::vector<Eigen::Vector3d> Half(const Reality& more, const Reality& less) {
    std::vector<Eigen::Vector3d> errors = ErrorsIn(more);
    const std::vector<Eigen::Vector3d> others = ErrorsIn(less);
    for (std::size_t i = 0; i < errors.size(); ++i) errors[i] = 0.5 * (errors[i] - others[i]);
    return errors;
  }

  std::vector<Eigen::Vector3d> ErrorsIn(const Reality& reality) {
    std::vector<Eigen::Vector3d> errors(rig_.points.size(), Eigen::Vector3d::Zero());
    const auto problem = Seen(reality);
    if (!problem) return errors;
    const auto pose = SolveFused(*problem, placement_.camera_from_target);
    if (!pose) {
      Fail({BudgetFault::kNoPose, 0, pose.error()});
      return errors;
    }
    for (std::size_t i = 0; i < errors.size(); ++i) {
      const Eigen::Vector3d told = pose->camera_from_target * rig_.points[i].p_point_in_target;
      const Eigen::Vector3d is = placement_.camera_from_target * rig_.points[i].p_point_in_target;
      errors[i] = directions_ * (told - is);
    }
    return errors;
  }

 private:
  void Fail(const BudgetFailure& failure) {
    if (!failure_) failure_ = failure;
  }

  // What the sensors of that world send, as a problem over the rig file.
  std::optional<PoseProblem> Seen(const Reality& reality) {
    PoseProblem problem;
    problem.rig = &rig_;
    const CameraModel& camera = reality.rig.camera;
    for (std::size_t i = 0; i < reality.rig.leds.size(); ++i) {
      const auto seen =
          Project(camera, placement_.camera_from_target * reality.rig.leds[i].p_led_in_target);
      const bool is_inside = seen && seen->pixel_px.minCoeff() >= 0.0 &&
                             seen->pixel_px.x() <= camera.image_width_px - 1.0 &&
                             seen->pixel_px.y() <= camera.image_height_px - 1.0;
      if (!is_inside) {
        Fail({BudgetFault::kLedUnseen, i, {}});
        return {};
      }
      problem.leds.push_back(
          {static_cast<int>(i), seen->pixel_px + reality.centre_px[i], centre_sigma_px_});
    }
    const Eigen::Vector3d up_in_target =
        placement_.camera_from_target.rotation.conjugate() * placement_.up_in_camera;
    problem.target_tilt = Felt(reality.rig.target_tilt, up_in_target, reality.tilt_rad[0]);
    problem.camera_tilt =
        Felt(reality.rig.camera_tilt, placement_.up_in_camera, reality.tilt_rad[1]);
    return problem;
  }

  static TiltObservation Felt(const TiltMount& mount,
                              const Eigen::Vector3d& up_in_body,
                              const Eigen::Vector2d& noise_rad) {
    Inclination read = InclinationFromUp(mount.tilt_from_body * up_in_body);
    read.beta_rad += noise_rad.x();
    read.gamma_rad += noise_rad.y();
    return {read, mount.sigma_rad};
  }

  const Rig& rig_;
  const BudgetPlacement& placement_;
  double centre_sigma_px_;
  Eigen::Matrix3d directions_;
  std::optional<BudgetFailure> failure_;
};

// Adds up what single parameters do.
class Sum {
 public:
  Sum(const Rig& rig, Experiment* experiment, std::vector<PointBudget>* budgets)
      : rig_(rig), experiment_(*experiment), budgets_(*budgets) {}

  // An error that is independent of all others: `move` makes it by that many sigmas.
  template <class Move>
  void Add(ErrorSource source, const Move& move) {
    const auto by_sigma = Half(move);
    for (std::size_t i = 0; i < budgets_.size(); ++i) {
      budgets_[i].of[static_cast<std::size_t>(source)] += by_sigma[i] * by_sigma[i].transpose();
    }
  }

  template <class Move>
  std::vector<Eigen::Vector3d> Half(const Move& move) {
    Reality more(rig_);
    Reality less(rig_);
    move(more, 1.0);
    move(less, -1.0);
    return experiment_.Half(more, less);
  }

 private:
  const Rig& rig_;
  Experiment& experiment_;
  std::vector<PointBudget>& budgets_;
};

void AddCamera(const IntrinsicMatrix& covariance, Sum* sum, std::vector<PointBudget>* budgets) {
  const IntrinsicVector sigma = covariance.diagonal().cwiseSqrt();
  std::vector<Eigen::Matrix<double, 3, kIntrinsics>> by_parameter(
      budgets->size(), Eigen::Matrix<double, 3, kIntrinsics>::Zero());
  for (int k = 0; k < kIntrinsics; ++k) {
    if (!(sigma[k] > 0.0)) continue;
    const auto by_sigma = sum->Half([&](Reality& reality, double sigmas) {
      IntrinsicVector step = IntrinsicVector::Zero();
      step[k] = sigmas * sigma[k];
      reality.rig.camera = MovedCamera(reality.rig.camera, step);
    });
    for (std::size_t i = 0; i < by_sigma.size(); ++i) {
      by_parameter[i].col(k) = by_sigma[i] / sigma[k];
    }
  }
  const auto part = [&](std::size_t i, int first, int count) -> Eigen::Matrix3d {
    const auto by = by_parameter[i].middleCols(first, count);
    return by * covariance.block(first, first, count, count) * by.transpose();
  };
  for (std::size_t i = 0; i < budgets->size(); ++i) {
    PointBudget& budget = (*budgets)[i];
    budget.of[static_cast<std::size_t>(ErrorSource::kFocalLength)] = part(i, 0, 2);
    budget.of[static_cast<std::size_t>(ErrorSource::kPrincipalPoint)] = part(i, 2, 2);
    budget.of[static_cast<std::size_t>(ErrorSource::kDistortion)] = part(i, 4, kIntrinsics - 4);
    budget.camera = part(i, 0, kIntrinsics);
  }
}

void AddLeds(const Rig& rig, double centre_sigma_px, Sum* sum) {
  for (std::size_t j = 0; j < rig.leds.size(); ++j) {
    for (int axis = 0; axis < 3; ++axis) {
      sum->Add(ErrorSource::kLeds, [&](Reality& reality, double sigmas) {
        reality.rig.leds[j].p_led_in_target[axis] += sigmas * rig.leds[j].sigma_m;
      });
    }
    for (int axis = 0; axis < 2; ++axis) {
      sum->Add(ErrorSource::kLensResidual, [&](Reality& reality, double sigmas) {
        reality.centre_px[j][axis] += sigmas * rig.calibration_residual_px;
      });
      sum->Add(ErrorSource::kCentres, [&](Reality& reality, double sigmas) {
        reality.centre_px[j][axis] += sigmas * centre_sigma_px;
      });
    }
  }
}

void AddTilts(const Rig& rig, Sum* sum) {
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d turn = Eigen::Vector3d::Unit(axis);
    const auto turned = [&](const TiltMount& mount, double sigmas) -> Eigen::Matrix3d {
      return ExpRotation(sigmas * mount.mounting_sigma_rad * turn) * mount.tilt_from_body;
    };
    sum->Add(ErrorSource::kTargetMounting, [&](Reality& reality, double sigmas) {
      reality.rig.target_tilt.tilt_from_body = turned(rig.target_tilt, sigmas);
    });
    sum->Add(ErrorSource::kCameraMounting, [&](Reality& reality, double sigmas) {
      reality.rig.camera_tilt.tilt_from_body = turned(rig.camera_tilt, sigmas);
    });
  }
  for (int output = 0; output < 2; ++output) {
    for (std::size_t instrument = 0; instrument < 2; ++instrument) {
      const TiltMount& mount = instrument == 0 ? rig.target_tilt : rig.camera_tilt;
      sum->Add(ErrorSource::kTilts, [&](Reality& reality, double sigmas) {
        reality.tilt_rad[instrument][output] += sigmas * mount.sigma_rad;
      });
    }
  }
}

IntrinsicMatrix DeclaredIntrinsics(const Rig& rig) {
  IntrinsicMatrix covariance = IntrinsicMatrix::Zero();
  covariance.diagonal().head<4>() = rig.intrinsics_sigma_px.cwiseAbs2();
  return covariance;
}

void AddUp(const Rig& rig, std::vector<PointBudget>* budgets) {
  for (std::size_t i = 0; i < budgets->size(); ++i) {
    PointBudget& budget = (*budgets)[i];
    const double sigma_m = rig.points[i].sigma_m;
    budget.of[static_cast<std::size_t>(ErrorSource::kPoint)] =
        sigma_m * sigma_m * Eigen::Matrix3d::Identity();
    budget.calibration =
        budget.camera + budget.From(ErrorSource::kLensResidual) + budget.From(ErrorSource::kLeds) +
        budget.From(ErrorSource::kCameraMounting) + budget.From(ErrorSource::kTargetMounting) +
        budget.From(ErrorSource::kPoint);
    budget.noise = budget.From(ErrorSource::kCentres) + budget.From(ErrorSource::kTilts);
  }
}

}  // namespace

Result<BudgetPlacement, BudgetFailure> StraightAhead(
    const Rig& rig, double distance_m, const std::optional<Eigen::Vector3d>& facing_in_target) {
  const Eigen::Vector3d up_in_camera = rig.camera_tilt.tilt_from_body.row(2);
  const Eigen::Vector3d up_in_target = rig.target_tilt.tilt_from_body.row(2);
  const auto along = HorizontalPart(Eigen::Vector3d::UnitZ(), up_in_camera);
  if (!along) return Failure{BudgetFailure{BudgetFault::kLooksUp, 0, {}}};
  const auto wanted = facing_in_target ? facing_in_target : FacingOf(rig);
  const auto facing = wanted ? HorizontalPart(*wanted, up_in_target) : wanted;
  if (!facing) return Failure{BudgetFailure{BudgetFault::kNoFacing, 0, {}}};
  Eigen::Matrix3d in_target;
  in_target << *facing, up_in_target, facing->cross(up_in_target);
  Eigen::Matrix3d in_camera;
  in_camera << -*along, up_in_camera, (-*along).cross(up_in_camera);
  BudgetPlacement placement;
  placement.up_in_camera = up_in_camera;
  placement.camera_from_target.rotation =
      Eigen::Quaterniond(Eigen::Matrix3d(in_camera * in_target.transpose())).normalized();
  placement.camera_from_target.translation =
      distance_m * Eigen::Vector3d::UnitZ() - placement.camera_from_target.rotation * MeanLed(rig);
  return placement;
}

Result<std::vector<PointBudget>, BudgetFailure> BudgetOf(const Rig& rig,
                                                         const BudgetPlacement& placement,
                                                         const BudgetOptions& options) {
  const auto directions = DirectionsFromCamera(placement.up_in_camera);
  if (!directions) return Failure{BudgetFailure{BudgetFault::kLooksUp, 0, {}}};
  std::vector<PointBudget> budgets(rig.points.size());
  for (std::size_t i = 0; i < budgets.size(); ++i) {
    budgets[i].of.fill(Eigen::Matrix3d::Zero());
    budgets[i].distance_m = (placement.camera_from_target * rig.points[i].p_point_in_target).norm();
  }
  Experiment experiment(rig, placement, options.centre_sigma_px, *directions);
  experiment.ErrorsIn(Reality(rig));  // a failure here is that of the placement
  Sum sum(rig, &experiment, &budgets);
  AddCamera(options.intrinsics.value_or(DeclaredIntrinsics(rig)), &sum, &budgets);
  AddLeds(rig, options.centre_sigma_px, &sum);
  AddTilts(rig, &sum);
  if (experiment.failure()) return Failure{*experiment.failure()};
  AddUp(rig, &budgets);
  return budgets;
}

}  // namespace tbm
