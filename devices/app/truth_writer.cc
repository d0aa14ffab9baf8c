#include "devices/app/truth_writer.h"

#include <filesystem>
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

TruthWriter::File TruthWriter::Open(const std::string& path) {
  return File(path.empty() ? nullptr : std::fopen(path.c_str(), "w"));
}

TruthWriter::TruthWriter(const std::string& path, std::shared_ptr<const sim::World> world)
    : world_(std::move(world)), file_(Open(path)) {
  if (!file_) return;
  std::fputs("stamp_ns,qw,qx,qy,qz,tx_mm,ty_mm,tz_mm,head_x_mm,head_y_mm,head_z_mm,leds_visible\n",
             file_.get());
  if (!world_->has_tunnel()) return;
  const std::filesystem::path given(path);
  shields_ =
      Open(given.parent_path() / (given.stem().string() + "_shields" + given.extension().string()));
  if (!shields_) return;
  std::string header = "stamp_ns";
  for (const char* shield : {"rear", "front"}) {
    header += fmt::format(",{0}_qw,{0}_qx,{0}_qy,{0}_qz,{0}_x_m,{0}_y_m,{0}_z_m", shield);
  }
  std::fputs((header + "\n").c_str(), shields_.get());
}

void TruthWriter::WriteShields(Timestamp sensed_at) {
  if (!shields_) return;
  std::string row = fmt::format("{}", sensed_at.ns);
  for (const Rigid3& site_from_shield :
       {world_->SiteFromRearShield(sensed_at), world_->SiteFromFrontShield(sensed_at)}) {
    const Eigen::Quaterniond& q = site_from_shield.rotation;
    const Eigen::Vector3d& t = site_from_shield.translation;
    row += fmt::format(",{:.12f},{:.12f},{:.12f},{:.12f}", q.w(), q.x(), q.y(), q.z());
    row += fmt::format(",{:.7f},{:.7f},{:.7f}", t.x(), t.y(), t.z());
  }
  std::fputs((row + "\n").c_str(), shields_.get());
  std::fflush(shields_.get());
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
  WriteShields(sensed_at);
}

}  // namespace tbm
