#include "pose/solve/p3p.h"

#include <cmath>

#include <gtest/gtest.h>

#include "pose/base/angle.h"
#include "tests/support/scene.h"

namespace tbm::test {
namespace {

struct Sighting {
  std::array<Eigen::Vector3d, 3> bearings;
  std::array<Eigen::Vector3d, 3> points;
};

Sighting See(const Rigid3& pose, const std::array<Eigen::Vector3d, 3>& points) {
  Sighting sighting{{}, points};
  for (std::size_t i = 0; i < 3; ++i) {
    sighting.bearings[i] = pose.rotation.toRotationMatrix() * points[i] + pose.translation;
  }
  return sighting;
}

double NearestError(const P3pPoses& poses, const Rigid3& truth) {
  double nearest = 1e9;
  for (const Rigid3& pose : poses) nearest = std::min(nearest, ErrorBetween(pose, truth).norm());
  return nearest;
}

// Every pose handed out must place the points on their rays, in front.
double WorstMisfit(const P3pPoses& poses, const Sighting& s) {
  double worst = 0.0;
  for (const Rigid3& pose : poses) {
    for (std::size_t i = 0; i < 3; ++i) {
      const Eigen::Vector3d p = pose * s.points[i];
      worst = std::max(worst, (p.normalized() - s.bearings[i].normalized()).norm());
    }
  }
  return worst;
}

TEST(P3p, FindsThePoseOfLedTriples) {
  Random random("p3p leds");
  const Rig rig = PublishedRig();
  int lost = 0;
  for (int i = 0; i < 20000; ++i) {
    const Truth truth = DrawTruth(random, {2.5, 8.0, 0.5, 0.5, 0.1});
    const auto a = static_cast<std::size_t>(random.Index(5));
    const std::size_t b = (a + 1 + static_cast<std::size_t>(random.Index(4))) % 5;
    std::size_t c = 0;
    while (c == a || c == b) ++c;
    const Sighting s = See(
        truth.camera_from_target,
        {rig.leds[a].p_led_in_target, rig.leds[b].p_led_in_target, rig.leds[c].p_led_in_target});
    const P3pPoses poses = SolveP3p(s.bearings, s.points);
    EXPECT_LT(WorstMisfit(poses, s), 1e-9);
    lost += NearestError(poses, truth.camera_from_target) > 1e-6 ? 1 : 0;
  }
  EXPECT_LE(lost, 2);
}

// Points all around, any attitude: the whole space of triangles.
TEST(P3p, FindsThePoseOfRandomTriangles) {
  Random random("p3p triangles");
  int lost = 0;
  const int draws = 50000;
  for (int i = 0; i < draws; ++i) {
    const std::array<Eigen::Vector3d, 3> in_camera = {
        Eigen::Vector3d(random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(1, 6)),
        Eigen::Vector3d(random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(1, 6)),
        Eigen::Vector3d(random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(1, 6))};
    const Rigid3 truth{random.Rotation(), random.Normal3()};
    const Rigid3 back = Inverse(truth);
    const Sighting s = See(truth, {back * in_camera[0], back * in_camera[1], back * in_camera[2]});
    const P3pPoses poses = SolveP3p(s.bearings, s.points);
    EXPECT_LT(WorstMisfit(poses, s), 1e-7);
    lost += NearestError(poses, truth) > 1e-6 ? 1 : 0;
  }
  // Near the danger cylinder two poses merge and half the digits go.
  EXPECT_LE(lost, draws / 5000);
}

// An equilateral triangle square on to the camera and centred: four symmetric answers at the most,
// the true one among them.
TEST(P3p, CopesWithSymmetry) {
  const double s = std::sqrt(3.0) / 2.0;
  const std::array<Eigen::Vector3d, 3> points = {
      Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(-0.5, s, 0), Eigen::Vector3d(-0.5, -s, 0)};
  for (const double z : {0.8, 1.5, 4.0, 20.0}) {
    const Rigid3 truth{Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0), {0.0, 0.0, z}};
    const Sighting sighting = See(truth, points);
    const P3pPoses poses = SolveP3p(sighting.bearings, sighting.points);
    EXPECT_LT(NearestError(poses, truth), 1e-6) << z;
  }
}

TEST(P3p, RefusesPointsOnOneLineAndPointsThatCoincide) {
  const Rigid3 truth{Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0), {0.1, 0.2, 4.0}};
  for (const double third : {2.0, 0.5, 1.0}) {
    const Sighting s = See(truth,
                           {Eigen::Vector3d(0, 0, 0),
                            Eigen::Vector3d(0.1, 0.2, 0.3),
                            Eigen::Vector3d(0.1 * third, 0.2 * third, 0.3 * third)});
    EXPECT_TRUE(SolveP3p(s.bearings, s.points).empty());
  }
}

TEST(P3p, SaysNothingWhenNoTriangleFits) {
  // A side of 1 m under a right angle, and a third point whose ray is the first's: no triangle of
  // these sides has it.
  const P3pPoses poses =
      SolveP3p({Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0, 1e-3, 1), Eigen::Vector3d(1, 0, 1e-3)},
               {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(100, 0, 0), Eigen::Vector3d(0, 0.01, 0)});
  for (const Rigid3& pose : poses) EXPECT_TRUE(pose.translation.allFinite());
}

}  // namespace
}  // namespace tbm::test
