#pragma once

#include <algorithm>

#include "pose/solve/tilt_monitor.h"
#include "tests/pose/solve/faults.h"

namespace tbm::test {

enum class Body { kNone, kCamera, kTarget };

// What happens to the mountings in one run of a machine that creeps and trembles around one place.
struct Story {
  Body body = Body::kNone;
  Eigen::Vector3d turn_deg = Eigen::Vector3d::Zero();  // about the axes of `camera`
  int from_frame = 300;
  int over_frames = 1;     // 1: a knock; more: it creeps
  double outliers = 0.0;   // share of frames with a tilt reading up to 4 degrees off
  bool loses_led = false;  // P5 is covered from `from_frame` on
  int frames = 500;
};

struct Heard {
  int absolute_at = -1;  // first frame that said so; -1 never
  int change_at = -1;
  TiltMonitorReport last;
};

// The mounting turned in its body, by the turn seen in `camera`.
inline void Turn(const Story& story, int frame, const Rigid3& camera_from_target, Rig& rig) {
  if (story.body == Body::kNone || frame < story.from_frame) return;
  const double share =
      std::min(1.0, static_cast<double>(frame - story.from_frame + 1) / story.over_frames);
  Eigen::Vector3d turn_rad = share * story.turn_deg * DegToRad(1.0);
  if (story.body == Body::kTarget) {
    turn_rad = camera_from_target.rotation.conjugate() * turn_rad;
  }
  TiltMount& mount = story.body == Body::kCamera ? rig.camera_tilt : rig.target_tilt;
  mount.tilt_from_body = mount.tilt_from_body * ExpRotation(turn_rad).toRotationMatrix();
}

inline Heard Listen(const Rig& rig, const Story& story, Random& random) {
  const AsBuilt sound = DrawAsBuilt(rig, random);
  const Truth place = DrawTruth(random, TruthRange{});
  TiltMonitor monitor(rig);
  Heard heard;
  for (int frame = 0; frame < story.frames; ++frame) {
    Truth truth = place;
    PoseError tremble;
    tremble << random.Normal3(3e-4), random.Normal3(5e-4);
    truth.camera_from_target = Moved(place.camera_from_target, tremble);
    AsBuilt built = sound;
    Turn(story, frame, truth.camera_from_target, built.rig);
    PoseProblem problem = Observe(built, rig, truth, kCentreSigmaPx, kTiltSigmaRad, random);
    if (random.Unit() < story.outliers) {
      DisplaceOneTilt(problem, DegToRad(random.Uniform(0.1, 4.0)), random);
    }
    if (story.loses_led && frame >= story.from_frame) problem.leds.erase(4);
    const auto checked = CheckPose(problem, std::nullopt, std::nullopt);
    if (!checked) continue;
    const TiltMonitorReport& report = monitor.Add(problem, *checked);
    const bool absolute = report.absolute && report.absolute->moved;
    const bool change = report.change && report.change->moved;
    if (absolute && heard.absolute_at < 0) heard.absolute_at = frame;
    if (change && heard.change_at < 0) heard.change_at = frame;
  }
  heard.last = monitor.report();
  return heard;
}

inline Rig CalibratedRig() {
  Rig rig = FieldRig();
  DeclareFieldSigmas(rig);
  return rig;
}

}  // namespace tbm::test
