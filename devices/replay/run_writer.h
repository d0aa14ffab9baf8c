#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "pose/base/pose_reason.h"
#include "pose/base/time.h"
#include "pose/centres/image_view.h"
#include "pose/frame/tilt_history.h"

namespace tbm {

struct RecorderOptions {
  std::string folder;  // runs are made below it, named run_YYYYMMDD_HHMMSS (UTC); made when missing
  std::string rig_yaml;  // the text of the rig file in force, copied into every run
  bool png = false;      // PGM is cheap to write; PNG takes a quarter of the room
  Duration run_max_duration = std::chrono::minutes(10);
  std::int64_t run_max_frames = 10'000;
  // Of all runs in the folder together: beyond it the oldest whole run goes. One run stops at a
  // quarter of it, so that never more than that is lost at once.
  std::int64_t total_max_bytes = 20'000'000'000;
  // Left free on the disk for the rest of the machine: below it recording stops, and goes on when
  // twice as much is free. Recordings are not deleted to make this room.
  std::int64_t free_min_bytes = 500'000'000;
  int sync_every_frames = 10;  // CSV rows reach the disk at least this often
};

enum class RecorderState {
  kIdle,       // no run is open
  kRecording,  // a run is open
  kDiskFull,   // stopped cleanly; goes on by itself when there is room
  kFailed,     // the folder cannot be written: rights, a dead disk; every Begin tries again
};

struct RecorderStatus {
  RecorderState state = RecorderState::kIdle;
  std::string run;                   // folder of the open run, else of the last one
  std::string what;                  // for kDiskFull and kFailed: what failed, on which path
  std::int64_t frames_recorded = 0;  // since construction
  std::int64_t frames_lost = 0;      // came while nothing could be written
  std::int64_t runs_deleted = 0;     // oldest ones, for total_max_bytes
  std::int64_t total_bytes = 0;      // of all runs
};

// Writes recorded runs in the layout of FORMATS §2, file work only: it blocks on the disk and so
// belongs into the recorder's own thread, never into the frame path.
//
// Replay gives the same poses bit for bit when the calls come in the order in which the frame
// solver got the same readings and frames, and Begin gets the solver's state at that point. For
// that frames.csv has one column more, `tilts_known`: how many rows of tilt.csv the solver had by
// then.
//
// What was written before a power cut or a full disk stays readable: a run folder appears under its
// name only with rig and headers complete; an image is on the disk under its name before its row is
// appended; tilt rows are appended before the frame that knows them; rows are appended whole, and a
// row that did not fit is taken back.
class RunWriter {
 public:
  explicit RunWriter(const RecorderOptions& options);
  ~RunWriter();
  RunWriter(RunWriter&&) noexcept;
  RunWriter& operator=(RunWriter&&) noexcept;

  // True when a run should begin before the next reading or frame: none is open (and there is room
  // again), or the open one has reached its limits. The open one goes on until Begin.
  bool WantsNewRun();

  // Closes the open run and opens the next, named after `now`. `solver_state` is
  // FrameSolver::BeginRecord() at this point, or empty. False when it could not: see status().
  bool Begin(Timestamp now, std::string_view solver_state);

  void AddTilt(const TiltReading& reading);

  // False when the frame is not recorded.
  bool AddFrame(Timestamp sensed_at, const ImageView& image);
  // A frame without a usable image: kFrameMissing or kFrameUnreadable. Replays with the same
  // reason.
  bool AddFaultyFrame(Timestamp sensed_at, PoseReason image_fault);

  // Writes what is held back and closes the run.
  void Close();

  const RecorderStatus& status() const;

 private:
  struct Work;
  std::unique_ptr<Work> work_;
};

// An angle [deg] that DegToRad takes back to exactly `angle_rad`, when there is one within a few
// ulp: always for angles that came from degrees, as instruments give them. Else the nearest.
double DegThatReadsAs(double angle_rad);

}  // namespace tbm
