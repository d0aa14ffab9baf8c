#pragma once

#include <array>
#include <optional>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "guidance/fusion/strapdown.h"

namespace tbm {

// What a fusion may estimate beside position, velocity, attitude and the two biases.
enum class FusionOption {
  kTiltOffset,      // 2: of the inclinometer's two angles [rad]
  kGravity,         // 2: direction of gravity in the world, about x and y [rad]
  kTimeOffset,      // 1: camera stamp minus imu time [s]
  kCameraRotation,  // 3: of the camera in the unit, about the camera's axes [rad]
  kCameraPosition,  // 3: of the camera in the unit [m]
  kOdometerScale,   // 1: true distance over told distance, minus one
  kOdometerTurn,    // 2: of the vehicle's frame in the unit, about its y and z [rad]
  kImageScale,      // 1: true height of the camera over the ground over the assumed one, minus one
  kImageTurn,       // 1: of the ground camera in the unit, about the plumb line [rad]
};
inline constexpr int kFusionOptions = 9;

// Where each block of the error state stands. Position [m] and velocity [m/s] in the world,
// attitude [rad] about the axes of the unit (R_true = R Exp(e)), then gyro [rad/s] and
// accelerometer bias [m/s2], then the options, then `modes` numbers without unit: what is not known
// of the targets (target_modes.h).
class FusionLayout {
 public:
  static constexpr int kPosition = 0;
  static constexpr int kVelocity = 3;
  static constexpr int kAttitude = 6;
  static constexpr int kGyroBias = 9;
  static constexpr int kAccelBias = 12;
  static constexpr int kCore = 15;
  static constexpr int kMostModes = 24;
  static constexpr int kMost = kCore + 16 + kMostModes;

  FusionLayout() { at_.fill(-1); }
  // `options` in any order, each once; 0 <= modes <= kMostModes.
  explicit FusionLayout(const std::vector<FusionOption>& options, int modes = 0);

  static int SizeOf(FusionOption option);
  int size() const { return size_; }
  // The first row of an option's block; -1 when it is not estimated.
  int At(FusionOption option) const { return at_[static_cast<std::size_t>(option)]; }
  bool Has(FusionOption option) const { return At(option) >= 0; }
  int modes_at() const { return size_ - modes_; }
  int modes() const { return modes_; }

 private:
  std::array<int, kFusionOptions> at_{};
  int size_ = kCore;
  int modes_ = 0;
};

// Bounded on the stack; the size is that of the layout.
using FusionVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, FusionLayout::kMost, 1>;
using FusionMatrix = Eigen::
    Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, FusionLayout::kMost, FusionLayout::kMost>;

// The values the errors are errors of.
struct FusionState {
  Motion motion;
  Eigen::Vector3d gyro_bias_rad_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_bias_m_s2 = Eigen::Vector3d::Zero();
  Eigen::Vector2d tilt_offset_rad = Eigen::Vector2d::Zero();
  Eigen::Vector2d gravity_turn_rad = Eigen::Vector2d::Zero();
  double time_offset_s = 0.0;
  Eigen::Quaterniond camera_from_imu = Eigen::Quaterniond::Identity();
  Eigen::Vector3d camera_in_imu_m = Eigen::Vector3d::Zero();
  double odometer_scale = 0.0;
  Eigen::Vector2d odometer_turn_rad = Eigen::Vector2d::Zero();
  double image_scale = 0.0;
  double image_turn_rad = 0.0;
  Eigen::Matrix<double, Eigen::Dynamic, 1, 0, FusionLayout::kMostModes, 1> modes;
};

// Gravity in the world [m/s2], pointing down; magnitude > 0.
Eigen::Vector3d GravityInWorld(const FusionState& state, double gravity_m_s2);

// `state` moved by the error e of this layout, and the error that takes `from` to `to`.
FusionState MovedBy(const FusionState& state, const FusionLayout& layout, const FusionVector& e);
FusionVector ErrorFrom(const FusionState& from, const FusionState& to, const FusionLayout& layout);

}  // namespace tbm
