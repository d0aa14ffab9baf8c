#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "pose/calibrate/board.h"
#include "pose/centres/image_view.h"
#include "pose/geometry/camera_model.h"
#include "pose/geometry/rigid3.h"
#include "tests/support/random.h"

namespace tbm::test {

// A lens as calibrations meet it: 640 x 480, 55 degrees wide, barrel distortion of some pixels.
CameraModel BoardCamera();

// Paints boards as a camera sees them: a pixel through which an edge passes is the mean of six by
// six places in it; rays are bent by the lens, which blurs by 0.6 px.
class BoardPainter {
 public:
  explicit BoardPainter(const CameraModel& camera);

  // Paper 215, ink 40, wall 110, or the other way round; noise of `noise_dn`, rounded to 8 bits.
  std::vector<std::uint8_t> Paint(const Board& board,
                                  const Rigid3& camera_from_board,
                                  double noise_dn,
                                  Random& random,
                                  bool is_negative = false) const;
  ImageView View(const std::vector<std::uint8_t>& pixels) const;

 private:
  CameraModel camera_;
  std::vector<Eigen::Vector2d> rays_;  // of the pixels' corners, row by row
};

// Where a board stands: its outermost points `margin_px` from the image's edges on the side that
// `along_u`, `along_v` say (-1 left / top, 0 in the middle, 1).
struct BoardPlace {
  int along_u = 0;
  int along_v = 0;
  double share = 0.5;  // of the image's width that the board takes, untilted
  double tilt_u_deg = 0.0;
  double tilt_v_deg = 0.0;
  double roll_deg = 0.0;
  double margin_px = 30.0;
};
Rigid3 Placed(const Board& board, const CameraModel& camera, const BoardPlace& place);

// Placements as the manual asks for: all over the image, tilted to all four sides.
std::vector<Rigid3> GoodPlacements(const Board& board,
                                   const CameraModel& camera,
                                   int count,
                                   Random& random);

// What an ideal finder says: pixels of all points, of circles the middle of the pictured area, by
// the area of a polygon along the circle's edge.
std::vector<Eigen::Vector2d> TruePixels(const Board& board,
                                        const CameraModel& camera,
                                        const Rigid3& camera_from_board);

// A PGM with these pixels.
void WritePicture(const std::string& path, const ImageView& image);

}  // namespace tbm::test
