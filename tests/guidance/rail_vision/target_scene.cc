#include "tests/guidance/rail_vision/target_scene.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "pose/base/angle.h"

namespace tbm::test {

const ScenePainter& Painter() {
  static const ScenePainter painter(TrolleyCamera());
  return painter;
}

PoseCovariance PoseSigma(double turn_rad, double shift_m) {
  PoseCovariance covariance = PoseCovariance::Zero();
  covariance.diagonal().head<3>().setConstant(turn_rad * turn_rad);
  covariance.diagonal().tail<3>().setConstant(shift_m * shift_m);
  return covariance;
}

Rigid3 Off(const Rigid3& truth, double turn_rad, double shift_m, Random& random) {
  PoseError e;
  e.head<3>() = random.Normal3(turn_rad);
  e.tail<3>() = random.Normal3(shift_m);
  return Moved(truth, e);
}

void Show(const std::string& name, const std::vector<std::uint8_t>& pixels) {
  if (const char* folder = std::getenv("TBM_PICTURES")) {
    WritePicture(std::string(folder) + "/" + name + ".pgm", Painter().View(pixels));
  }
}

Eigen::Vector2d Scene::TruthOf(std::size_t target) const {
  return Project(Painter().camera(), camera_from_world * targets[target].in_world_m)->pixel_px;
}

void Scene::AddCircle(const Eigen::Vector3d& at, double diameter_m, const Eigen::Vector3d& turns) {
  scenery.patches.push_back(
      CirclePatch(Facing(at, kCameraAt, turns), diameter_m, targets.size() % 2 == 1));
  targets.push_back({{TargetKind::kCircle, diameter_m, 0, "", 0, 0, 0}, at});
}

void Scene::AddCode(const Eigen::Vector3d& at,
                    double side_m,
                    int code,
                    const Eigen::Vector3d& turns) {
  scenery.patches.push_back(CodedPatch(Facing(at, kCameraAt, turns), side_m, code));
  targets.push_back({{TargetKind::kCoded, 0.0, code, "", 0, 0, 0}, at});
}

void Scene::AddBoard(const std::string& name,
                     const Eigen::Vector3d& at,
                     int columns,
                     int rows,
                     double pitch_m,
                     const Eigen::Vector3d& turns) {
  const Rigid3 world_from_board = Facing(at, kCameraAt, turns);
  scenery.patches.push_back(BoardPatch(world_from_board, columns, rows, pitch_m));
  for (int i = 0; i < columns * rows; ++i) {
    const Eigen::Vector3d on((i % columns) * pitch_m, (i / columns) * pitch_m, 0.0);
    targets.push_back(
        {{TargetKind::kBoard, 0.0, 0, name, columns, rows, i}, world_from_board * on});
  }
}

void Scene::AddLamp(const Eigen::Vector3d& at, double spread_px) {
  scenery.lamps.push_back({at, 140.0, spread_px});
  targets.push_back({{TargetKind::kLed, 0.0, 0, "", 0, 0, 0}, at});
}

TargetsInImage Scene::Find(const std::vector<std::uint8_t>& pixels,
                           const Rigid3& guess,
                           const PoseCovariance& sigma) const {
  TargetFinder finder;
  const CameraModel& camera = Painter().camera();
  return finder.Find(
      Painter().View(pixels), camera, targets, {ExpectedFrom(camera, guess, sigma, targets), {}});
}

Eigen::Vector3d Turns(Random& random, double most_deg) {
  const double most = DegToRad(most_deg);
  return {random.Uniform(-most, most), random.Uniform(-most, most), random.Uniform(-0.5, 0.5)};
}

std::vector<Eigen::Vector3d> Places(Random& random, int count, double apart_m) {
  constexpr double kHalfWidth_m = 0.9;
  constexpr double kHalfHeight_m = 0.6;
  std::vector<Eigen::Vector3d> places;
  for (int tries = 0; static_cast<int>(places.size()) < count && tries < 5000; ++tries) {
    const Eigen::Vector3d at(random.Uniform(-kHalfWidth_m, kHalfWidth_m),
                             random.Uniform(2.6, 3.4),
                             1.5 + random.Uniform(-kHalfHeight_m, kHalfHeight_m));
    const bool is_free = std::all_of(places.begin(), places.end(), [&](const Eigen::Vector3d& p) {
      const Eigen::Vector2d off(p.x() - at.x(), p.z() - at.z());
      return off.norm() > apart_m;
    });
    if (is_free) places.push_back(at);
  }
  return places;
}

void Accuracy::Add(const Scene& scene, const TargetsInImage& image) {
  asked += static_cast<int>(scene.targets.size());
  for (const TargetSeen& one : image.seen) {
    const Eigen::Vector2d off = one.pixel_px - scene.TruthOf(one.target);
    ++seen;
    worst_px = std::max(worst_px, off.norm());
    squared_px += 0.5 * off.squaredNorm();
    squared_sigmas += 0.5 * off.squaredNorm() / (one.sigma_px * one.sigma_px);
  }
}
double Accuracy::Rms_px() const { return std::sqrt(squared_px / seen); }
double Accuracy::ErrorOverSigma() const { return std::sqrt(squared_sigmas / seen); }
void Accuracy::Print(const std::string& what) const {
  std::printf("%-28s seen %4d of %4d, rms %.3f px, worst %.3f px, error over sigma %.2f\n",
              what.c_str(),
              seen,
              asked,
              Rms_px(),
              worst_px,
              ErrorOverSigma());
}

void Count::Add(const Scene& scene, const TargetsInImage& image) {
  expected += static_cast<int>(scene.targets.size());
  for (const TargetSeen& one : image.seen) {
    ++seen;
    if ((one.pixel_px - scene.TruthOf(one.target)).norm() > 1.0) ++wrong;
  }
}

}  // namespace tbm::test
