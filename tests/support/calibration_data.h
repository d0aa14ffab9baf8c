#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "pose/rig/rig.h"

namespace tbm::test {

// What a surveyor brings home from the workshop, as files: for the commands of `tbm calibrate`.

inline constexpr const char* kWorkshopBoard = "chessboard:9x6:25";

// Eighteen pictures p00.pgm .. of that board by BoardCamera.
void MakeCameraPictures(const std::string& folder);

// A camera with its inclinometer on a tilting table, before a board at rest.
struct TiltingTable {
  // z of the housing against the line of sight, some degrees off; the floor some degrees off level.
  Eigen::Matrix3d camera_from_housing = FloorCameraFromHousing();
  Eigen::Vector3d up_in_board = Eigen::Vector3d(0.02, -0.03, -1.0).normalized();
  double roll_deg = 180.0;  // to each side

  static Eigen::Matrix3d FloorCameraFromHousing();
};
// A camera that looks level, at a plumbed board on a wall.
TiltingTable LevelTable(const Eigen::Matrix3d& housing_from_camera);
// Twelve pictures t00.pgm .. of the board by BoardCamera, with tilt.csv; and camera.yaml, the true
// camera.
void MakeTiltPictures(const std::string& folder, const TiltingTable& table);

// An LED board before a total station.
struct BoardSurvey {
  Rig rig;                // the LEDs and the mounting as they are
  double sigma_mm = 0.1;  // of a coordinate
  double tilt_sigma_deg = 0.005;
  double lean_deg = 12.0;  // to each side, of all placements but the first
  int placements = 6;
};
// s1.csv, s2.gsi, s3.csv, .. and tilt.csv. The board's y axis is up, as in the published rig.
void MakeBoardSurvey(const std::string& folder, const BoardSurvey& survey);

}  // namespace tbm::test
