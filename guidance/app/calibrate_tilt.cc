#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "guidance/app/calibrate_command.h"
#include "guidance/app/calibrate_input.h"
#include "guidance/app/calibrate_report.h"
#include "guidance/app/output_file.h"
#include "guidance/config/camera_file.h"
#include "pose/base/angle.h"
#include "pose/calibrate/board_pose.h"
#include "pose/calibrate/tilt_rotation.h"

namespace tbm {
namespace {

// A picture whose residual is so many times the median shows another board, or one in motion.
constexpr double kBadPicture = 3.0;

struct Placed {
  std::string name;
  BoardPose pose;
  CalibrationTilt tilt;
};

struct Placements {
  std::vector<Placed> placed;
  double residual_px = 0.0;
};

std::optional<CameraModel> Camera(const std::string& file, const Console& console) {
  const auto camera = LoadCameraFile(file);
  if (camera) return *camera;
  for (const RigFileFault& fault : camera.error()) Complain(console, fault.Text());
  return std::nullopt;
}

std::optional<std::vector<CalibrationTilt>> Tilts(const CalibrateTiltRequest& request,
                                                  const Console& console) {
  const std::string file = request.folder + "/tilt.csv";
  auto text = ReadTextFile(file, 1 << 20);
  if (!text) {
    Complain(console, text.error().Text());
    return std::nullopt;
  }
  auto tilts = ParseCalibrationTilts(std::move(text).value(),
                                     file,
                                     kTiltOfPicture,
                                     request.sigma_deg,
                                     request.sign[0],
                                     request.sign[1]);
  if (tilts) return std::move(tilts).value();
  Complain(console, tilts.error());
  return std::nullopt;
}

double Rms_px(const BoardPose& pose) {
  return std::sqrt(pose.sum_px2 / (2.0 * static_cast<double>(pose.residuals_px.size())));
}

double MedianRms_px(const std::vector<Placed>& placed) {
  std::vector<double> rms_px;
  for (const Placed& one : placed) rms_px.push_back(Rms_px(one.pose));
  std::nth_element(rms_px.begin(),
                   rms_px.begin() + static_cast<std::ptrdiff_t>(rms_px.size() / 2),
                   rms_px.end());
  return rms_px[rms_px.size() / 2];
}

// Where the board stood in each picture; what cannot be used is said and left out.
Placements Place(const FoundBoards& boards,
                 const std::vector<CalibrationTilt>& tilts,
                 const Board& board,
                 const CameraModel& camera,
                 const Console& console) {
  Placements placements;
  std::vector<Placed> all;
  for (std::size_t i = 0; i < boards.pictures.size(); ++i) {
    const FoundPicture& picture = boards.pictures[i];
    const auto pose = PlaceBoard(board, boards.pixels_px[i], camera);
    if (pose) {
      all.push_back({picture.name, *pose, tilts[picture.index]});
    } else {
      Complain(console, fmt::format("warning: {}: left out: {}", picture.name, Text(pose.error())));
    }
  }
  if (all.empty()) return placements;
  const double most_px = kBadPicture * MedianRms_px(all);
  double sum_px2 = 0.0;
  int dof = 0;
  for (Placed& one : all) {
    if (Rms_px(one.pose) > most_px) {
      Complain(
          console,
          fmt::format("warning: {}: left out: its points are {:.2f} px off, the others' {:.2f}",
                      one.name,
                      Rms_px(one.pose),
                      most_px / kBadPicture));
      continue;
    }
    sum_px2 += one.pose.sum_px2;
    dof += one.pose.dof;
    placements.placed.push_back(std::move(one));
  }
  placements.residual_px = std::sqrt(sum_px2 / dof);
  return placements;
}

// Sigma of the camera's attitude to the board per axis: about all three, or, once it is known where
// up is, about the two that move up.
double CameraSigma_rad(const Placed& one, double residual_px, const TiltRotation* known) {
  const Eigen::Matrix3d turn = residual_px * residual_px * one.pose.cofactor.topLeftCorner<3, 3>();
  if (known == nullptr) return std::sqrt(turn.trace() / 3.0);
  const Eigen::Vector3d up = known->camera_from_housing * one.tilt.up_in_housing;
  return std::sqrt((turn.trace() - up.dot(turn * up)) / 2.0);
}

Result<TiltRotation, TiltRotationFailure> Solve(const Placements& placements,
                                                const TiltRotationOptions& options,
                                                const TiltRotation* known) {
  std::vector<TiltPlacement> list;
  for (const Placed& one : placements.placed) {
    list.push_back({one.pose.camera_from_board.rotation.toRotationMatrix(),
                    one.tilt.up_in_housing,
                    CameraSigma_rad(one, placements.residual_px, known),
                    one.tilt.sigma_rad});
  }
  return FindTiltRotation(list, options);
}

// One picture whose reading measuring does not explain; some cannot be told apart.
std::string WrongReading(const WrongTilt& wrong, const Placements& placements) {
  const double off_deg = RadToDeg(wrong.off_rad);
  const double sigma_deg = RadToDeg(wrong.sigma_rad);
  const std::string& name = placements.placed[wrong.placement].name;
  if (wrong.or_rather.empty()) {
    return fmt::format(
        "{}: the reading is {:.3f} degrees from where all other pictures put it, and measuring "
        "explains {:.3f}",
        name,
        off_deg,
        sigma_deg);
  }
  std::string names = name;
  for (const std::size_t other : wrong.or_rather) names += ", " + placements.placed[other].name;
  return fmt::format(
      "{}: one of these readings is {:.3f} degrees off, and measuring explains {:.3f}",
      names,
      off_deg,
      sigma_deg);
}

void Explain(const TiltRotationFailure& failure,
             const Placements& placements,
             const CalibrateTiltRequest& request,
             const Console& console) {
  std::string text = fmt::format("{}: no calibration: {} ({} placements",
                                 request.folder,
                                 MissingMotion(failure.fault),
                                 placements.placed.size());
  if (failure.fault == TiltRotationFault::kNoRotation) {
    text += fmt::format(
        ", which contradict one another {:.1f} times as much as --sigma-deg and the pictures "
        "explain",
        failure.sigma_factor);
    // A grosser error turns the rotation so far that others look worst.
    constexpr double kMostTold_deg = 5.0;
    const WrongTilt& worst = failure.wrong[0];
    if (RadToDeg(worst.off_rad) < kMostTold_deg) {
      text += fmt::format(", {} most, by {:.3f} degrees",
                          placements.placed[worst.placement].name,
                          RadToDeg(worst.off_rad));
    }
  } else if (failure.fault == TiltRotationFault::kDoesNotFit) {
    for (const WrongTilt& wrong : failure.wrong) {
      Complain(console, request.folder + "/" + WrongReading(wrong, placements));
    }
  } else if (std::isfinite(failure.sigma_rad)) {
    text += fmt::format(", sigma would be {:.2f} degrees", RadToDeg(failure.sigma_rad));
  }
  Complain(console, text + ")");
}

void WarnOfScatter(const TiltResult& result,
                   const CalibrateTiltRequest& request,
                   const Console& console) {
  const double factor = result.rotation.sigma_factor;
  if (factor == 1.0) return;
  Complain(console,
           fmt::format("warning: {}: readings and pictures differ {:.1f} times as much as "
                       "--sigma-deg and the board's residual explain; the sigma of the mounting is "
                       "that much larger",
                       request.folder,
                       factor));
}

// What a rig file is to say of one reading.
double LargestSigma_deg(const Placements& placements) {
  double largest_rad = 0.0;
  for (const Placed& one : placements.placed) {
    largest_rad = std::max(largest_rad, one.tilt.sigma_rad);
  }
  return RadToDeg(largest_rad);
}

std::optional<TiltRotationOptions> Options(const CalibrateTiltRequest& request,
                                           const Console& console) {
  TiltRotationOptions options;
  if (request.up_in_board.size() != 3) return options;
  const Eigen::Vector3d up(request.up_in_board[0], request.up_in_board[1], request.up_in_board[2]);
  if (!up.allFinite() || !(up.norm() > 1e-6) || !(up.norm() < 1e6)) {
    Complain(console, "--up must be three numbers, not all 0: x y z of up in the board's frame");
    return std::nullopt;
  }
  options.up_in_board = up.normalized();
  options.up_sigma_rad = DegToRad(request.up_sigma_deg);
  return options;
}

bool CanBeUsed(const Board& board, const CalibrateTiltRequest& request, const Console& console) {
  if (!LooksTheSameTurned(board)) return true;
  Complain(console,
           fmt::format("--board {}: looks the same when turned by 180 degrees, so nobody can tell "
                       "how it stands; take a chessboard with an odd and an even number of corners "
                       "(9x6), or asymmetric circles with an odd number of rows (4x11)",
                       Quoted(request.board)));
  return false;
}

std::optional<FoundBoards> Boards(const CalibrateTiltRequest& request,
                                  const std::vector<CalibrationTilt>& tilts,
                                  const Board& board,
                                  const CameraModel& camera,
                                  const Console& console) {
  std::vector<std::string> names;
  for (const CalibrationTilt& tilt : tilts) names.push_back(tilt.name);
  auto boards = FindBoards(request.folder,
                           names,
                           board,
                           ImageSize{camera.image_width_px, camera.image_height_px},
                           console);
  if (!boards) {
    Complain(console, boards.error());
    return std::nullopt;
  }
  for (const std::string& what : boards->not_found) Complain(console, "warning: " + what);
  return std::move(boards).value();
}

}  // namespace

ExitCode RunCalibrateTilt(const CalibrateTiltRequest& request, const Console& console) {
  const auto board = BoardOf(request.board, console);
  if (!board || !CanBeUsed(*board, request, console)) return ExitCode::kBadInput;
  const auto options = Options(request, console);
  if (!options) return ExitCode::kBadInput;
  const OutputFile out(request.out, request.force);
  if (const auto obstacle = out.Obstacle()) {
    Complain(console, *obstacle);
    return ExitCode::kBadInput;
  }
  const auto camera = Camera(request.camera, console);
  if (!camera) return ExitCode::kBadInput;
  const auto tilts = Tilts(request, console);
  if (!tilts) return ExitCode::kBadInput;
  const auto boards = Boards(request, *tilts, *board, *camera, console);
  if (!boards) return ExitCode::kBadInput;

  const Placements placements = Place(*boards, *tilts, *board, *camera, console);
  TiltRotationOptions roughly = *options;
  roughly.takes_misfits = true;
  auto rotation = Solve(placements, roughly, nullptr);
  if (rotation) {
    const TiltRotation first = *rotation;
    rotation = Solve(placements, *options, &first);
  }
  if (!rotation) {
    Explain(rotation.error(), placements, request, console);
    return ExitCode::kBadInput;
  }
  std::vector<std::string> names;
  for (const Placed& one : placements.placed) names.push_back(one.name);
  const TiltResult result{*rotation,
                          LargestSigma_deg(placements),
                          request.sign,
                          std::move(names),
                          placements.residual_px,
                          *camera,
                          options->up_in_board.has_value()};
  WarnOfScatter(result, request, console);
  if (const auto fault = out.Write(TiltYaml(result))) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  if (request.out != "-") console.out << TiltSummary(result);
  return ExitCode::kDone;
}

}  // namespace tbm
