#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "devices/replay/csv.h"
#include "devices/replay/image_file.h"
#include "guidance/app/console.h"
#include "pose/base/result.h"
#include "pose/calibrate/board.h"

namespace tbm {

// What --board says; complains, and is empty, when that is no board.
std::optional<Board> BoardOf(const std::string& text, const Console& console);

// Names of all pictures in a folder (.png, .pgm, .tif, .tiff), sorted. Errors: no folder, none in
// it.
Result<std::vector<std::string>, std::string> PictureNames(const std::string& folder);

// The same of any files: those whose name ends with one of `endings` (".csv", small letters), in
// whatever case. Errors: no folder. There may be none.
Result<std::vector<std::string>, std::string> NamesIn(const std::string& folder,
                                                      std::span<const std::string_view> endings);

struct FoundPicture {
  std::string name;
  std::size_t index = 0;  // in the list that was asked for
};

struct FoundBoards {
  ImageSize size;
  // Side by side: the pictures in which the board is seen whole, and its points there.
  std::vector<FoundPicture> pictures;
  std::vector<std::vector<Eigen::Vector2d>> pixels_px;
  std::vector<std::string> not_found;  // "p07.png: the board is not seen whole in it: .."
};

// Reads the pictures and finds the board in each. Errors name the file that cannot be read or has
// another size than the others, or than `expected`.
Result<FoundBoards, std::string> FindBoards(const std::string& folder,
                                            const std::vector<std::string>& names,
                                            const Board& board,
                                            std::optional<ImageSize> expected,
                                            const Console& console);

// What a row of tilt.csv belongs to: the column's name, and the word for it in messages.
struct TiltTable {
  std::string_view column;
  std::string_view noun;
};
inline constexpr TiltTable kTiltOfPicture{"image", "picture"};
inline constexpr TiltTable kTiltOfPlacement{"placement", "placement's file"};

// One row of the tilt.csv of a calibration.
struct CalibrationTilt {
  std::string name;
  int line = 0;
  Eigen::Vector3d up_in_housing = Eigen::Vector3d::UnitZ();
  double sigma_rad = 0.0;  // of each angle
};

// `text` has the column of `what`, beta_deg, gamma_deg and, optional, sigma_deg. Signs are those of
// the rig key `sign`. All faults are collected.
Result<std::vector<CalibrationTilt>, FileFaults> ParseCalibrationTilts(std::string text,
                                                                       const std::string& file,
                                                                       const TiltTable& what,
                                                                       double default_sigma_deg,
                                                                       double beta_sign,
                                                                       double gamma_sign);

}  // namespace tbm
