// Renders the recorded run in tests/data/run_small: make_small_run FOLDER, where FOLDER holds its
// rig.yaml. Projection, tilts and rendering are those of tests/support, none of the product's.

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include <fmt/format.h>

#include "devices/replay/image_file.h"
#include "pose/base/angle.h"
#include "pose/rig/rig_file.h"
#include "tests/support/random.h"
#include "tests/support/render.h"
#include "tests/support/scene.h"

namespace tbm::test {
namespace {

constexpr int kFrames = 12;
constexpr int kHiddenLedFrame = 5;  // P2 behind a hose
constexpr int kMissingFrame = 8;    // its file is not there
constexpr std::int64_t kStartNs = 1'790'000'000'000'000'000;
constexpr std::int64_t kFramePeriodNs = 200'000'000;

// The front shield creeps forward, rolls and yaws a little; the rear shield, and the camera with
// it, stands 1.2 degrees nose-up and 0.8 degrees rolled, and trembles.
Truth TruthAt(double t_s) {
  Truth truth;
  const Eigen::Vector3d turn_rad(
      DegToRad(0.3 + 0.02 * t_s), DegToRad(-0.6 + 0.05 * t_s), DegToRad(0.9 - 0.03 * t_s));
  truth.camera_from_target.rotation =
      ExpRotation(turn_rad) * Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0);  // faces the camera
  truth.camera_from_target.translation =
      Eigen::Vector3d(0.035 + 0.0004 * t_s, -0.052, 3.2 + 0.0015 * t_s);
  const Eigen::Vector3d lean_rad(DegToRad(1.2 + 0.002 * t_s), 0.0, DegToRad(0.8));
  truth.up_in_camera = ExpRotation(lean_rad) * -Eigen::Vector3d::UnitY();
  return truth;
}

RenderedImage FrameOf(const Rig& as_built, const Truth& truth, bool hides_p2, Random& random) {
  RenderScene scene;
  scene.width_px = as_built.camera.image_width_px;
  scene.height_px = as_built.camera.image_height_px;
  scene.background_dn = 5.0;
  scene.slope_dn_per_px = {0.002, 0.003};
  scene.read_noise_dn = 0.6;
  scene.gain_dn_per_electron = 0.025;
  for (std::size_t i = 0; i < as_built.leds.size(); ++i) {
    if (hides_p2 && i == 1) continue;
    RenderSpot spot;
    spot.pixel_px =
        ExactPixel(as_built.camera, truth.camera_from_target * as_built.leds[i].p_led_in_target);
    spot.sigma_px = 2.2;
    spot.peak_dn = 150.0 + 10.0 * static_cast<double>(i);
    scene.spots.push_back(spot);
  }
  scene.hot.push_back({911, 77, 180.0});
  return Render(scene, random);
}

std::string TiltRows(const Rig& rig, std::int64_t frame_ns, Random& random) {
  std::string rows;
  for (int i = -1; i <= 1; ++i) {
    for (const bool is_target : {true, false}) {
      const std::int64_t at_ns = frame_ns + i * 20'000'000 + (is_target ? 0 : 3'000'000);
      const Truth truth = TruthAt(static_cast<double>(at_ns - kStartNs) * 1e-9);
      const TiltMount& mount = is_target ? rig.target_tilt : rig.camera_tilt;
      const Eigen::Vector3d up =
          is_target
              ? Eigen::Vector3d(truth.camera_from_target.rotation.conjugate() * truth.up_in_camera)
              : truth.up_in_camera;
      const Inclination tilt = ExactInclination(mount, up);
      rows += fmt::format("{},{},{:.4f},{:.4f}\n",
                          at_ns,
                          is_target ? "target" : "camera",
                          RadToDeg(tilt.beta_rad + random.Normal(mount.sigma_rad)),
                          RadToDeg(tilt.gamma_rad + random.Normal(mount.sigma_rad)));
    }
  }
  return rows;
}

std::string TruthRow(
    const Rig& rig, const Truth& truth, std::int64_t at_ns, int visible, const char* note) {
  const auto& [q, t] = truth.camera_from_target;
  const Eigen::Vector3d head = truth.camera_from_target * rig.points[0].p_point_in_target;
  return fmt::format(
      "{},{:.9f},{:.9f},{:.9f},{:.9f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{},{}\n",
      at_ns,
      q.w(),
      q.x(),
      q.y(),
      q.z(),
      t.x() * 1e3,
      t.y() * 1e3,
      t.z() * 1e3,
      head.x() * 1e3,
      head.y() * 1e3,
      head.z() * 1e3,
      visible,
      note);
}

int Make(const std::string& folder) {
  const auto loaded = LoadRigFile(folder + "/rig.yaml");
  if (!loaded) {
    for (const auto& fault : loaded.error()) std::fprintf(stderr, "%s\n", fault.Text().c_str());
    return 2;
  }
  const Rig& rig = loaded->rig;
  Random random("run_small");
  Rig as_built = rig;
  for (Led& led : as_built.leds) led.p_led_in_target += random.Normal3(led.sigma_m);
  std::filesystem::create_directories(folder + "/frames");
  std::ofstream frames(folder + "/frames.csv");
  std::ofstream tilts(folder + "/tilt.csv");
  std::ofstream truths(folder + "/truth.csv");
  frames << "stamp_ns,file\n";
  tilts << "stamp_ns,sensor,beta_deg,gamma_deg\n";
  truths
      << "stamp_ns,qw,qx,qy,qz,tx_mm,ty_mm,tz_mm,head_x_mm,head_y_mm,head_z_mm,leds_visible,note\n";
  for (int i = 0; i < kFrames; ++i) {
    const std::int64_t at_ns = kStartNs + i * kFramePeriodNs;
    const Truth truth = TruthAt(static_cast<double>(at_ns - kStartNs) * 1e-9);
    const std::string file = fmt::format("frames/{:06}.png", i);
    const RenderedImage image = FrameOf(as_built, truth, i == kHiddenLedFrame, random);
    if (i != kMissingFrame) {
      const auto png = EncodePng(image.view, 9);
      std::ofstream(folder + "/" + file, std::ios::binary)
          .write(reinterpret_cast<const char*>(png->data()),
                 static_cast<std::streamsize>(png->size()));
    }
    frames << at_ns << "," << file << "\n";
    tilts << TiltRows(rig, at_ns, random);
    const char* note = i == kHiddenLedFrame ? "hidden_led"
                       : i == kMissingFrame ? "missing_file"
                                            : "ok";
    truths << TruthRow(rig,
                       truth,
                       at_ns,
                       i == kHiddenLedFrame ? 4
                       : i == kMissingFrame ? 0
                                            : 5,
                       note);
  }
  return 0;
}

}  // namespace
}  // namespace tbm::test

int main(int argument_count, char** arguments) {
  if (argument_count != 2) {
    std::fprintf(stderr, "usage: make_small_run FOLDER\n");
    return 2;
  }
  return tbm::test::Make(arguments[1]);
}
