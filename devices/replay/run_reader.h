#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "devices/replay/csv.h"
#include "devices/replay/image_file.h"
#include "pose/base/result.h"
#include "pose/base/time.h"
#include "pose/frame/tilt_history.h"
#include "pose/rig/rig.h"

namespace tbm {

// One row of frames.csv. The file may be missing or damaged: that is found out by ReadFrame and is
// the reason of that one frame, never the end of the run.
struct RecordedFrame {
  Timestamp sensed_at;  // as recorded: may stand still or go back, which the frame solver reports
  std::string file;     // relative to the folder
  int line = 0;
  // Readings of RecordedRun::tilts that were known when the camera box solved this frame; absent in
  // runs that no camera box wrote.
  std::optional<std::size_t> tilts_known;
};

// A run folder (FORMATS §2) without its pixels.
struct RecordedRun {
  std::string folder;
  Rig rig;
  std::vector<RecordedFrame> frames;  // in the order of the file
  // In the order of the file when the camera box recorded it (frames say how many were known), else
  // in the order of time. Angles as the instrument gave them, before the rig's `sign`; not finite
  // where it said nan or inf.
  std::vector<TiltReading> tilts;
  std::string
      solver_state;  // of FrameSolver::BeginRecord at the start; empty when none was recorded
  std::vector<std::string> warnings;  // for the log: what was passed over and why
};

// Reads rig.yaml, frames.csv and tilt.csv.
//
// What makes numbers doubtful is an error that names file, line and column: a missing column or
// file, a wrong count of fields, something that is not a number, a sensor other than target or
// camera. What instruments really send goes on, with a warning: nan or inf angles are kept as
// readings that are not finite, angles of any size are kept. A last line without LF is what a power
// cut leaves: it is dropped with a warning, unless it is a frame's row whose image is there.
Result<RecordedRun, FileFaults> ReadRun(const std::string& folder);

// The pixels of one frame, refused when they are not of the rig's size.
ImageResult ReadFrame(const RecordedRun& run, std::size_t frame);

// The readings to hand to a frame solver before it solves frame after frame: each exactly once, in
// order. With what the camera box knew where that was recorded; else all readings up to
// `look_ahead` after the exposure, so that a tilt can be interpolated from both sides.
class TiltFeed {
 public:
  explicit TiltFeed(const RecordedRun& run, Duration look_ahead = std::chrono::milliseconds(100))
      : run_(run), look_ahead_(look_ahead) {}

  std::span<const TiltReading> Before(std::size_t frame);

 private:
  const RecordedRun& run_;
  Duration look_ahead_;
  std::size_t next_ = 0;
};

// "target", "camera": the word in tilt.csv.
std::string_view SensorWord(TiltSensor sensor);

}  // namespace tbm
