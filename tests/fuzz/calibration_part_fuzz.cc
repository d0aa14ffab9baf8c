#include <cstddef>
#include <cstdint>
#include <string_view>
#include <utility>

#include "guidance/config/calibration_parts.h"
#include "pose/rig/rig_text.h"

namespace {

// Refused means said why.
template <class Parsed>
bool IsGood(const Parsed& parsed) {
  if (parsed) return true;
  if (parsed.error().empty()) __builtin_trap();
  for (const auto& fault : parsed.error()) (void)fault.Text();
  return false;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto camera = tbm::ParseCameraPart(text, "camera.yaml");
  const auto tilt = tbm::ParseTiltPart(text, "tilt.yaml");
  const auto target = tbm::ParseTargetPart(text, "target.yaml");
  const auto points = tbm::ParsePointsPart(text, "points.yaml");
  (void)IsGood(tbm::ParseLeds(text, "leds.yaml"));
  const bool has_camera = IsGood(camera);
  const bool has_tilt = IsGood(tilt);
  const bool has_target = IsGood(target);
  const bool has_points = IsGood(points);
  if (!has_camera || !has_tilt || !has_target || !has_points) return 0;
  // A rig put together of parts that were accepted is one that the loader accepts.
  tbm::Rig rig = camera->rig;
  rig.name = points->rig_name;
  rig.camera_tilt = tilt->mount;
  rig.target_tilt = target->mount;
  rig.leds = target->leds;
  rig.points = points->points;
  const auto again = tbm::ParseRig(tbm::RigYaml(rig), "rig.yaml");
  if (!again || !again->warnings.empty()) __builtin_trap();
  return 0;
}
