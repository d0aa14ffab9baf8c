#pragma once

#include <chrono>
#include <variant>
#include <vector>

#include <gtest/gtest.h>

#include "guidance/core/guidance_core.h"
#include "tests/support/drive.h"

namespace tbm::test {

using std::chrono::milliseconds;
using std::chrono::seconds;

inline const GuidedMachine& TheMachine() {
  static const GuidedMachine machine = ExampleMachine();
  return machine;
}

inline std::vector<GuidanceInput> Later(std::vector<GuidanceInput> inputs, Duration by) {
  for (GuidanceInput& input : inputs) {
    std::visit(
        [&](auto& one) {
          if constexpr (requires { one.sensed_at; }) one.sensed_at = one.sensed_at + by;
        },
        input);
  }
  return inputs;
}
template <class Kind>
std::vector<GuidanceInput> Only(const std::vector<GuidanceInput>& inputs) {
  std::vector<GuidanceInput> some;
  for (const GuidanceInput& input : inputs) {
    if (std::holds_alternative<Kind>(input)) some.push_back(input);
  }
  return some;
}
template <class Kind>
std::vector<GuidanceInput> Without(const std::vector<GuidanceInput>& inputs) {
  std::vector<GuidanceInput> some;
  for (const GuidanceInput& input : inputs) {
    if (!std::holds_alternative<Kind>(input)) some.push_back(input);
  }
  return some;
}

// A machine that stands still: one round of readings, and the core that got it.
class Core : public testing::Test {
 protected:
  Core() : drive_(TheMachine(), {}, "guidance core") {
    drive_.Measure(2100.0);
    round_ = drive_.inputs();
    at_ = drive_.now();
  }

  const Snapshot& Begin() {
    core_.Advance(round_, at_);
    begun_with_s_ = core_.snapshot().station.age_s.value_or(0.0);
    return core_.snapshot();
  }
  // What keeps coming while one source is silent: the camera's poses, every five seconds.
  const Snapshot& CameraGoesOn(Duration after) {
    const auto live = Without<SetUpKnown>(Without<PrismSeen>(round_));
    while (went_on_ + seconds(5) < after) {
      went_on_ += seconds(5);
      core_.Advance(Later(live, went_on_), at_ + went_on_);
    }
    went_on_ = after;
    return core_.Advance(Later(live, after), at_ + after);
  }
  // The target comes nearer to the camera by so much along the shield's x axis.
  static std::vector<GuidanceInput> Closed(std::vector<GuidanceInput> inputs, double closed_m) {
    const Rigid3& rear_from_camera = TheMachine().machine.geometry.rear_shield_from_camera.b_from_a;
    for (GuidanceInput& input : inputs) {
      if (auto* pose = std::get_if<RelativeSeen>(&input)) {
        pose->camera_from_target.b_from_a.translation +=
            rear_from_camera.rotation.conjugate() * Eigen::Vector3d(-closed_m, 0.0, 0.0);
      }
    }
    return inputs;
  }
  const Snapshot& StationGoesOn(Duration after) {
    return core_.Advance(Later(Without<RelativeSeen>(round_), after), at_ + after);
  }
  // The round again, later, and everything seen 30 mm further east: the pillar was knocked.
  std::vector<GuidanceInput> Knocked(Duration after) const {
    auto knocked = Later(Without<SetUpKnown>(round_), after);
    for (GuidanceInput& input : knocked) {
      if (auto* prism = std::get_if<PrismSeen>(&input)) prism->p_in_site.x() += 0.03;
    }
    return knocked;
  }
  SetUpKnown SuspectSince(Timestamp last_good) const {
    SetUpKnown set_up = std::get<SetUpKnown>(Only<SetUpKnown>(round_).front());
    set_up.trusted_until = last_good;
    return set_up;
  }
  const PointState& Cutter() const {
    return core_.snapshot().points[TheMachine().machine.steer_by];
  }
  AlarmState StateOf(GuidanceAlarm alarm) const {
    return core_.alarms().alarm(static_cast<std::size_t>(alarm)).state;
  }
  void Answer(GuidanceAlarm alarm, Timestamp now) {
    core_.Advance(std::vector<GuidanceInput>{AlarmOrder{static_cast<std::size_t>(alarm)}}, now);
  }

  Drive drive_;
  std::vector<GuidanceInput> round_;
  Timestamp at_;
  Duration went_on_{};
  double begun_with_s_ = 0.0;  // age of the first fix
  GuidanceCore core_{TheMachine().machine, TheMachine().rig, TheMachine().axis};
};

}  // namespace tbm::test
