#pragma once

#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "devices/total_station/geocom_emulator.h"
#include "pose/base/result.h"

namespace tbm {

// What the simulated total station offers on its command line. Times in windows ("@FROM-TO", "@AT")
// are seconds since the program started.
struct StationOptions {
  std::string address = "127.0.0.1";
  int tcp_port = 1212;
  std::string serial_link;  // a pseudo-terminal instead of TCP
  std::string prisms_file;
  double run_for_s = 0.0;  // 0: until a signal comes

  std::string station = "0,0,0";
  double circle_zero_deg = 0.0;
  std::string drift_mm_per_h = "0,0,0";
  double drift_arcsec_per_h = 0.0;
  double lean_east_arcsec = 0.0;
  double lean_north_arcsec = 0.0;

  double angle_sigma_arcsec = 1.0;
  double slope_sigma_mm = 0.6;
  double collimation_arcsec = 0.0;
  double trunnion_arcsec = 0.0;
  double index_arcsec = 0.0;
  double lateral_bend_arcsec_per_100m = 0.0;
  EmulatedErrors errors;

  double distance_ms = 900.0;
  double recognition_ms = 600.0;
  double turn_deg_per_s = 45.0;
  double late_ms = 6000.0;
  bool has_no_checksum = false;
  GeocomEmulatorOptions emulator;

  std::vector<std::string> hidden;
  std::vector<std::string> swaps;
  std::vector<std::string> knocks;
  std::vector<std::string> faults;
};

void AddStationOptions(CLI::App& app, StationOptions& options);

struct SimulatedStation {
  EmulatedInstrument instrument;
  GeocomEmulatorOptions emulator;
  struct Fault {
    GeocomFault fault;
    double ratio;
  };
  std::vector<Fault> faults;
};

// The instrument that the options describe, its world's time beginning at `start`. All faults of
// the command line and of the prisms file at once, one a line.
//
// The prisms file is a CSV: prism,x_m,y_m,z_m in `site`; optional constant_mm (what has to be added
// to a raw distance) and vx_mm_per_s, vy_mm_per_s, vz_mm_per_s.
Result<SimulatedStation, std::string> BuildStation(const StationOptions& options, Timestamp start);

}  // namespace tbm
