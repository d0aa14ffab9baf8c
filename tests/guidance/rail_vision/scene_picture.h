#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "guidance/rail_vision/find_targets.h"
#include "pose/centres/image_view.h"
#include "pose/geometry/camera_model.h"
#include "pose/geometry/rigid3.h"
#include "tests/support/random.h"

namespace tbm::test {

// A flat thing in the world. Its frame: x right, y down, z away from who looks at it. `light` says
// how bright a place of it is, 0 .. 1; NaN where it has a hole.
struct Patch {
  Rigid3 world_from_patch;
  double half_x_m = 0.0;
  double half_y_m = 0.0;
  std::function<double(double x_m, double y_m)> light;
  int places = 6;       // a pixel is the mean of so many by so many places in it
  bool is_even = true;  // as bright between a pixel's corners as at them, where they are alike
};
struct Lamp {
  Eigen::Vector3d in_world_m;
  double peak_dn = 150.0;
  double spread_px = 1.2;
};

// Later patches hide earlier ones.
struct Scenery {
  std::vector<Patch> patches;
  std::vector<Lamp> lamps;
  double wall = 0.45;
  // Brightness of full light at a place in the image, 0 .. 1 from left to right and top to bottom.
  std::function<double(double, double)> full_dn = [](double, double) { return 220.0; };
  double blur_px = 0.7;
  double noise_dn = 1.5;
};

Patch CirclePatch(const Rigid3& world_from_patch, double diameter_m, bool is_light = false);
Patch CodedPatch(const Rigid3& world_from_patch, double side_m, int code);
// Origin in the first inner corner.
Patch BoardPatch(const Rigid3& world_from_patch, int columns, int rows, double pitch_m);
Patch PlainPatch(const Rigid3& world_from_patch, double half_x_m, double half_y_m, double light);

// Pictures by a camera with a lens, without OpenCV.
class ScenePainter {
 public:
  explicit ScenePainter(const CameraModel& camera);
  std::vector<std::uint8_t> Paint(const Scenery& scenery,
                                  const Rigid3& camera_from_world,
                                  Random& random) const;
  ImageView View(const std::vector<std::uint8_t>& pixels) const;
  const CameraModel& camera() const { return camera_; }

 private:
  void Lay(const Patch& patch, const Rigid3& camera_from_world, std::vector<double>* light) const;

  CameraModel camera_;
  std::vector<Eigen::Vector2d> rays_;  // of the pixels' corners, row by row
};

// 960 x 720, 49 degrees wide, with barrel distortion of some pixels.
CameraModel TrolleyCamera();

// A pose that looks from `at` towards `to`, z up in the image.
Rigid3 LookingAt(const Eigen::Vector3d& at, const Eigen::Vector3d& to);
// A patch at `at` that faces `viewer`, then turned about its x, y and z.
Rigid3 Facing(const Eigen::Vector3d& at,
              const Eigen::Vector3d& viewer,
              const Eigen::Vector3d& turns);

// What a pose with this covariance (rigid3.h) expects to see.
ExpectedImage ExpectedFrom(const CameraModel& camera,
                           const Rigid3& camera_from_world,
                           const PoseCovariance& covariance,
                           const std::vector<SoughtTarget>& targets);

// For looking at.
void WritePicture(const std::string& path, const ImageView& image);

}  // namespace tbm::test
