// A line as `tbm line` writes it.
#include <cstddef>
#include <cstdint>
#include <string>

#include "guidance/app/line_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // Half of the inputs get a good header, so that the search does not have to find one.
  std::string text = size % 2 == 0 ? "stamp_ns,distance_m,x_m,y_m,z_m,qw,qx,qy,qz,sigma_x_mm,"
                                     "sigma_y_mm,sigma_z_mm,status\n"
                                   : "";
  text.append(reinterpret_cast<const char*>(data), size);
  const auto line = tbm::ParseLineFile(std::move(text), "line.csv");
  if (!line) {
    if (line.error().empty()) __builtin_trap();
    for (const auto& fault : line.error()) (void)fault.Text();
    return 0;
  }
  if (line->points.size() < 2) __builtin_trap();
  for (std::size_t i = 1; i < line->points.size(); ++i) {
    const tbm::RailPoint& point = line->points[i];
    if (!point.position_world_m.allFinite() || !(point.sigma_world_m.minCoeff() > 0.0)) {
      __builtin_trap();
    }
    if (point.at <= line->points[i - 1].at) __builtin_trap();
    if (point.distance_m < line->points[i - 1].distance_m) __builtin_trap();
  }
  return 0;
}
