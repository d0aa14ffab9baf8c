#include "guidance/app/solve_command.h"

#include <algorithm>
#include <array>
#include <deque>
#include <functional>
#include <future>
#include <map>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "devices/replay/run_reader.h"
#include "guidance/app/output_file.h"
#include "guidance/app/pose_rows.h"
#include "pose/frame/frame_solver.h"
#include "pose/solve/penalty_pose.h"

namespace tbm {
namespace {

// Decodes images ahead of the solver, which has to take them one after the other.
class FrameLoader {
 public:
  FrameLoader(const RecordedRun& run, int threads)
      : run_(run),
        ahead_(threads > 0 ? static_cast<std::size_t>(threads)
                           : std::max(1u, std::thread::hardware_concurrency())) {}

  ImageResult Next() {
    while (asked_ < run_.frames.size() && waiting_.size() < ahead_) {
      waiting_.push_back(std::async(std::launch::async,
                                    [this, frame = asked_] { return ReadFrame(run_, frame); }));
      ++asked_;
    }
    ImageResult image = waiting_.front().get();
    waiting_.pop_front();
    return image;
  }

 private:
  const RecordedRun& run_;
  const std::size_t ahead_;
  std::size_t asked_ = 0;
  std::deque<std::future<ImageResult>> waiting_;
};

PoseResult Published(const PoseProblem& problem,
                     const std::optional<Rigid3>& start,
                     const SolveOptions& options) {
  return PenaltyPose(problem, start, options);
}

using FrameSink = std::function<void(const FrameResult&)>;

void SolveFrames(const RecordedRun& run,
                 const SolveRequest& request,
                 const Console& console,
                 const FrameSink& sink) {
  FrameSolverOptions options;
  options.method = request.method;
  FrameSolver solver(run.rig, options, Published);
  if (!run.solver_state.empty() && !solver.RestoreState(run.solver_state)) {
    Complain(console,
             run.folder + "/solver_state.txt: is damaged or of another version; starting afresh");
  }
  TiltFeed tilts(run, options.tilt.max_age);
  FrameLoader images(run, request.threads);
  Progress progress(console, "solving", run.frames.size());
  for (std::size_t i = 0; i < run.frames.size(); ++i) {
    progress.Show(i);
    for (const TiltReading& reading : tilts.Before(i)) solver.AddTilt(reading);
    const ImageResult image = images.Next();
    FrameInput frame;
    frame.sensed_at = run.frames[i].sensed_at;
    if (image) {
      frame.image = image->View();
    } else {
      frame.image_fault = ReasonOf(image.error().failure);
      Complain(console,
               fmt::format("{}/frames.csv:{}: {}: {}",
                           run.folder,
                           run.frames[i].line,
                           run.frames[i].file,
                           image.error().what));
    }
    sink(solver.Solve(frame));
  }
}

// How many frames ended how, for the one who started it: the CSV is read later.
class Tally {
 public:
  void Count(const FrameResult& result) {
    ++statuses_[static_cast<std::size_t>(result.status)];
    if (result.reason != PoseReason::kNone) {
      ++reasons_[fmt::format("{}:{}", StatusCode(result.status), ReasonCode(result.reason))];
    }
  }
  std::string Text() const {
    std::string text =
        fmt::format("{} ok, {} degraded, {} none", statuses_[0], statuses_[1], statuses_[2]);
    for (const auto& [reason, count] : reasons_) text += fmt::format("\n  {:4} {}", count, reason);
    return text;
  }

 private:
  std::array<int, 3> statuses_{};
  std::map<std::string, int> reasons_;
};

Result<RecordedRun, FileFaults> OpenRun(const SolveRequest& request, const Console& console) {
  auto run = ReadRun(request.run);
  if (!run) {
    Complain(console, run.error());
    return run;
  }
  for (const std::string& warning : run->warnings) Complain(console, "warning: " + warning);
  return run;
}

ExitCode WriteOut(const OutputFile& out, const std::string& text, const Console& console) {
  const auto fault = out.Write(text);
  if (!fault) return ExitCode::kDone;
  Complain(console, *fault);
  return ExitCode::kBadInput;
}

// Solves the run's frames one by one into `sink`; then writes what `text` makes of them, whole or
// not at all.
ExitCode SolveToFile(const SolveRequest& request,
                     const Console& console,
                     const std::function<void(const Rig&, const FrameResult&)>& sink,
                     const std::function<std::string(const Rig&)>& text) {
  const OutputFile out(request.out, request.force);
  if (const auto obstacle = out.Obstacle()) {
    Complain(console, *obstacle);
    return ExitCode::kBadInput;
  }
  const auto run = OpenRun(request, console);
  if (!run) return ExitCode::kBadInput;
  SolveFrames(*run, request, console, [&](const FrameResult& result) { sink(run->rig, result); });
  return WriteOut(out, text(run->rig), console);
}

}  // namespace

ExitCode RunSolve(const SolveRequest& request, const Console& console) {
  std::vector<std::vector<std::string>> rows;
  Tally tally;
  const ExitCode code = SolveToFile(
      request,
      console,
      [&](const Rig& rig, const FrameResult& result) {
        rows.push_back(PoseValues(rig, result));
        tally.Count(result);
      },
      [&](const Rig& rig) {
        const auto columns = PoseColumns(rig);
        return request.as_json ? TableAsJson(columns, rows) : TableAsCsv(columns, rows);
      });
  if (code == ExitCode::kDone && console.err_is_terminal) {
    console.err << fmt::format("{}: {} frames: {}\n", request.out, rows.size(), tally.Text());
  }
  return code;
}

ExitCode RunCentres(const SolveRequest& request, const Console& console) {
  std::string text = CentreHeader();
  return SolveToFile(
      request,
      console,
      [&](const Rig& rig, const FrameResult& result) { text += CentreRows(rig, result); },
      [&](const Rig&) { return text; });
}

}  // namespace tbm
