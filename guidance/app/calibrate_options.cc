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
    "  tbm calibrate tilt table --board chessboard:9x6:25 --camera camera.yaml --out tilt.yaml\n"
    "  tbm calibrate target placements --nominal drawing.csv --out target.yaml\n"
    "  tbm calibrate rig --camera camera.yaml --tilt tilt.yaml --target target.yaml --points "
    "points.yaml --out rig.yaml\n"
    "  tbm calibrate imu run_0412 --out rail.yaml";

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
    "  tbm calibrate tilt table --board chessboard:9x6:25 --camera camera.yaml --out tilt.yaml";

constexpr const char* kTargetHelp =
    "FOLDER holds a file of total-station points for each placement of the LED board: a CSV with\n"
    "stamp_ns,point,x_mm,y_mm,z_mm (stamp may be empty), or a Leica GSI-8 / GSI-16 file (.gsi). A "
    "point has\n"
    "its LED's name; other points are passed over. tilt.csv: placement,beta_deg,gamma_deg "
    "(optional\n"
    "sigma_deg), what the board's inclinometer read in the placement that file is of.\n"
    "One placement gives the LEDs; from two on a wrong point is seen, from three on it is named. "
    "For the\n"
    "inclinometer's mounting R1: six placements, tilted by ten degrees or more, forwards and to a "
    "side.\n"
    "--nominal is the last rig file, or the drawing: a .csv with led,x_mm,y_mm,z_mm. The target "
    "frame stays\n"
    "that of it. --out gets the target's part of a rig file.\n"
    "\n"
    "Example\n"
    "  tbm calibrate target placements --nominal drawing.csv --sigma-mm 0.2 --out target.yaml "
    "--report report";

constexpr const char* kRigHelp =
    "Puts a rig file together from what calibrate camera, tilt and target wrote, and from a file "
    "that a\n"
    "person writes:\n"
    "  rig_name: north_2\n"
    "  points:\n"
    "    shield_head: {xyz_mm: [3.0, -5.0, -1600.0], sigma_mm: 0.2}   # in the target frame\n"
    "An old rig file may stand for any of them; a tilt belongs to the camera it was found with.\n"
    "A sigma that is missing is a fault.\n"
    "\n"
    "What the calibration is worth is printed for each point: one row for each source of error, in "
    "mm to the\n"
    "right, up and along, with the LEDs straight ahead at --distance-m and both inclinometers "
    "level.\n"
    "\n"
    "Example\n"
    "  tbm calibrate rig --camera camera.yaml --tilt tilt.yaml --target target.yaml --points "
    "points.yaml\n"
    "      --out rig.yaml --distance-m 5 --report report";

constexpr const char* kImuHelp =
    "RUN is a folder as for tbm line, driven for this: past six or more surveyed targets in depth, "
    "four\n"
    "of them in view at a time, also while the trolley rests at first; on the way it is yawed, "
    "nodded and\n"
    "rolled by about ten degrees. The section camera of its rail.yaml is the first guess; --out "
    "gets that\n"
    "rail.yaml with the camera as found (rotation, position_m, time_offset_s and their sigmas), "
    "and beside\n"
    "it a .json with the covariance. What motion is missing is said, with exit code 2.\n"
    "\n"
    "Example\n"
    "  tbm calibrate imu run_0412 --out rail.yaml";

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

// What every reading of an inclinometer needs.
void AddTiltReading(CLI::App* command, double& sigma_deg, std::vector<double>& sign) {
  command->add_option("--sigma-deg", sigma_deg, "of one reading, where tilt.csv has no sigma_deg")
      ->check(CLI::Range(1e-6, 10.0))
      ->capture_default_str();
  command->add_option("--sign", sign, "of beta and gamma, +1 or -1: what a rig file calls sign")
      ->expected(2)
      ->check(CLI::IsMember({-1.0, 1.0}));
}

void AddTilt(CLI::App* calibrate, CalibrateTiltRequest& request) {
  CLI::App* tilt = calibrate->add_subcommand("tilt", "How an inclinometer is built to the camera");
  tilt->footer(kTiltHelp);
  tilt->add_option("FOLDER", request.folder, "folder of pictures and tilt.csv")->required();
  tilt->add_option("--board,-b", request.board, "KIND:COLUMNSxROWS:PITCH_MM")->required();
  tilt->add_option("--camera,-c", request.camera, "the camera's file, or a rig file")->required();
  tilt->add_option("--out,-o", request.out, "file to write; - is the standard output")->required();
  AddTiltReading(tilt, request.sigma_deg, request.sign);
  tilt->add_option(
          "--up", request.up_in_board, "x y z of up in the board's frame, where it is known")
      ->expected(3);
  tilt->add_option("--up-sigma-deg", request.up_sigma_deg, "of that direction")
      ->check(CLI::Range(1e-6, 10.0))
      ->capture_default_str();
  tilt->add_flag("--force,-f", request.force, "replace an existing file");
}

void AddTarget(CLI::App* calibrate, CalibrateTargetRequest& request) {
  CLI::App* target =
      calibrate->add_subcommand("target", "LED board from total-station points and tilts");
  target->footer(kTargetHelp);
  target->add_option("FOLDER", request.folder, "folder of placements and tilt.csv")->required();
  target->add_option("--nominal,-n", request.nominal, "rig file, or drawing.csv")->required();
  target->add_option("--out,-o", request.out, "file to write; - is the standard output")
      ->required();
  target->add_option("--report", request.report, "folder for target.csv and target.json");
  target->add_option("--sigma-mm", request.sigma_mm, "of one coordinate of a measured point")
      ->check(CLI::Range(1e-3, 100.0))
      ->capture_default_str();
  target
      ->add_option(
          "--most-off-mm", request.most_off_mm, "how far an LED may be from where it is drawn")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  AddTiltReading(target, request.sigma_deg, request.sign);
  target->add_flag("--force,-f", request.force, "replace existing files");
}

void AddRig(CLI::App* calibrate, CalibrateRigRequest& request) {
  CLI::App* rig = calibrate->add_subcommand("rig", "A rig file of its parts, and what it is worth");
  rig->footer(kRigHelp);
  rig->add_option("--camera,-c", request.camera, "what calibrate camera wrote")->required();
  rig->add_option("--tilt,-t", request.tilt, "what calibrate tilt wrote")->required();
  rig->add_option("--target", request.target, "what calibrate target wrote")->required();
  rig->add_option("--points,-p", request.points, "points and rig_name")->required();
  rig->add_option("--out,-o", request.out, "rig file to write; - is the standard output")
      ->required();
  rig->add_option("--name", request.name, "rig_name");
  rig->add_option("--report", request.report, "folder for rig.csv and rig.json");
  rig->add_option("--distance-m", request.distance_m, "from the camera to the LEDs")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  rig->add_option("--centre-sigma-px", request.centre_sigma_px, "of an LED's centre in one frame")
      ->check(CLI::Range(1e-3, 10.0))
      ->capture_default_str();
  rig->add_option("--facing", request.facing, "x y z in the target frame, from LEDs to camera")
      ->expected(3);
  rig->add_flag("--force,-f", request.force, "replace existing files");
}

void AddImu(CLI::App* calibrate, CalibrateImuRequest& request) {
  CLI::App* imu =
      calibrate->add_subcommand("imu", "How a trolley's camera is built to its inertial unit");
  imu->footer(kImuHelp);
  imu->add_option("RUN", request.run, "folder of the run")->required();
  imu->add_option("--out,-o", request.out, "rail.yaml to write; - is the standard output")
      ->required();
  imu->add_option("--first-rotation-deg", request.first_rotation_deg, "sigma of the first guess")
      ->check(CLI::Range(1e-3, 5.0))
      ->capture_default_str();
  imu->add_option("--first-position-mm", request.first_position_mm, "sigma of the first guess")
      ->check(CLI::Range(1e-2, 1000.0))
      ->capture_default_str();
  imu->add_option(
         "--first-time-offset-ms", request.first_time_offset_ms, "sigma of the first guess")
      ->check(CLI::Range(1e-3, 100.0))
      ->capture_default_str();
  imu->add_flag("--force,-f", request.force, "replace existing files");
}

}  // namespace

CLI::App* AddCalibrate(CLI::App& app, CalibrateRequests& requests) {
  CLI::App* calibrate = app.add_subcommand(
      "calibrate", "Camera, inclinometers, LED board, rig file; trolley's camera");
  calibrate->footer(kCalibrateHelp);
  calibrate->require_subcommand(1);
  AddCamera(calibrate, requests.camera);
  AddTilt(calibrate, requests.tilt);
  AddTarget(calibrate, requests.target);
  AddRig(calibrate, requests.rig);
  AddImu(calibrate, requests.imu);
  return calibrate;
}

ExitCode RunCalibrate(const CLI::App& calibrate,
                      const CalibrateRequests& requests,
                      const Console& console) {
  if (calibrate.got_subcommand("camera")) return RunCalibrateCamera(requests.camera, console);
  if (calibrate.got_subcommand("tilt")) return RunCalibrateTilt(requests.tilt, console);
  if (calibrate.got_subcommand("target")) return RunCalibrateTarget(requests.target, console);
  if (calibrate.got_subcommand("rig")) return RunCalibrateRig(requests.rig, console);
  return RunCalibrateImu(requests.imu, console);
}

}  // namespace tbm
