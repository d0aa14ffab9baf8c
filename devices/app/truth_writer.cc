#include "devices/app/truth_writer.h"

#include <utility>

#include <fmt/format.h>

#include "pose/geometry/camera_model.h"

namespace tbm {
namespace {

constexpr const char* kHead = "shield_head";

int LedsInView(const sim::World& world, const Rigid3& camera_from_target, Timestamp when) {
  const CameraModel& camera = world.rig().camera;
  int count = 0;
  for (std::size_t led = 0; led < world.rig().leds.size(); ++led) {
    const auto seen = Project(camera, camera_from_target * world.rig().leds[led].p_led_in_target);
    if (!seen || world.IsHidden(led, when)) continue;
    const Eigen::Vector2d& pixel = seen->pixel_px;
    if (pixel.x() >= 0.0 && pixel.y() >= 0.0 && pixel.x() <= camera.image_width_px - 1.0 &&
        pixel.y() <= camera.image_height_px - 1.0) {
      ++count;
    }
  }
  return count;
}

const NamedPoint* Head(const Rig& rig) {
  for (const NamedPoint& point : rig.points) {
    if (point.name == kHead) return &point;
  }
  return nullptr;
}

}  // namespace

TruthWriter::TruthWriter(const std::string& path, std::shared_ptr<const sim::World> world)
    : world_(std::move(world)), file_(path.empty() ? nullptr : std::fopen(path.c_str(), "w")) {
  if (!file_) return;
  std::fputs("stamp_ns,qw,qx,qy,qz,tx_mm,ty_mm,tz_mm,head_x_mm,head_y_mm,head_z_mm,leds_visible\n",
             file_.get());
}

void TruthWriter::Write(Timestamp sensed_at) {
  if (!file_) return;
  const Rigid3 truth = world_->At(sensed_at).camera_from_target;
  const Eigen::Quaterniond& q = truth.rotation;
  const Eigen::Vector3d t_mm = 1e3 * truth.translation;
  std::string row = fmt::format("{},{:.9f},{:.9f},{:.9f},{:.9f},{:.4f},{:.4f},{:.4f},",
                                sensed_at.ns,
                                q.w(),
                                q.x(),
                                q.y(),
                                q.z(),
                                t_mm.x(),
                                t_mm.y(),
                                t_mm.z());
  if (const NamedPoint* const head = Head(world_->rig())) {
    const Eigen::Vector3d p_mm = 1e3 * (truth * head->p_point_in_target);
    row += fmt::format("{:.4f},{:.4f},{:.4f}", p_mm.x(), p_mm.y(), p_mm.z());
  } else {
    row += ",,";
  }
  row += fmt::format(",{}\n", LedsInView(*world_, truth, sensed_at));
  std::fputs(row.c_str(), file_.get());
  std::fflush(file_.get());
}

}  // namespace tbm
