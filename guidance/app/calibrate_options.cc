#include "guidance/app/calibrate_options.h"

#include <CLI/CLI.hpp>

namespace tbm {
namespace {

constexpr const char* kCalibrateHelp =
    "A board is KIND:COLUMNSxROWS:PITCH_MM\n"
    "  chessboard:9x6:25            inner corners in a row, rows, mm from corner to corner\n"
    "  circles:7x5:30:12            with the diameter, which takes out what a tilted circle's "
    "middle "
    "is off\n"
    "  asymmetric_circles:4x11:20:14   every second row moved aside by the pitch\n"
    "\n"
    "Examples\n"
    "  tbm calibrate camera pictures --board chessboard:9x6:25 --out camera.yaml\n"
    "  tbm calibrate tilt rig --board chessboard:9x6:25 --camera camera.yaml --out tilt.yaml";

constexpr const char* kCameraHelp =
    "FOLDER holds grey pictures (PNG, PGM, TIFF) of one board, all by the same camera, not "
    "refocused.\n"
    "About twenty: the board half as wide as the image, into each of its corners and edges, tilted "
    "by 20\n"
    "to 40 degrees to all four sides, some turned. --out gets the camera part of a rig file, with "
    "the sigma\n"
    "of each number. When parts of the image have no points, or the board is never tilted, there "
    "is "
    "no\n"
    "calibration but a picture of what is missing, and exit code 2.\n"
    "\n"
    "Example\n"
    "  tbm calibrate camera pictures --board chessboard:9x6:25 --out camera.yaml --picture "
    "residuals.png";

constexpr const char* kTiltHelp =
    "FOLDER holds pictures of a board that does not move, and tilt.csv: image,beta_deg,gamma_deg "
    "(optional\n"
    "sigma_deg), what the inclinometer read while each was taken. Twelve placements of the rig, "
    "tilted by\n"
    "15 degrees about both axes and turned by 90 degrees or more about the plumb line; --up spares "
    "the\n"
    "turning. What motion is missing is said, with exit code 2.\n"
    "\n"
    "Example\n"
    "  tbm calibrate tilt rig --board chessboard:9x6:25 --camera camera.yaml --out tilt.yaml";

void AddCamera(CLI::App* calibrate, CalibrateCameraRequest& request) {
  CLI::App* camera = calibrate->add_subcommand("camera", "Camera from pictures of a board");
  camera->footer(kCameraHelp);
  camera->add_option("FOLDER", request.folder, "folder of pictures")->required();
  camera->add_option("--board,-b", request.board, "KIND:COLUMNSxROWS:PITCH_MM")->required();
  camera->add_option("--out,-o", request.out, "file to write; - is the standard output")
      ->required();
  camera->add_option("--picture", request.picture, "PNG of the residuals");
  camera->add_option("--coverage", request.coverage, "PNG of where in the image points were seen");
  camera->add_flag("--k3", request.with_k3, "estimate k3 as well: lenses beyond 90 degrees");
  camera->add_flag("--force,-f", request.force, "replace existing files");
}

void AddTilt(CLI::App* calibrate, CalibrateTiltRequest& request) {
  CLI::App* tilt = calibrate->add_subcommand("tilt", "How an inclinometer is built to the camera");
  tilt->footer(kTiltHelp);
  tilt->add_option("FOLDER", request.folder, "folder of pictures and tilt.csv")->required();
  tilt->add_option("--board,-b", request.board, "KIND:COLUMNSxROWS:PITCH_MM")->required();
  tilt->add_option("--camera,-c", request.camera, "the camera's file, or a rig file")->required();
  tilt->add_option("--out,-o", request.out, "file to write; - is the standard output")->required();
  tilt->add_option("--sigma-deg", request.sigma_deg, "of one reading of the inclinometer")
      ->check(CLI::Range(1e-6, 10.0))
      ->capture_default_str();
  tilt->add_option(
          "--sign", request.sign, "of beta and gamma, +1 or -1: what a rig file calls sign")
      ->expected(2)
      ->check(CLI::IsMember({-1.0, 1.0}));
  tilt->add_option(
          "--up", request.up_in_board, "x y z of up in the board's frame, where it is known")
      ->expected(3);
  tilt->add_option("--up-sigma-deg", request.up_sigma_deg, "of that direction")
      ->check(CLI::Range(1e-6, 10.0))
      ->capture_default_str();
  tilt->add_flag("--force,-f", request.force, "replace an existing file");
}

}  // namespace

CLI::App* AddCalibrate(CLI::App& app, CalibrateRequests& requests) {
  CLI::App* calibrate =
      app.add_subcommand("calibrate", "Cameras and inclinometers from pictures of a board");
  calibrate->footer(kCalibrateHelp);
  calibrate->require_subcommand(1);
  AddCamera(calibrate, requests.camera);
  AddTilt(calibrate, requests.tilt);
  return calibrate;
}

ExitCode RunCalibrate(const CLI::App& calibrate,
                      const CalibrateRequests& requests,
                      const Console& console) {
  return calibrate.got_subcommand("camera") ? RunCalibrateCamera(requests.camera, console)
                                            : RunCalibrateTilt(requests.tilt, console);
}

}  // namespace tbm
