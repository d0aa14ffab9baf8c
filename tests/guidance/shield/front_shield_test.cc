#include "guidance/shield/front_shield.h"

#include <cmath>
#include <cstdio>
#include <optional>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "pose/base/angle.h"
#include "pose/solve/solve_pose.h"
#include "tests/support/scene.h"

namespace tbm::test {
namespace {

constexpr double kReading_rad = DegToRad(0.003);

UncertainRigid3 Uncertain(const Rigid3& b_from_a, double turn_sigma_rad, double shift_sigma_m) {
  UncertainRigid3 made{b_from_a, PoseCovariance::Zero()};
  made.covariance.diagonal() << Eigen::Vector3d::Constant(turn_sigma_rad * turn_sigma_rad),
      Eigen::Vector3d::Constant(shift_sigma_m * shift_sigma_m);
  return made;
}

Rigid3 Drawn(const UncertainRigid3& of, Random& random) {
  PoseError e;
  for (int i = 0; i < 6; ++i) e[i] = random.Normal(std::sqrt(of.covariance(i, i)));
  return Moved(of.b_from_a, e);
}

// Camera on the rear shield: its z along the shield's x, its y down. Board on the front shield,
// seen upright from behind.
struct Machine {
  Rig rig = FieldRig();
  MachineGeometry geometry;
  double centre_sigma_px = 0.0;

  Machine(double place_sigma_rad,
          double camera_mounting_rad,
          double target_mounting_rad,
          double centre_px)
      : centre_sigma_px(centre_px) {
    Eigen::Matrix3d forward;
    forward << 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0;
    geometry.rear_shield_from_camera =
        Uncertain({Eigen::Quaterniond(forward), {1.2, 0.4, 0.9}}, place_sigma_rad, 0.0003);
    Eigen::Matrix3d facing_back;
    facing_back << 0.0, 0.0, -1.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.0;
    geometry.front_shield_from_target =
        Uncertain({Eigen::Quaterniond(facing_back), {-1.5, 0.3, 0.8}}, 5e-5, 0.0003);
    rig.camera_tilt.mounting_sigma_rad = camera_mounting_rad;
    rig.target_tilt.mounting_sigma_rad = target_mounting_rad;
  }
};

struct Outcome {
  UncertainRigid3 said;
  UncertainRigid3 as_if_independent;
  Rigid3 truth;
};

// One machine as it was built, and what is made of its readings by one who knows the drawing only.
// Empty when the gate, at a risk of 1e-3, refuses the readings.
std::optional<Outcome> Measure(const Machine& machine, Random& random) {
  Rig built = machine.rig;
  for (TiltMount* mount : {&built.camera_tilt, &built.target_tilt}) {
    mount->tilt_from_body =
        mount->tilt_from_body *
        ExpRotation(random.Normal3(mount->mounting_sigma_rad)).toRotationMatrix();
  }
  const Rigid3 rear_from_camera = Drawn(machine.geometry.rear_shield_from_camera, random);
  const Rigid3 front_from_target = Drawn(machine.geometry.front_shield_from_target, random);
  const Rigid3 site_from_rear{ExpRotation({0.02, -0.03, 0.9}), {12.0, 34.0, 5.0}};
  Truth truth;
  truth.camera_from_target = {
      ExpRotation({0.01, -0.02, 0.015}) * Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0),
      {0.1, -0.05, 4.0}};
  truth.up_in_camera =
      (site_from_rear * rear_from_camera).rotation.conjugate() * Eigen::Vector3d::UnitZ();

  PoseProblem problem = NoisyProblem(built, truth, machine.centre_sigma_px, kReading_rad, random);
  problem.rig = &machine.rig;
  const auto relative = SolveFused(problem);
  TBM_CHECK(relative.has_value());

  RearShieldProblem rear;
  rear.speed_sigma_m_per_s = 1e-6;
  const double prism_sigma_m = 0.002;
  for (const Eigen::Vector3d& place : {Eigen::Vector3d(0.5, 1.8, 1.2),
                                       Eigen::Vector3d(0.7, -1.9, 1.0),
                                       Eigen::Vector3d(-2.5, 0.3, 2.2)}) {
    PrismFix fix;
    fix.prism = static_cast<int>(rear.prisms.size());
    fix.p_in_site = site_from_rear * place + random.Normal3(prism_sigma_m);
    fix.covariance = prism_sigma_m * prism_sigma_m * Eigen::Matrix3d::Identity();
    rear.prisms.push_back({place, 0.0});
    rear.fixes.push_back(fix);
  }
  // Another reading than that of the frame.
  Inclination tilt = ExactInclination(built.camera_tilt, truth.up_in_camera);
  tilt.beta_rad += random.Normal(kReading_rad);
  tilt.gamma_rad += random.Normal(kReading_rad);
  rear.up = UpOfRearShield(machine.rig, machine.geometry, tilt, kReading_rad);
  const auto rear_fix = FixRearShield(rear, {});
  if (!rear_fix || rear_fix->left_out || rear_fix->exchanged) return {};

  const RelativeFix seen{{relative->camera_from_target, relative->covariance},
                         problem.target_tilt,
                         problem.camera_tilt};
  Outcome outcome;
  outcome.said = FrontShieldInSite(*rear_fix, machine.rig, machine.geometry, seen);
  outcome.as_if_independent =
      UncertainRigid3{rear_fix->site_from_rear_shield, rear_fix->covariance} *
      machine.geometry.rear_shield_from_camera * seen.camera_from_target *
      Inverse(machine.geometry.front_shield_from_target);
  outcome.truth =
      site_from_rear * rear_from_camera * truth.camera_from_target * Inverse(front_from_target);
  return outcome;
}

struct Summary {
  int refused = 0;
  double nees = 0.0;
  double head_ratio = 0.0;         // RMS at the cutter head over the sigma that was said
  double independent_ratio = 0.0;  // the same with the factors taken as independent
};

// The cutter head, five metres ahead of the board; across the drive only, where it matters.
Summary MeasureMany(const Machine& machine, const char* stream) {
  constexpr int kDraws = 1200;
  const UncertainPoint head{{5.0, 0.0, 0.0}, Eigen::Matrix3d::Zero()};
  Random random(stream);
  Summary summary;
  double seen = 0.0;
  double said = 0.0;
  double independent = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    const std::optional<Outcome> outcome = Measure(machine, random);
    if (!outcome) {
      ++summary.refused;
      continue;
    }
    const PoseError error = ErrorBetween(outcome->said.b_from_a, outcome->truth);
    summary.nees += error.dot(outcome->said.covariance.ldlt().solve(error)) / kDraws;
    const double up = (outcome->said.b_from_a * head.p - outcome->truth * head.p).z();
    seen += up * up;
    said += (outcome->said * head).covariance(2, 2);
    independent += (outcome->as_if_independent * head).covariance(2, 2);
  }
  summary.head_ratio = std::sqrt(seen / said);
  summary.independent_ratio = std::sqrt(seen / independent);
  return summary;
}

// Clear sight: the relative pose rests on the image.
TEST(FrontShield, CovarianceKnowsThatOneInclinometerSpeaksTwice) {
  const Summary summary =
      MeasureMany(Machine(0.0, DegToRad(0.05), DegToRad(0.05), 0.1), "front_mounting");
  EXPECT_LE(summary.refused, 6);
  EXPECT_NEAR(summary.nees, 6.0, 0.35);
  EXPECT_NEAR(summary.head_ratio, 1.0, 0.06);
}

// Dust: it rests on the tilts, and so does the rear shield; the camera's mounting cancels.
TEST(FrontShield, WhatCancelsIsNotCountedTwice) {
  const Summary summary =
      MeasureMany(Machine(0.0, DegToRad(0.03), DegToRad(0.005), 0.6), "front_dust");
  EXPECT_NEAR(summary.nees, 6.0, 0.35);
  EXPECT_NEAR(summary.head_ratio, 1.0, 0.06);
  EXPECT_LT(summary.independent_ratio, 0.8);
  std::printf("cutter head, up: RMS over sigma %.3f, over the sigma of independent factors %.3f\n",
              summary.head_ratio,
              summary.independent_ratio);
}

TEST(FrontShield, CovarianceKnowsThatTheCamerasPlaceEntersTwice) {
  const Summary summary =
      MeasureMany(Machine(5e-4, DegToRad(0.01), DegToRad(0.01), 0.1), "front_place");
  EXPECT_NEAR(summary.nees, 6.0, 0.35);
  EXPECT_NEAR(summary.head_ratio, 1.0, 0.06);
  EXPECT_LT(summary.independent_ratio, 0.9);
}

TEST(FrontShield, WithoutTiltsTheFactorsAreIndependent) {
  Random random("front_independent");
  const Machine machine(0.0, 1e-4, 1e-4, 0.1);
  RearShieldFix rear;
  rear.site_from_rear_shield = {random.Rotation(), random.Normal3(10.0)};
  rear.covariance.diagonal() << 1e-8, 2e-8, 3e-8, 4e-6, 5e-6, 6e-6;
  const RelativeFix relative{
      Uncertain({random.Rotation(), random.Normal3(4.0)}, 1e-4, 1e-3), {}, {}};
  const UncertainRigid3 front = FrontShieldInSite(rear, machine.rig, machine.geometry, relative);
  const UncertainRigid3 chain = UncertainRigid3{rear.site_from_rear_shield, rear.covariance} *
                                machine.geometry.rear_shield_from_camera *
                                relative.camera_from_target *
                                Inverse(machine.geometry.front_shield_from_target);
  EXPECT_LT(ErrorBetween(front.b_from_a, chain.b_from_a).norm(), 1e-12);
  EXPECT_LT((front.covariance - chain.covariance).norm() / chain.covariance.norm(), 1e-12);
}

TEST(FrontShield, AReadingThatIsNoNumberLevelsNothing) {
  const Machine machine(0.0, 1e-4, 1e-4, 0.1);
  EXPECT_FALSE(UpOfRearShield(machine.rig, machine.geometry, {std::nan(""), 0.0}, 1e-4));
}

}  // namespace
}  // namespace tbm::test
