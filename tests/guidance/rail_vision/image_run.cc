#include "tests/guidance/rail_vision/image_run.h"

#include <filesystem>
#include <iterator>

#include <fmt/format.h>

#include "pose/base/angle.h"

namespace tbm::test {
namespace {

std::string Rows(const Eigen::Matrix3d& m) {
  return fmt::format(
      "[{:.12f}, {:.12f}, {:.12f}, {:.12f}, {:.12f}, {:.12f}, {:.12f}, {:.12f}, "
      "{:.12f}]",
      m(0, 0),
      m(0, 1),
      m(0, 2),
      m(1, 0),
      m(1, 1),
      m(1, 2),
      m(2, 0),
      m(2, 1),
      m(2, 2));
}

std::string Lens(const CameraModel& camera) {
  return fmt::format(
      "  image_width: {}\n  image_height: {}\n  distortion_model: plumb_bob\n"
      "  camera_matrix: {{rows: 3, cols: 3, data: [{}, 0, {}, 0, {}, {}, 0, 0, 1]}}\n"
      "  distortion_coefficients: {{rows: 1, cols: 5, data: [{}, {}, {}, {}, {}]}}\n",
      camera.image_width_px,
      camera.image_height_px,
      camera.fx_px,
      camera.cx_px,
      camera.fy_px,
      camera.cy_px,
      camera.k1,
      camera.k2,
      camera.p1,
      camera.p2,
      camera.k3);
}

std::string Mounting(const Eigen::Quaterniond& camera_from_imu, const Eigen::Vector3d& in_imu_m) {
  return fmt::format("  rotation: {}\n  position_m: [{}, {}, {}]\n",
                     Rows(camera_from_imu.toRotationMatrix()),
                     in_imu_m.x(),
                     in_imu_m.y(),
                     in_imu_m.z());
}

std::string Yaml(const RailSetup& setup) {
  const Eigen::Vector3d& p = setup.start.position_world_m;
  std::string text =
      "imu: {rate_hz: 200, angle_random_walk_deg_sqrt_h: 0.2, "
      "velocity_random_walk_ug_sqrt_hz: 30, gyro_bias_deg_h: 30, accel_bias_mg: 1.0}\n" +
      fmt::format("tilt: {{rotation: {}, sigma_deg: 0.003, sigma_rotation_deg: 0.002}}\n",
                  Rows(setup.tilt->housing_from_imu.toRotationMatrix()));
  if (setup.camera) {
    text += "camera:\n" + Lens(setup.camera->model) +
            Mounting(setup.camera->camera_from_imu, setup.camera->in_imu_m) +
            "  residual_px: 0.06\n  sigma_rotation_deg: 0.005\n  sigma_position_mm: 0.1\n"
            "  sigma_time_offset_s: 0.002\n";
  }
  if (setup.ground) {
    text += "ground_camera:\n" + Lens(setup.ground->model) +
            Mounting(setup.ground->camera_from_imu, setup.ground->in_imu_m) +
            fmt::format("  sigma_rotation_deg: 0.02\n  height_m: {}\n  sigma_height_mm: {}\n",
                        setup.ground->height_m,
                        1e3 * setup.ground->sigma_height_m);
  }
  text += fmt::format("start: {{position_m: [{:.9f}, {:.9f}, {:.9f}], sigma_position_mm: 0.1, ",
                      p.x(),
                      p.y(),
                      p.z());
  text += setup.start.heading_rad
              ? fmt::format("heading_known: true, heading_deg: {}, sigma_heading_deg: {}, ",
                            RadToDeg(*setup.start.heading_rad),
                            RadToDeg(setup.start.sigma_heading_rad))
              : "heading_known: false, ";
  return text + fmt::format("at_rest_s: {}}}\n", setup.start.at_rest_s);
}

}  // namespace

void ImageRun::WriteRun() const {
  WriteText(*this / "rail.yaml", Yaml(run_.setup));
  std::string imu =
      "stamp_ns,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,accel_x_m_s2,accel_y_m_s2,accel_z_m_s2\n";
  for (const ImuSample& sample : run_.recording.imu) {
    const Eigen::Vector3d& w = sample.gyro_rad_s;
    const Eigen::Vector3d& a = sample.accel_m_s2;
    fmt::format_to(std::back_inserter(imu),
                   "{},{:.9f},{:.9f},{:.9f},{:.7f},{:.7f},{:.7f}\n",
                   sample.ends_at.ns,
                   w.x(),
                   w.y(),
                   w.z(),
                   a.x(),
                   a.y(),
                   a.z());
  }
  WriteText(*this / "imu.csv", imu);
  std::string tilts = "stamp_ns,sensor,beta_deg,gamma_deg\n";
  for (const auto& tilt : run_.recording.tilts) {
    fmt::format_to(std::back_inserter(tilts),
                   "{},trolley,{:.5f},{:.5f}\n",
                   tilt.sensed_at.ns,
                   RadToDeg(tilt.angles.beta_rad),
                   RadToDeg(tilt.angles.gamma_rad));
  }
  WriteText(*this / "tilt.csv", tilts);
  std::string truth = "stamp_ns,x_m,y_m,z_m,qw,qx,qy,qz\n";
  for (const RailTruth& row : run_.truth) {
    const Eigen::Vector3d& p = row.position_world_m;
    const Eigen::Quaterniond& q = row.world_from_imu;
    fmt::format_to(std::back_inserter(truth),
                   "{},{:.7f},{:.7f},{:.7f},{:.9f},{:.9f},{:.9f},{:.9f}\n",
                   row.at.ns,
                   p.x(),
                   p.y(),
                   p.z(),
                   q.w(),
                   q.x(),
                   q.y(),
                   q.z());
  }
  WriteText(*this / "truth.csv", truth);
}

void ImageRun::WriteTargets(const std::vector<ImageTarget>& targets) const {
  std::string text = "target,x_m,y_m,z_m,sigma_mm,kind\n";
  for (const ImageTarget& target : targets) {
    const Eigen::Vector3d& p = target.in_world_m;
    fmt::format_to(std::back_inserter(text),
                   "{},{:.6f},{:.6f},{:.6f},0.03,{}\n",
                   target.name,
                   p.x(),
                   p.y(),
                   p.z(),
                   target.kind);
  }
  WriteText(*this / "targets.csv", text);
}

void ImageRun::WriteFrames(const Scenery& scenery, double every_s) const {
  const RailCamera& camera = *run_.setup.camera;
  const auto step = static_cast<std::size_t>(every_s * run_.setup.imu.rate_hz);
  std::vector<RailTruth> places;
  for (std::size_t i = step - 1; i < run_.truth.size(); i += step) places.push_back(run_.truth[i]);
  WriteImages(scenery,
              camera.model,
              {camera.camera_from_imu, camera.camera_from_imu * -camera.in_imu_m},
              places,
              "frames.csv",
              "frames");
}

void ImageRun::WriteGroundFrames(const Scenery& scenery, double every_s) const {
  const RailGroundCamera& camera = *run_.setup.ground;
  const auto step = static_cast<std::size_t>(every_s * run_.setup.imu.rate_hz);
  const auto rest = static_cast<std::size_t>(run_.setup.start.at_rest_s * run_.setup.imu.rate_hz);
  std::vector<RailTruth> places;
  for (std::size_t i = rest; i < run_.truth.size(); i += step) places.push_back(run_.truth[i]);
  WriteImages(scenery,
              camera.model,
              {camera.camera_from_imu, camera.camera_from_imu * -camera.in_imu_m},
              places,
              "ground_frames.csv",
              "ground");
}

void ImageRun::WriteImages(const Scenery& scenery,
                           const CameraModel& model,
                           const Rigid3& camera_from_imu,
                           const std::vector<RailTruth>& places,
                           const std::string& name,
                           const std::string& folder) const {
  const ScenePainter painter(model);
  Random random(name);
  std::filesystem::create_directory(*this / folder);
  std::string text = "stamp_ns,file\n";
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Rigid3 world_from_imu{places[i].world_from_imu, places[i].position_world_m};
    const auto pixels = painter.Paint(scenery, camera_from_imu * Inverse(world_from_imu), random);
    const std::string file = fmt::format("{}/{:04d}.pgm", folder, i);
    WritePicture(*this / file, painter.View(pixels));
    fmt::format_to(std::back_inserter(text), "{},{}\n", places[i].at.ns, file);
  }
  WriteText(*this / name, text);
}

void ImageRun::WriteCentres() const {
  std::string text = "stamp_ns,target,u_px,v_px\n";
  for (const TargetImage& image : run_.recording.images) {
    for (const TargetPixel& pixel : image.pixels) {
      fmt::format_to(std::back_inserter(text),
                     "{},{},{:.4f},{:.4f}\n",
                     image.stamped_at.ns,
                     run_.recording.targets[static_cast<std::size_t>(pixel.target)].name,
                     pixel.pixel_px.x(),
                     pixel.pixel_px.y());
    }
  }
  WriteText(*this / "centres.csv", text);
}

}  // namespace tbm::test
