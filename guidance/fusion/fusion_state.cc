#include "guidance/fusion/fusion_state.h"

#include "pose/base/check.h"
#include "pose/geometry/rigid3.h"

namespace tbm {
namespace {

// Calls `visit(row, value)` for the blocks that are plain numbers.
template <class State, class Visit>
void VisitPlain(State& state, const FusionLayout& layout, const Visit& visit) {
  const auto block = [&](int row, auto& values) {
    if (row < 0) return;
    for (int i = 0; i < values.size(); ++i) visit(row + i, values[i]);
  };
  const auto number = [&](FusionOption option, auto& value) {
    if (layout.Has(option)) visit(layout.At(option), value);
  };
  block(FusionLayout::kPosition, state.motion.position_world_m);
  block(FusionLayout::kVelocity, state.motion.velocity_world_m_s);
  block(FusionLayout::kGyroBias, state.gyro_bias_rad_s);
  block(FusionLayout::kAccelBias, state.accel_bias_m_s2);
  block(layout.At(FusionOption::kTiltOffset), state.tilt_offset_rad);
  block(layout.At(FusionOption::kGravity), state.gravity_turn_rad);
  number(FusionOption::kTimeOffset, state.time_offset_s);
  block(layout.At(FusionOption::kCameraPosition), state.camera_in_imu_m);
  number(FusionOption::kOdometerScale, state.odometer_scale);
  block(layout.At(FusionOption::kOdometerTurn), state.odometer_turn_rad);
  number(FusionOption::kImageScale, state.image_scale);
  number(FusionOption::kImageTurn, state.image_turn_rad);
  if (layout.modes() > 0) block(layout.modes_at(), state.modes);
}

}  // namespace

FusionLayout::FusionLayout(const std::vector<FusionOption>& options, int modes) : modes_(modes) {
  TBM_CHECK(modes >= 0 && modes <= kMostModes);
  at_.fill(-1);
  for (const FusionOption option : options) {
    int& at = at_[static_cast<std::size_t>(option)];
    TBM_CHECK(at < 0);
    at = size_;
    size_ += SizeOf(option);
  }
  size_ += modes;
}

int FusionLayout::SizeOf(FusionOption option) {
  switch (option) {
    case FusionOption::kTiltOffset:
    case FusionOption::kGravity:
    case FusionOption::kOdometerTurn:
      return 2;
    case FusionOption::kCameraRotation:
    case FusionOption::kCameraPosition:
      return 3;
    case FusionOption::kTimeOffset:
    case FusionOption::kOdometerScale:
    case FusionOption::kImageScale:
    case FusionOption::kImageTurn:
      return 1;
  }
  return 0;
}

Eigen::Vector3d GravityInWorld(const FusionState& state, double gravity_m_s2) {
  return ExpRotation({state.gravity_turn_rad.x(), state.gravity_turn_rad.y(), 0.0}) *
         Eigen::Vector3d(0.0, 0.0, -gravity_m_s2);
}

FusionState MovedBy(const FusionState& state, const FusionLayout& layout, const FusionVector& e) {
  FusionState moved = state;
  VisitPlain(moved, layout, [&](int row, double& value) { value += e[row]; });
  moved.motion.world_from_imu =
      (state.motion.world_from_imu * ExpRotation(e.segment<3>(FusionLayout::kAttitude)))
          .normalized();
  if (layout.Has(FusionOption::kCameraRotation)) {
    moved.camera_from_imu = (ExpRotation(e.segment<3>(layout.At(FusionOption::kCameraRotation))) *
                             state.camera_from_imu)
                                .normalized();
  }
  return moved;
}

FusionVector ErrorFrom(const FusionState& from, const FusionState& to, const FusionLayout& layout) {
  FusionVector e = FusionVector::Zero(layout.size());
  VisitPlain(to, layout, [&](int row, double value) { e[row] = value; });
  VisitPlain(from, layout, [&](int row, double value) { e[row] -= value; });
  e.segment<3>(FusionLayout::kAttitude) =
      LogRotation(from.motion.world_from_imu.conjugate() * to.motion.world_from_imu);
  if (layout.Has(FusionOption::kCameraRotation)) {
    e.segment<3>(layout.At(FusionOption::kCameraRotation)) =
        LogRotation(to.camera_from_imu * from.camera_from_imu.conjugate());
  }
  return e;
}

}  // namespace tbm
