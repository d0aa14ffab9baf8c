#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "pose/solve/integrity.h"
#include "pose/solve/problem.h"

namespace tbm {

struct TiltMonitorOptions {
  // Over how many frames the tilts are compared with the image. 0.05 degree of pitch is then 12
  // sigma at 4 m, 0.1 px and five LEDs; roll more.
  int window_frames = 100;
  int baseline_windows = 2;  // whole windows from the start that teach what "not moved" looks like
  // Chance that one look at a window calls a sound mounting moved. Looks at overlapping windows are
  // hardly independent: 200 in a row cost about as much as 10.
  double false_alarm = 1e-6;
  double outlier_chi2 = 16.0;  // a frame further than this from the window's median does not count
};

// How far image and inclinometers disagree about the vertical, as a small turn about two horizontal
// axes of the camera: `pitch` about its x axis, `roll` about its optical axis, right-handed (x to
// the right, z forward). It is the turn that takes the target's up vector, brought into `camera` by
// vision alone, onto the camera's own. A camera mounting that truly is tilt_from_body Exp(a) shows
// as +a, a target mounting as minus a turned into `camera`: the image knows only the relative
// direction, so which of the two has moved cannot be told here (pose/docs/integrity.md, section 7).
struct MountingOffset {
  double pitch_rad = 0.0;
  double roll_rad = 0.0;
  double pitch_sigma_rad = 0.0;
  double roll_sigma_rad = 0.0;
  double tail = 1.0;  // how rare so large an offset is when nothing has moved
  bool moved = false;
};

// What the monitor has learned as "not moved".
struct TiltBaseline {
  Eigen::Vector2d offset_rad = Eigen::Vector2d::Zero();  // pitch, roll
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();  // [rad^2]
  // How much an error of each LED's centre [px], in the order of the rig, moves the offset [rad].
  Eigen::Matrix<double, 2, 2 * kMaxLeds> by_centres =
      Eigen::Matrix<double, 2, 2 * kMaxLeds>::Zero();
};

struct TiltMonitorReport {
  int frames = 0;  // that counted in the window
  // Against the rig file. Its sigma holds all that the calibration declares, which does not average
  // out: a field calibration may hide 0.05 degree. Empty until the window is full.
  std::optional<MountingOffset> absolute;
  // Against the first baseline_windows windows. What the calibration has wrong is in both and drops
  // out, as far as the same LEDs are seen from the same side. Empty until there is a baseline and a
  // full window after it.
  std::optional<MountingOffset> change;

  bool moved() const { return (absolute && absolute->moved) || (change && change->moved); }
};

// Watches the mountings of the two inclinometers. A value: copy it, keep it, replay it. All its
// memory is taken when it is made.
class TiltMonitor {
 public:
  explicit TiltMonitor(const Rig& rig, const TiltMonitorOptions& options = {});

  // One frame that has a pose, also when its tilts were left out of it. Frames without both tilts
  // or with fewer than three LEDs used say nothing and change nothing. No heap.
  const TiltMonitorReport& Add(const PoseProblem& problem, const CheckedPose& checked);
  const TiltMonitorReport& report() const { return report_; }

  // Forgets everything: after an inclinometer was bolted on anew or the target was moved to another
  // part of the image.
  void Restart();

  // What was learned; empty while it is being learned.
  std::optional<TiltBaseline> baseline() const;

  // Forgets the window, and takes `baseline` instead of learning one. Two monitors that were
  // restarted with the same baseline and see the same frames say the same.
  void Restart(const std::optional<TiltBaseline>& baseline);

 private:
  static constexpr int kCentreRows = 2 * kMaxLeds;
  using ByCentres = decltype(TiltBaseline::by_centres);

  // (pitch, roll) of one frame.
  struct Sighting {
    Eigen::Vector2d offset_rad = Eigen::Vector2d::Zero();
    Eigen::Matrix2d information = Eigen::Matrix2d::Zero();  // of what differs from frame to frame
    ByCentres by_centres = ByCentres::Zero();
  };
  // Of several frames: information-weighted sums.
  struct Mean {
    Eigen::Vector2d offset_rad = Eigen::Vector2d::Zero();
    Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
    ByCentres by_centres = ByCentres::Zero();
    int frames = 0;
  };

  std::optional<Sighting> See(const PoseProblem& problem, const CheckedPose& checked) const;
  std::optional<Mean> MeanOfWindow();
  Eigen::Vector2d MedianOfWindow();
  void Learn(const Mean& mean);
  MountingOffset Judge(const Eigen::Vector2d& offset_rad, const Eigen::Matrix2d& covariance) const;

  TiltMonitorOptions options_;
  Rig noise_only_rig_;  // the rig without declared sigmas
  std::vector<Sighting> window_;
  std::vector<double> scratch_;
  int seen_ = 0;
  TiltBaseline baseline_;
  int baseline_windows_ = 0;
  int baseline_complete_at_ = 0;
  TiltMonitorReport report_;
};

}  // namespace tbm
