#include <cmath>
#include <filesystem>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "guidance/app/calibrate_command.h"
#include "guidance/app/calibrate_input.h"
#include "guidance/app/calibrate_plot.h"
#include "guidance/app/calibrate_report.h"
#include "guidance/app/output_file.h"
#include "pose/calibrate/camera_calibration.h"

namespace tbm {
namespace {

// "camera.yaml" -> "camera_coverage.png"
std::string CoverageName(const CalibrateCameraRequest& request) {
  if (!request.coverage.empty() || request.out == "-") return request.coverage;
  std::filesystem::path path = request.out;
  const std::string stem = path.stem().string();
  return path.replace_filename(stem + "_coverage.png").string();
}

bool HasObstacle(const CalibrateCameraRequest& request, const Console& console) {
  for (const std::string* path : {&request.out, &request.picture, &request.coverage}) {
    if (path->empty() && path != &request.out) continue;
    if (const auto obstacle = OutputFile(*path, request.force).Obstacle()) {
      Complain(console, *obstacle);
      return true;
    }
  }
  return false;
}

// Why there is no calibration, with the numbers that decided and the pictures that do not fit.
std::string Explain(const CameraCalibrationFailure& failure, const FoundBoards& boards) {
  std::string text = Advice(failure);
  if (std::isfinite(failure.residual_px)) {
    text += fmt::format(" (residual {:.2f} px", failure.residual_px);
    if (std::isfinite(failure.focal_sigma)) {
      text += fmt::format(", focal length to {:.2g} %", 100.0 * failure.focal_sigma);
    }
    text += ")";
  }
  for (const std::size_t index : failure.left_out) {
    text += "; " + boards.pictures[index].name + " does not fit the others";
  }
  return text;
}

ExitCode Refuse(const CalibrateCameraRequest& request,
                const CameraCalibrationFailure& failure,
                const FoundBoards& boards,
                const Console& console) {
  Complain(console, request.folder + ": no calibration: " + Explain(failure, boards));
  const std::string path = CoverageName(request);
  if (path.empty()) return ExitCode::kBadInput;
  if (const auto fault = DrawCoverage(failure.coverage, boards, path, request.force)) {
    Complain(console, *fault);
  } else {
    Complain(console, path + " shows where points were seen and what is missing");
  }
  return ExitCode::kBadInput;
}

std::optional<FoundBoards> Boards(const CalibrateCameraRequest& request,
                                  const Board& board,
                                  const Console& console) {
  const auto names = PictureNames(request.folder);
  if (!names) {
    Complain(console, names.error());
    return std::nullopt;
  }
  auto boards = FindBoards(request.folder, *names, board, {}, console);
  if (!boards) {
    Complain(console, boards.error());
    return std::nullopt;
  }
  for (const std::string& what : boards->not_found) Complain(console, "warning: " + what);
  return std::move(boards).value();
}

std::optional<std::string> WriteAll(const CalibrateCameraRequest& request,
                                    const CameraCalibration& found,
                                    const FoundBoards& boards) {
  if (!request.picture.empty()) {
    if (auto fault = DrawResiduals(found, boards, request.picture, request.force)) return fault;
  }
  if (!request.coverage.empty()) {
    if (auto fault = DrawCoverage(found.coverage, boards, request.coverage, request.force)) {
      return fault;
    }
  }
  return OutputFile(request.out, request.force).Write(CameraYaml(found, boards, request.board));
}

}  // namespace

ExitCode RunCalibrateCamera(const CalibrateCameraRequest& request, const Console& console) {
  const auto board = BoardOf(request.board, console);
  if (!board || HasObstacle(request, console)) return ExitCode::kBadInput;
  const auto boards = Boards(request, *board, console);
  if (!boards) return ExitCode::kBadInput;
  if (board->kind != BoardKind::kChessboard && !board->diameter_m) {
    Complain(console,
             "warning: --board has no diameter of the circles; what the middle of a tilted circle "
             "is off stays in the result");
  }
  CameraCalibrationOptions options;
  options.with_k3 = request.with_k3;
  const auto found = CalibrateCamera(
      *board, boards->pixels_px, boards->size.width_px, boards->size.height_px, options);
  if (!found) return Refuse(request, found.error(), *boards, console);
  if (const auto fault = WriteAll(request, *found, *boards)) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  if (request.out != "-") console.out << CameraSummary(*found, *boards);
  return ExitCode::kDone;
}

}  // namespace tbm
