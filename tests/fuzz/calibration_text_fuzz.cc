#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include "guidance/app/calibrate_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  // --board
  if (const auto board = tbm::ParseBoard(text)) {
    const auto points = tbm::BoardPoints(*board);
    if (points.size() < 9 || points.size() > 4096 || !points.back().allFinite()) __builtin_trap();
  } else if (tbm::Advice(board.error())[0] == '\0') {
    __builtin_trap();
  }
  // tilt.csv; half of the inputs get a good header, so that the search does not have to find one.
  const std::string header = size % 2 == 0 ? "image,beta_deg,gamma_deg,sigma_deg\n" : "";
  const auto rows = tbm::ParseCalibrationTilts(header + text, "tilt.csv", 0.005, 1.0, -1.0);
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
