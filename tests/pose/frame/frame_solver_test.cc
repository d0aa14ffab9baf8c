#include "pose/frame/frame_solver.h"

#include <cmath>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "devices/sim/camera_view.h"
#include "devices/sim/world.h"
#include "pose/base/angle.h"
#include "pose/rig/rig_file.h"
#include "tests/support/no_alloc.h"

namespace tbm {
namespace {

// A simulated machine that steps from frame to frame without any clock.
class Machine {
 public:
  explicit Machine(const sim::Faults& faults = {})
      : rig_(LoadRigFile(TBM_SOURCE_DIR "/pose/app/example/rig.yaml").value().rig),
        world_(std::make_shared<const sim::World>(rig_, sim::Motion{}, faults, kBegin)),
        view_(world_, {}),
        pixels_(view_.size_bytes()) {}

  // Time [s] of frame `index` at 10 Hz.
  static Timestamp At(int index) { return {kBegin.ns + 100'000'000ll * (index + 1)}; }

  void Render(int index) { view_.Render(At(index), 5000.0, pixels_.data()); }
  FrameInput Input(int index) const {
    return {At(index),
            {pixels_.data(), view_.width_px(), view_.height_px(), view_.width_px(), 1, 255},
            PoseReason::kNone};
  }
  void AddTilts(int index, FrameSolver& solver) const {
    for (const int offset_ms : {-40, -20, 0, 20}) {
      const Timestamp at = At(index) + std::chrono::milliseconds(offset_ms);
      solver.AddTilt({at, TiltSensor::kTarget, world_->TiltReading(sim::TiltSensor::kTarget, at)});
      solver.AddTilt({at, TiltSensor::kCamera, world_->TiltReading(sim::TiltSensor::kCamera, at)});
    }
  }
  const FrameResult& Step(int index, FrameSolver& solver) {
    Render(index);
    AddTilts(index, solver);
    return solver.Solve(Input(index));
  }
  double HeadErrorM(int index, const FrameResult& result) const {
    const Rigid3 truth = world_->At(At(index)).camera_from_target;
    return (result.points[0].p_in_camera - truth * rig_.points[0].p_point_in_target).norm();
  }
  const Rig& rig() const { return rig_; }

 private:
  static constexpr Timestamp kBegin{1'790'000'000'000'000'000};
  Rig rig_;
  std::shared_ptr<const sim::World> world_;
  sim::CameraView view_;
  std::vector<std::uint8_t> pixels_;
};

TEST(FrameSolver, TouchesNoHeapAfterTheFirstFrame) {
  Machine machine;
  FrameSolver solver(machine.rig());
  machine.Step(0, solver);
  for (int i = 1; i < 5; ++i) {
    machine.Render(i);
    long allocations = 0;
    PoseStatus status = PoseStatus::kNone;
    {
      const test::HeapCounter heap;
      machine.AddTilts(i, solver);
      status = solver.Solve(machine.Input(i)).status;
      allocations = heap.Count();
    }
    EXPECT_EQ(status, PoseStatus::kOk);
    EXPECT_EQ(allocations, 0) << "frame " << i;
  }
}

TEST(FrameSolver, WithoutTiltsAPoseIsDegradedAndSaysWhy) {
  Machine machine;
  FrameSolver solver(machine.rig());
  machine.Render(0);
  const FrameResult& result = solver.Solve(machine.Input(0));
  EXPECT_EQ(result.status, PoseStatus::kDegraded);
  EXPECT_EQ(result.reason, PoseReason::kTiltMissing);
  ASSERT_TRUE(result.pose);
  EXPECT_FALSE(result.pose->tilts_used);
  EXPECT_LT(machine.HeadErrorM(0, result), result.points[0].bound_m.value_or(0.0));
}

TEST(FrameSolver, VisionByChoiceIsNoDegradation) {
  Machine machine;
  FrameSolverOptions options;
  options.method = PoseMethod::kVision;
  FrameSolver solver(machine.rig(), options);
  const FrameResult& result = machine.Step(0, solver);
  EXPECT_EQ(result.status, PoseStatus::kOk);
  ASSERT_TRUE(result.pose);
  EXPECT_FALSE(result.pose->tilts_used);
}

TEST(FrameSolver, RefusesAnImageOfAnotherSize) {
  Machine machine;
  FrameSolver solver(machine.rig());
  machine.Render(0);
  FrameInput input = machine.Input(0);
  input.image.width_px -= 1;
  EXPECT_EQ(solver.Solve(input).reason, PoseReason::kFrameSize);
}

TEST(FrameSolver, NamesTheInclinometerThatJumped) {
  sim::Faults faults;
  faults.tilts.push_back({sim::TiltSensor::kCamera, {DegToRad(4.0), 0.0}, {1.0, 2.0}});
  Machine machine(faults);
  FrameSolver solver(machine.rig());
  for (int i = 0; i < 5; ++i) ASSERT_EQ(machine.Step(i, solver).status, PoseStatus::kOk);
  const FrameResult& result = machine.Step(12, solver);
  EXPECT_EQ(result.reason, PoseReason::kTiltDisagrees);
  EXPECT_EQ(result.tilt_suspect, TiltSensor::kCamera);
  EXPECT_LT(machine.HeadErrorM(12, result), result.points[0].bound_m.value_or(0.0));
}

// 0.05 degree from the 260th frame on: no single frame shows it, the monitor does.
TEST(FrameSolver, AMountingThatMovesDegradesThePoseWithin200Frames) {
  sim::Faults faults;
  faults.tilts.push_back({sim::TiltSensor::kTarget, {DegToRad(0.05), 0.0}, {26.05, 1e9}});
  Machine machine(faults);
  FrameSolver solver(machine.rig());
  int found_at = -1;
  for (int i = 0; i < 460 && found_at < 0; ++i) {
    const FrameResult& result = machine.Step(i, solver);
    ASSERT_TRUE(result.pose) << "frame " << i;
    if (i < 260) {
      ASSERT_EQ(result.status, PoseStatus::kOk) << "frame " << i;
    } else if (result.reason == PoseReason::kMountingMoved) {
      found_at = i;
    }
  }
  ASSERT_GE(found_at, 260);
  EXPECT_LE(found_at, 460);
}

// A recording that begins after the baseline was learned goes on with it.
TEST(FrameSolver, StateOfTheMonitorSurvivesTheRecord) {
  Machine machine;
  FrameSolverOptions options;
  options.monitor.window_frames = 10;
  FrameSolver live(machine.rig(), options);
  for (int i = 0; i < 35; ++i) machine.Step(i, live);
  const std::string state = live.BeginRecord();
  FrameSolver replay(machine.rig(), options);
  ASSERT_TRUE(replay.RestoreState(state));
  for (const TiltSensor sensor : {TiltSensor::kTarget, TiltSensor::kCamera}) {
    for (const auto& entry : live.tilt_history(sensor).entries()) {
      replay.AddTilt({entry.sensed_at, sensor, entry.inclination});
    }
  }
  bool judged = false;
  for (int i = 35; i < 60; ++i) {
    machine.Render(i);
    machine.AddTilts(i, live);
    machine.AddTilts(i, replay);
    const FrameResult a = live.Solve(machine.Input(i));
    const FrameResult b = replay.Solve(machine.Input(i));
    ASSERT_EQ(a.status, b.status);
    ASSERT_EQ(a.pose->pose.camera_from_target.translation,
              b.pose->pose.camera_from_target.translation);
    ASSERT_EQ(a.mounting.change.has_value(), b.mounting.change.has_value());
    if (!a.mounting.change) continue;
    judged = true;
    EXPECT_EQ(a.mounting.change->pitch_rad, b.mounting.change->pitch_rad);
    EXPECT_EQ(a.mounting.change->tail, b.mounting.change->tail);
  }
  EXPECT_TRUE(judged);
}

// The state of a solver that has seen nothing, with the mounting alarm up: the last two words are
// the alarm and "no baseline".
std::string AlarmedState(const std::string& fresh) {
  const std::string without_alarm = " 0 0\n";
  EXPECT_TRUE(fresh.ends_with(without_alarm));
  return fresh.substr(0, fresh.size() - without_alarm.size()) + " 1 0\n";
}

TEST(FrameSolver, TheMountingAlarmStandsUntilAFullWindowSaysOtherwise) {
  Machine machine;
  FrameSolverOptions options;
  options.monitor.window_frames = 10;
  FrameSolver solver(machine.rig(), options);
  ASSERT_TRUE(solver.RestoreState(AlarmedState(solver.BeginRecord())));
  int alarmed = 0;
  while (alarmed < 60 && machine.Step(alarmed, solver).reason == PoseReason::kMountingMoved) {
    ++alarmed;
  }
  EXPECT_GE(alarmed, options.monitor.window_frames - 1);
  EXPECT_LT(alarmed, 60);
}

TEST(FrameSolver, WhatIsWrittenDownIsReadBackWhole) {
  Machine machine;
  FrameSolverOptions options;
  options.monitor.window_frames = 10;
  FrameSolver live(machine.rig(), options);
  const std::string fresh = live.BeginRecord();
  for (int i = 0; i < 25; ++i) machine.Step(i, live);
  const std::string used = live.BeginRecord();
  ASSERT_GT(used.size(), fresh.size());
  FrameSolver other(machine.rig(), options);
  for (const std::string& state : {used, AlarmedState(fresh), fresh}) {
    ASSERT_TRUE(other.RestoreState(state));
    EXPECT_EQ(other.BeginRecord(), state);
  }
}

// Three LEDs without tilts fit several poses: only a pose of just now tells which, and nothing
// checks it, so it must not steer the frames after it.
TEST(FrameSolver, ThreeLedsAloneLeanOnAYoungPoseAndAreNotLeantOn) {
  sim::Faults faults;
  for (const std::size_t led : {0u, 3u}) faults.hidden.push_back({led, {0.15, 1e9}});
  Machine machine(faults);
  FrameSolverOptions options;
  // A shield that hardly moves: what makes the pose useless is its age alone.
  options.motion_sigma_m_per_s = 1e-3;
  options.motion_sigma_rad_per_s = 1e-3;
  for (const int later : {2, 80}) {
    FrameSolver solver(machine.rig(), options);
    ASSERT_EQ(machine.Step(0, solver).status, PoseStatus::kOk);
    machine.Render(later);
    const FrameResult& result = solver.Solve(machine.Input(later));
    EXPECT_EQ(result.pose.has_value(), later == 2)
        << StatusCode(result.status) << " " << ReasonCode(result.reason);
    // The pose that is handed on is still the first one.
    const std::string first = std::to_string(Machine::At(0).ns);
    EXPECT_NE(solver.BeginRecord().find(first), std::string::npos);
  }
}

}  // namespace
}  // namespace tbm
