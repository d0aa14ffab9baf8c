#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "guidance/rail_vision/find_targets.h"
#include "tests/guidance/rail_vision/scene_picture.h"

namespace tbm::test {

inline const Eigen::Vector3d kCameraAt(0.0, 0.0, 1.5);

// Of TrolleyCamera; shared, for its rays take half a second.
const ScenePainter& Painter();

PoseCovariance PoseSigma(double turn_rad, double shift_m);
Rigid3 Off(const Rigid3& truth, double turn_rad, double shift_m, Random& random);

// Pictures for the eye, where somebody wants them: in the folder TBM_PICTURES.
void Show(const std::string& name, const std::vector<std::uint8_t>& pixels);

// A scene with targets on a wall three metres ahead; truth by projection.
struct Scene {
  Scenery scenery;
  std::vector<SoughtTarget> targets;
  Rigid3 camera_from_world = LookingAt(kCameraAt, {0.0, 3.0, 1.5});

  Eigen::Vector2d TruthOf(std::size_t target) const;
  void AddCircle(const Eigen::Vector3d& at, double diameter_m, const Eigen::Vector3d& turns);
  void AddCode(const Eigen::Vector3d& at, double side_m, int code, const Eigen::Vector3d& turns);
  // `at`: its first inner corner.
  void AddBoard(const std::string& name,
                const Eigen::Vector3d& at,
                int columns,
                int rows,
                double pitch_m,
                const Eigen::Vector3d& turns);
  void AddLamp(const Eigen::Vector3d& at, double spread_px);

  // What is found by a camera that believes to be at `guess`, as exactly as `sigma` says.
  TargetsInImage Find(const std::vector<std::uint8_t>& pixels,
                      const Rigid3& guess,
                      const PoseCovariance& sigma) const;
};

Eigen::Vector3d Turns(Random& random, double most_deg);
// On the wall, apart enough for two plates.
std::vector<Eigen::Vector3d> Places(Random& random, int count, double apart_m);

struct Accuracy {
  int asked = 0;
  int seen = 0;
  double worst_px = 0.0;
  double squared_px = 0.0;
  double squared_sigmas = 0.0;

  void Add(const Scene& scene, const TargetsInImage& image);
  double Rms_px() const;
  double ErrorOverSigma() const;
  void Print(const std::string& what) const;
};

struct Count {
  int expected = 0;
  int seen = 0;
  int wrong = 0;  // of those, more than a pixel off

  void Add(const Scene& scene, const TargetsInImage& image);
};

}  // namespace tbm::test
