#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "guidance/app/calibrate_input.h"
#include "guidance/app/target_input.h"

namespace {

// A drawing, and a placement of the board that it draws.
void ReadTables(const std::string& text) {
  const std::string header = text.size() % 2 == 0 ? "led,x_mm,y_mm,z_mm\n" : "";
  const auto drawing = tbm::ParseLedDrawing(header + text, "drawing.csv");
  if (!drawing && drawing.error().empty()) __builtin_trap();
  if (drawing && (drawing->size() < tbm::kMinLeds || drawing->size() > tbm::kMaxLeds)) {
    __builtin_trap();
  }
  const std::vector<tbm::Led> leds = {{"P1", {}, 0.0}, {"P2", {}, 0.0}, {"7", {}, 0.0}};
  const auto points = tbm::ParsePlacement(text, "s1.csv", drawing ? *drawing : leds, 5.0);
  if (!points) {
    if (points.error().empty()) __builtin_trap();
    for (const auto& fault : points.error()) (void)fault.Text();
    return;
  }
  for (const auto& led : points->led_in_site_m) {
    if (led && !led->allFinite()) __builtin_trap();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  // --board
  if (const auto board = tbm::ParseBoard(text)) {
    const auto points = tbm::BoardPoints(*board);
    if (points.size() < 9 || points.size() > 4096 || !points.back().allFinite()) __builtin_trap();
  } else if (tbm::Advice(board.error())[0] == '\0') {
    __builtin_trap();
  }
  ReadTables(text);
  // tilt.csv; half of the inputs get a good header, so that the search does not have to find one.
  const std::string header = size % 2 == 0 ? "image,beta_deg,gamma_deg,sigma_deg\n" : "";
  const auto rows =
      tbm::ParseCalibrationTilts(header + text, "tilt.csv", tbm::kTiltOfPicture, 0.005, 1.0, -1.0);
  if (!rows) {
    if (rows.error().empty()) __builtin_trap();
    for (const auto& fault : rows.error()) (void)fault.Text();
    return 0;
  }
  for (const auto& row : *rows) {
    if (!(std::abs(row.up_in_housing.norm() - 1.0) < 1e-9) || !(row.sigma_rad > 0.0)) {
      __builtin_trap();
    }
  }
  return 0;
}
