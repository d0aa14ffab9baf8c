#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "guidance/axis/design_axis.h"
#include "guidance/config/axis_file.h"

// LandXML and the table: told apart by their first character, as in the field. Whatever is accepted
// must also be walked from end to end without a number that is none.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto loaded = tbm::ParseAxis(
      {reinterpret_cast<const char*>(data), size}, "axis.xml", tbm::AxisFileOptions{});
  if (!loaded) {
    if (loaded.error().empty()) __builtin_trap();  // refused without saying why
    for (const auto& fault : loaded.error()) (void)fault.Text();
    return 0;
  }
  const auto remarks = tbm::Inspect(loaded->description);
  for (const auto& remark : remarks) (void)tbm::RemarkText(remark, "axis.xml");
  const auto axis = tbm::DesignAxis::Build(loaded->description);
  if (axis.has_value() == tbm::IsRefused(remarks)) __builtin_trap();
  if (!axis) return 0;
  const double length_m = axis->end().m - axis->start().m;
  if (!(length_m > 0.0)) __builtin_trap();
  for (int i = 0; i <= 16; ++i) {
    const auto point = axis->At({axis->start().m + length_m * i / 16});
    if (!point || !point->p_plan_in_site.allFinite()) __builtin_trap();
    if (!std::isfinite(point->bearing_rad) || !std::isfinite(point->curvature_right_per_m)) {
      __builtin_trap();
    }
    if (point->up_m && !std::isfinite(*point->up_m)) __builtin_trap();
    const Eigen::Vector3d p(point->p_plan_in_site.x(), point->p_plan_in_site.y(), 0.0);
    (void)axis->Project(p).has_value();
    (void)axis->Project(p, point->chainage).has_value();
  }
  return 0;
}
