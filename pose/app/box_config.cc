#include "pose/app/box_config.h"

#include <fmt/format.h>

#include "pose/app/inclinometer_section.h"
#include "pose/base/angle.h"
#include "pose/rig/dds_section.h"
#include "pose/rig/rig_yaml.h"
#include "pose/rig/yaml_section.h"

namespace tbm {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;

class Reader {
 public:
  explicit Reader(std::string file) : file_(std::move(file)) {}

  BoxConfig Read(const YamlNode& root) {
    BoxConfig config;
    if (!root.IsMap()) {
      root.Fault("the file must be a map with machine_id, rig, camera, inclinometers");
      return config;
    }
    YamlSection section(root);
    if (const auto id = section.Require("machine_id", "the machine's name, e.g. TBM-1").Text()) {
      config.machine_id = *id;
      if (id->empty() || id->size() > 32) {
        root.Optional("machine_id").Fault("must have 1 to 32 characters");
      }
    }
    if (const auto rig = section.Require("rig", "path of the rig file, e.g. rig.yaml").Text()) {
      config.rig_file = Path(*rig);
    }
    ReadCamera(section.Require("camera", "a map with driver: gige | sim | replay"), &config);
    ReadInclinometers(section.Require("inclinometers", "a map with target and camera"), &config);
    ReadSolver(section.Know("solver"), &config);
    ReadDdsSection(section.Know("dds"), &config.dds);
    ReadRecording(section.Know("recording"), &config);
    section.RefuseOthers();
    return config;
  }

 private:
  std::string Path(const std::string& path) const { return BesideFile(file_, path); }

  void ReadCamera(const YamlNode& node, BoxConfig* config) {
    if (!IsSection(node)) return;
    CameraConfig& camera = config->camera;
    YamlSection section(node);
    std::string driver;
    section.Require("driver", "gige, sim or replay");
    if (section.Word("driver", {"gige", "sim", "replay"}, &driver)) {
      camera.driver = driver == "gige"     ? CameraDriver::kGige
                      : driver == "replay" ? CameraDriver::kReplay
                                           : CameraDriver::kSim;
    }
    section.Text("address", &camera.address);
    section.Integer("packet_size_bytes", 0, 16000, &camera.packet_size_bytes);
    section.Flag("packet_socket", &camera.packet_socket);
    section.Integer("socket_buffer_bytes", 65536, 268435456, &camera.socket_buffer_bytes);
    section.Flag("packet_resend", &camera.packet_resend);
    std::string format = "mono8";
    if (section.Word("pixel_format", {"mono8", "mono12", "mono16"}, &format)) {
      camera.pixel_format = format == "mono8"    ? PixelFormat::kMono8
                            : format == "mono12" ? PixelFormat::kMono12
                                                 : PixelFormat::kMono16;
    }
    std::string event = "exposure_end";
    if (section.Word("stamp_event", {"exposure_start", "exposure_end"}, &event)) {
      camera.stamp_event =
          event == "exposure_end" ? StampEvent::kExposureEnd : StampEvent::kExposureStart;
    }
    section.Number("readout_latency_us", 0.0, 1e6, "us", &camera.readout_latency_us);
    section.Number("frame_rate_hz", 0.1, 200.0, "Hz", &camera.frame_rate_hz);
    section.Number("exposure_us", 1.0, 1e6, "us", &camera.exposure_us);
    section.Number("exposure_min_us", 1.0, 1e6, "us", &camera.exposure_min_us);
    section.Number("exposure_max_us", 1.0, 1e6, "us", &camera.exposure_max_us);
    section.Flag("exposure_control", &config->exposure_control);
    section.Integer("silent_after_ms", 0, 60000, &camera.silent_after_ms);
    section.Text("run_folder", &camera.run_folder);
    camera.run_folder = Path(camera.run_folder);
    section.Flag("real_time", &camera.real_time);
    section.RefuseOthers();
    for (const std::string& fault : CheckCameraConfig(camera)) {
      // "camera.<key>: <what>"
      const std::size_t dot = fault.find('.');
      const std::size_t colon = fault.find(": ", dot);
      TBM_CHECK(colon != std::string::npos);
      node.Optional(fault.substr(dot + 1, colon - dot - 1)).Fault(fault.substr(colon + 2));
    }
  }

  void ReadInclinometers(const YamlNode& node, BoxConfig* config) {
    if (!IsSection(node)) return;
    YamlSection section(node);
    const YamlNode target = section.Require("target", "a map with driver and port");
    const YamlNode camera = section.Require("camera", "a map with driver and port");
    section.RefuseOthers();
    config->target_inclinometer.name = "target";
    config->camera_inclinometer.name = "camera";
    ReadInclinometerSection(target, &config->target_inclinometer);
    ReadInclinometerSection(camera, &config->camera_inclinometer);
    const InclinometerConfig both[] = {config->target_inclinometer, config->camera_inclinometer};
    for (const ConfigFault& fault : FindSharingFaults(both)) {
      node.Fault(fmt::format("{}: {}", fault.key, fault.message));
    }
  }

  void ReadSolver(const YamlNode& node, BoxConfig* config) {
    if (!IsSection(node)) return;
    FrameSolverOptions& solver = config->solver;
    YamlSection section(node);
    section.Time("tilt_max_age_ms", 1.0, 10'000.0, &solver.tilt.max_age);
    nanoseconds wait = config->tilt_wait;
    section.Time("tilt_wait_ms", 0.0, 1000.0, &wait);
    config->tilt_wait = std::chrono::duration_cast<milliseconds>(wait);
    double speed_mm_per_s = 1e3 * solver.motion_sigma_m_per_s;
    section.Number("motion_sigma_mm_per_s", 0.1, 5000.0, "mm/s", &speed_mm_per_s);
    solver.motion_sigma_m_per_s = 1e-3 * speed_mm_per_s;
    double turn_deg_per_s = RadToDeg(solver.motion_sigma_rad_per_s);
    section.Number("motion_sigma_deg_per_s", 0.001, 90.0, "degree/s", &turn_deg_per_s);
    solver.motion_sigma_rad_per_s = DegToRad(turn_deg_per_s);
    section.Time("prior_max_age_ms", 0.0, 600'000.0, &solver.prior_max_age);
    section.RefuseOthers();
  }

  void ReadRecording(const YamlNode& node, BoxConfig* config) {
    if (!IsSection(node)) return;
    BoxRecordingConfig& recording = config->recording;
    YamlSection section(node);
    section.Text("folder", &recording.folder);
    recording.folder = Path(recording.folder);
    int minutes = static_cast<int>(recording.run_length.count());
    section.Integer("run_length_min", 1, 1440, &minutes);
    recording.run_length = std::chrono::minutes(minutes);
    double limit_mb = 1e-6 * static_cast<double>(recording.limit_bytes);
    section.Number("limit_mb", 10.0, 1e7, "MB", &limit_mb);
    recording.limit_bytes = static_cast<std::int64_t>(limit_mb * 1e6);
    section.RefuseOthers();
  }

  std::string file_;
};

}  // namespace

Result<BoxConfig, RigFileFaults> ParseBoxConfig(std::string_view yaml, const std::string& file) {
  return ReadYaml(yaml, file, [&](const YamlNode& root) { return Reader(file).Read(root); });
}

Result<BoxConfig, RigFileFaults> LoadBoxConfig(const std::string& path) {
  const auto text = ReadConfigText(path, "camera_box.yaml");
  if (!text) return Failure{text.error()};
  return ParseBoxConfig(*text, path);
}

}  // namespace tbm
