#include "devices/app/machine_options.h"

#include <utility>

#include <CLI/CLI.hpp>

#include "devices/app/fault_options.h"
#include "devices/app/tunnel_options.h"
#include "pose/base/clock.h"
#include "pose/rig/rig_file.h"

namespace tbm {
namespace {

// Parses every text; what fails adds its line to `problems`.
template <class T, class Parse>
std::vector<T> ParseAll(const std::vector<std::string>& texts, Parse parse, std::string& problems) {
  std::vector<T> values;
  for (const std::string& text : texts) {
    const auto value = parse(text);
    if (value) {
      values.push_back(*value);
    } else {
      problems += value.error() + "\n";
    }
  }
  return values;
}

}  // namespace

void AddMachineOptions(CLI::App& app, MachineOptions& o) {
  app.add_option("--rig", o.rig_file, "rig.yaml of the machine to simulate")->required();
  app.add_option("--address", o.camera.address, "IPv4 address of the camera, on this computer")
      ->capture_default_str();
  app.add_option("--serial", o.camera.serial, "serial number of the camera")->capture_default_str();
  app.add_option(
         "--rate", o.camera.frame_rate_hz, "frames per second until the client sets its own")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 100.0));
  app.add_option("--seed", o.motion.seed, "of motion, noise and hot pixels")->capture_default_str();
  app.add_option("--speed", o.speed, "world seconds per second")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1000.0));
  app.add_option("--distance",
                 o.motion.start_distance_m,
                 "camera to target at the start [m]; with --machine it follows from there")
      ->capture_default_str()
      ->check(CLI::Range(0.5, 20.0));
  app.add_option("--advance", o.advance_mm_per_min, "of the front shield [mm/min]")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 10000.0));
  app.add_option("--vibration", o.vibration_mm, "rms of the target against the camera [mm]")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 10.0));
  app.add_option("--tilt-noise", o.motion.tilt_noise_factor, "times the rig's sigma")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 100.0));
  app.add_option("--led-peak", o.view.led_peak_dn, "of an LED 4 m away, exposed for 5 ms [DN]")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1e5));
  app.add_option("--flicker", o.view.flicker, "rms part by which LEDs vary from frame to frame")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--background", o.view.background_dn, "stray light, exposed for 5 ms [DN]")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1e5));
  app.add_option("--packet-loss", o.camera.lost_packet_ratio, "part of the stream's packets")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--hide-led", o.hidden_leds, "LED[@FROM-TO], world seconds; may be repeated");
  app.add_option("--lamp", o.lamps, "U,V,SPREAD,PEAK[@FROM-TO] in px and DN");
  app.add_option("--reflection", o.reflections, "MIRROR_U,DU,DV,STRENGTH[@FROM-TO] in px");
  app.add_option("--tilt-fault", o.tilt_faults, "target|camera,BETA,GAMMA[@FROM-TO] in degrees");
  app.add_flag("--stamp-sequence", o.camera.stamp_sequence, "count in the frame's first bytes");
  app.add_option(
      "--truth",
      o.truth_file,
      "write truth.csv, one row per exposure; of a machine in its tunnel also NAME_shields"
      ".csv beside it");
  app.add_option("--run-for", o.run_for_s, "end after so many seconds; 0: on a signal");
}

void AddTunnelOptions(CLI::App& app, MachineOptions& o) {
  app.get_option("--rig")->required(false);
  app.add_option("--machine",
                 o.machine_file,
                 "machine.yaml instead of --rig: the machine drives along its design axis");
  app.add_option("--chainage",
                 o.chainage_m,
                 "of the rear shield when the world begins, internal [m]; else 60 m into the axis");
}

std::optional<int> ParseSimulator(CLI::App& app, int argc, char** argv) {
  constexpr int kWrongCommand = 2;
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kWrongCommand;
  }
  return {};
}

Result<SimulatedMachine, std::string> BuildMachine(const MachineOptions& options) {
  std::optional<LoadedTunnel> tunnel;
  if (!options.machine_file.empty()) {
    auto loaded = LoadTunnel(options.machine_file, options.chainage_m);
    if (!loaded) return Failure{loaded.error()};
    tunnel = std::move(loaded).value();
  } else if (options.chainage_m || options.rig_file.empty()) {
    return Failure{std::string("--machine: wanted a machine.yaml, or --rig without a tunnel\n")};
  }
  auto loaded =
      LoadRigFile(tunnel && options.rig_file.empty() ? tunnel->file.rig_file : options.rig_file);
  std::string problems;
  if (!loaded) {
    for (const RigFileFault& fault : loaded.error()) problems += fault.Text() + "\n";
    return Failure{problems};
  }
  const Rig& rig = loaded->rig;
  sim::Motion motion = options.motion;
  motion.advance_m_per_s = options.advance_mm_per_min / 60e3;
  motion.vibration_m = options.vibration_mm * 1e-3;
  sim::Faults faults;
  faults.hidden = ParseAll<sim::HiddenLed>(
      options.hidden_leds,
      [&](const std::string& text) { return ParseHiddenLed(text, rig); },
      problems);
  faults.lamps = ParseAll<sim::Lamp>(options.lamps, ParseLamp, problems);
  faults.reflections = ParseAll<sim::Reflection>(options.reflections, ParseReflection, problems);
  faults.tilts = ParseAll<sim::TiltFault>(options.tilt_faults, ParseTiltFault, problems);
  if (!problems.empty()) return Failure{problems};
  SimulatedMachine machine;
  machine.begins_at = SystemClock().Now();
  machine.world = std::make_shared<sim::World>(
      rig,
      motion,
      std::move(faults),
      machine.begins_at,
      options.speed,
      tunnel ? std::optional(std::move(tunnel->tunnel)) : std::nullopt);
  if (tunnel) machine.file = std::move(tunnel->file);
  return machine;
}

}  // namespace tbm
