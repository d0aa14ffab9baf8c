#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "devices/total_station/geocom_emulator.h"
#include "pose/base/result.h"

namespace CLI {
class App;
}

namespace tbm {

// What the simulated total station offers on its command line. Times in windows ("@FROM-TO", "@AT")
// are seconds since the program started.
struct StationOptions {
  std::string address = "127.0.0.1";
  int tcp_port = 1212;
  std::string serial_link;  // a pseudo-terminal instead of TCP

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

// All but address, ports and `seed`, which every program has its own of.
void AddStationOptions(CLI::App& app, StationOptions& options);

// A prism where it really stands, in `site`.
struct SimulatedPrism {
  std::string name;
  std::function<Eigen::Vector3d(Timestamp)> p_in_site;
  double constant_m = 0.0;  // what has to be added to a raw distance
};

// The prisms of a CSV: `name_column`,x_m,y_m,z_m in `site`; optional constant_mm (or, as
// in a table of references, prism_constant_mm) and vx_mm_per_s, vy_mm_per_s, vz_mm_per_s. They
// stand there at `start`.
Result<std::vector<SimulatedPrism>, std::string> ReadPrisms(const std::string& path,
                                                            std::string_view name_column,
                                                            Timestamp start);

struct SimulatedStation {
  EmulatedInstrument instrument;
  GeocomEmulatorOptions emulator;
  struct Fault {
    GeocomFault fault;
    double ratio;
  };
  std::vector<Fault> faults;
};

// The instrument that the options describe among these prisms, its windows counting from `start`.
// All faults of the command line at once, one a line.
Result<SimulatedStation, std::string> BuildStation(const StationOptions& options,
                                                   std::vector<SimulatedPrism> prisms,
                                                   Timestamp start);

}  // namespace tbm
