#include "devices/app/station_config.h"

#include <algorithm>
#include <numbers>
#include <set>

#include <fmt/format.h>

#include "devices/app/reference_table.h"
#include "pose/base/angle.h"
#include "pose/base/check.h"
#include "pose/rig/yaml_section.h"

namespace tbm {
namespace {

constexpr double kFarthest_m = 1e8;  // of a coordinate: grid coordinates have seven digits
constexpr std::size_t kMostReferences = 16;

constexpr double kPerMm = 1e3;
constexpr double kPerArcsec = 180.0 * 3600.0 / std::numbers::pi;

void Seconds(
    YamlSection& section, std::string_view name, double low, double high, Duration* value) {
  double seconds = 1e-9 * static_cast<double>(value->count());
  section.Number(name, low, high, "s", &seconds);
  *value = Duration(static_cast<std::int64_t>(1e9 * seconds));
}

// A number that has no value when it is left out.
void Optional(YamlSection& section,
              std::string_view name,
              double low,
              double high,
              std::string_view unit,
              double per_si,
              std::optional<double>* value) {
  const YamlNode member = section.Know(name);
  if (!member.exists()) return;
  if (const auto number = member.Number({low, high, unit})) *value = *number / per_si;
}

std::optional<Eigen::Vector3d> Point(const YamlNode& node) {
  const auto numbers = node.Numbers(3, {-kFarthest_m, kFarthest_m, "m"});
  if (!numbers) return {};
  return Eigen::Vector3d((*numbers)[0], (*numbers)[1], (*numbers)[2]);
}

// A key of DDS: 1 to 32 bytes.
void Name(YamlSection& section, std::string_view name, std::string* value) {
  section.Text(name, value);
  if (value->empty() || value->size() > 32) {
    section.Know(name).Fault("must have 1 to 32 characters");
  }
}

class Reader {
 public:
  explicit Reader(std::string file) : file_(std::move(file)) {}

  StationConfig Read(const YamlNode& root) {
    StationConfig config;
    if (!root.IsMap()) {
      root.Fault("the file must be a map with machine, instrument, start, references, state_file");
      return config;
    }
    YamlSection section(root);
    const auto machine = section.Require("machine", "path of the machine file, e.g. machine.yaml");
    if (const auto text = machine.Text()) config.machine_file = BesideFile(file_, *text);
    Name(section, "station", &config.station);
    const auto state =
        section.Require("state_file", "where the set-up is kept, e.g. station.state");
    if (const auto text = state.Text()) config.state_file = BesideFile(file_, *text);
    ReadInstrument(section.Require("instrument", "a map with driver: geocom_tcp | geocom_serial"),
                   &config);
    ReadAccuracy(section.Know("accuracy"), &config);
    ReadDistance(section.Know("distance"), &config);
    ReadStart(section.Require("start", "a map with xyz_m and circle_zero_deg, roughly"), &config);
    ReadShieldStart(section.Know("rear_shield_start"), &config);
    ReadReferences(root, section, &config);
    ReadSchedule(section.Know("schedule"), &config);
    ReadTolerances(section.Know("tolerances"), &config);
    ReadDdsSection(section.Know("dds"), &config.dds);
    section.RefuseOthers();
    return config;
  }

 private:
  void ReadInstrument(const YamlNode& node, StationConfig* config) {
    if (!IsSection(node)) return;
    YamlSection section(node);
    TotalStationConfig& instrument = config->instrument;
    std::string driver;
    section.Require("driver", "geocom_tcp or geocom_serial");
    section.Word("driver", {"geocom_tcp", "geocom_serial"}, &driver);
    if (!driver.empty()) instrument.driver = *TotalStationDriverFromWord(driver);
    section.Text("address", &instrument.address);
    section.Integer("tcp_port", 1, 65535, &instrument.tcp_port);
    section.Text("port", &instrument.port.path);
    section.Integer("baud", 1200, 921600, &instrument.port.baud);
    std::string parity = "none";
    section.Word("parity", {"none", "even", "odd"}, &parity);
    instrument.port.parity = parity == "even"  ? Parity::kEven
                             : parity == "odd" ? Parity::kOdd
                                               : Parity::kNone;
    section.Integer("stop_bits", 1, 2, &instrument.port.stop_bits);
    std::string checksum = "auto";
    section.Word("checksum", {"auto", "on", "off"}, &checksum);
    instrument.checksum = checksum == "on"    ? ChecksumUse::kOn
                          : checksum == "off" ? ChecksumUse::kOff
                                              : ChecksumUse::kAuto;
    section.Time("connect_timeout_ms", 50, 60'000, &instrument.connect_timeout);
    section.Time("answer_timeout_ms", 50, 60'000, &instrument.answer_timeout);
    section.Time("measure_timeout_ms", 100, 120'000, &instrument.measure_timeout);
    section.Time("motion_timeout_ms", 100, 300'000, &instrument.motion_timeout);
    section.Time("first_back_off_ms", 10, 60'000, &instrument.first_back_off);
    section.Time("longest_back_off_ms", 10, 600'000, &instrument.longest_back_off);
    section.Number("longest_distance_m", 10, 10'000, "m", &instrument.longest_distance_m);
    Seconds(section, "silent_after_s", 1, 3600, &config->silent_after);
    section.Number("low_power_percent", 0, 100, "%", &config->low_power_percent);
    section.RefuseOthers();
    for (const std::string& fault : CheckTotalStationConfig(instrument)) {
      // "total_station.<key>: <what>"
      const std::size_t dot = fault.find('.');
      const std::size_t colon = fault.find(": ", dot);
      TBM_CHECK(colon != std::string::npos);
      node.Optional(fault.substr(dot + 1, colon - dot - 1)).Fault(fault.substr(colon + 2));
    }
  }

  void ReadAccuracy(const YamlNode& node, StationConfig* config) {
    if (!IsSection(node)) return;
    YamlSection section(node);
    KeeperOptions& keeper = config->keeper;
    section.Scaled("angle_sigma_arcsec", 0.05, 60, "arcsec", kPerArcsec, &keeper.angle_sigma_rad);
    section.Scaled("slope_sigma_mm", 0.05, 50, "mm", kPerMm, &keeper.slope_sigma_m);
    section.Number("slope_sigma_ppm", 0, 50, "ppm", &keeper.slope_sigma_ppm);
    section.Scaled(
        "axis_error_arcsec", 1, 600, "arcsec", kPerArcsec, &keeper.largest_axis_error_rad);
    section.RefuseOthers();
  }

  void ReadDistance(const YamlNode& node, StationConfig* config) {
    if (!IsSection(node)) return;
    YamlSection section(node);
    DistanceConfig& distance = config->distance;
    section.Number("temperature_celsius", -30, 60, "celsius", &distance.air.temperature_celsius);
    section.Number("pressure_hpa", 500, 1200, "hPa", &distance.air.pressure_hpa);
    section.Number("humidity_percent", 0, 100, "%", &distance.air.humidity_percent);
    section.Number("carrier_um", 0.4, 1.6, "um", &distance.meter.wavelength_um);
    section.Number("reference_ppm", 200, 400, "ppm", &distance.meter.reference_ppm);
    section.Scaled("prism_constant_mm", -100, 100, "mm", kPerMm, &config->prism_constant_m);
    Optional(section,
             "assumed_prism_constant_mm",
             -100,
             100,
             "mm",
             kPerMm,
             &distance.assumed_prism_constant_m);
    Optional(section, "assumed_ppm", -500, 500, "ppm", 1.0, &distance.assumed_ppm);
    SetUpOptions& set_up = config->keeper.set_up;
    section.Number("refraction_k", -5, 5, "", &set_up.sight.refraction_k);
    section.Number("refraction_k_sigma", 0, 5, "", &set_up.refraction_k_sigma);
    section.Scaled("earth_radius_km", 6300, 6400, "km", 1e-3, &set_up.sight.earth_radius_m);
    section.Number("grid_scale", 0.999, 1.001, "", &set_up.sight.grid_scale);
    config->keeper.check.sight = set_up.sight;
    section.RefuseOthers();
  }

  void ReadStart(const YamlNode& node, StationConfig* config) {
    if (!IsSection(node)) return;
    YamlSection section(node);
    KeeperOptions& keeper = config->keeper;
    const auto point =
        Point(section.Require("xyz_m", "east, north, up where it stands, e.g. [1, 2, 3]"));
    if (point) keeper.start.p_axes_in_site = *point;
    section.Require("circle_zero_deg", "bearing of the circle's zero from north, roughly");
    section.Angle("circle_zero_deg", -360, 360, &keeper.start.circle_zero_bearing_rad);
    keeper.start.circle_zero_bearing_rad = Turn(keeper.start.circle_zero_bearing_rad);
    std::optional<double> known_sigma_m;
    Optional(section, "known_sigma_mm", 0.05, 100, "mm", kPerMm, &known_sigma_m);
    if (known_sigma_m) keeper.known = {known_sigma_m, known_sigma_m, known_sigma_m, {}};
    section.Number("within_m", 0.1, 100, "m", &keeper.start_within_m);
    section.Angle("within_deg", 0.1, 90, &keeper.start_within_rad);
    section.Angle("window_horizontal_deg", 0.1, 90, &keeper.window.horizontal_rad);
    section.Angle("window_vertical_deg", 0.1, 90, &keeper.window.vertical_rad);
    section.RefuseOthers();
  }

  void ReadShieldStart(const YamlNode& node, StationConfig* config) {
    if (!IsSection(node)) return;
    YamlSection section(node);
    const auto point = Point(
        section.Require("xyz_m", "the rear shield's datum in site, e.g. [1034.2, 2050.8, 50.3]"));
    double heading_rad = 0.0;
    double pitch_rad = 0.0;
    section.Require("heading_deg", "of the machine, clockwise from north");
    section.Angle("heading_deg", -360, 360, &heading_rad);
    section.Angle("pitch_deg", -30, 30, &pitch_rad);
    section.RefuseOthers();
    if (!point) return;
    // x forward, y left: a heading turns clockwise from north, a raised nose turns about -y.
    const Eigen::Quaterniond rotation =
        Eigen::AngleAxisd(0.5 * std::numbers::pi - heading_rad, Eigen::Vector3d::UnitZ()) *
        Eigen::AngleAxisd(-pitch_rad, Eigen::Vector3d::UnitY());
    config->keeper.shield_start = Rigid3{rotation, *point};
  }

  void ReadReferences(const YamlNode& root, YamlSection& section, StationConfig* config) {
    const YamlNode list = section.Know("references");
    const YamlNode file = section.Know("references_file");
    if (!list.exists() == !file.exists()) {
      root.Fault(
          "wanted either references (a list with name, xyz_m, sigma_mm) or references_file (a CSV "
          "name,x_m,y_m,z_m,sigma_mm)");
      return;
    }
    std::vector<ReferenceRow> rows;
    if (file.exists()) {
      const auto text = file.Text();
      if (!text) return;
      auto read = ReadReferenceTable(BesideFile(file_, *text));
      if (!read) {
        file.Fault(read.error());
        return;
      }
      rows = std::move(read).value();
    } else if (!list.IsList()) {
      list.Fault("must be a list with name, xyz_m, sigma_mm");
      return;
    } else {
      for (const YamlNode& item : list.Items()) rows.push_back(ReadReference(item));
    }
    const YamlNode& where = file.exists() ? file : list;
    if (rows.empty() || rows.size() > kMostReferences) {
      where.Fault(fmt::format("{} references; wanted 1 .. {}", rows.size(), kMostReferences));
      return;
    }
    std::set<std::string> names;
    for (const ReferenceRow& row : rows) {
      if (row.name.empty() || row.name.size() > 32) {
        where.Fault("a reference's name must have 1 to 32 characters");
      }
      if (!names.insert(row.name).second) {
        where.Fault(fmt::format("'{}' names two references; names must differ", row.name));
      }
      config->keeper.references.push_back({row.name, {row.p_in_site, row.sigma_m}, row.is_control});
      config->reference_constants_m.push_back(row.constant_m);
    }
    const auto used = std::ranges::count(rows, false, &ReferenceRow::is_control);
    const bool is_free = !config->keeper.known[0];
    if (used < (is_free ? 2 : 1)) {
      where.Fault(is_free ? "a free station needs two references that are no controls"
                          : "a known station needs one reference that is no control");
    }
  }

  ReferenceRow ReadReference(const YamlNode& node) {
    ReferenceRow row;
    if (!IsSection(node)) return row;
    YamlSection section(node);
    section.Require("name", "the reference's name, e.g. R1");
    section.Text("name", &row.name);
    const auto point = Point(section.Require("xyz_m", "east, north, up, e.g. [1, 2, 3]"));
    if (point) row.p_in_site = *point;
    section.Require("sigma_mm", "what one coordinate is worth, e.g. 1");
    section.Scaled("sigma_mm", 0, 100, "mm", kPerMm, &row.sigma_m);
    section.Scaled("prism_constant_mm", -100, 100, "mm", kPerMm, &row.constant_m);
    section.Flag("control", &row.is_control);
    section.RefuseOthers();
    return row;
  }

  void ReadSchedule(const YamlNode& node, StationConfig* config) {
    if (!IsSection(node)) return;
    YamlSection section(node);
    KeeperOptions& keeper = config->keeper;
    Seconds(section, "cycle_period_s", 0, 3600, &keeper.cycle_period);
    Seconds(section, "check_period_s", 5, 86'400, &keeper.check_period);
    Seconds(section, "doubt_period_s", 1, 3600, &keeper.doubt_period);
    Seconds(section, "retry_period_s", 1, 3600, &keeper.retry_period);
    section.Flag("checks_in_two_faces", &keeper.checks_in_two_faces);
    section.RefuseOthers();
    keeper.watch.remembered = std::max<Duration>(std::chrono::seconds(60), 3 * keeper.cycle_period);
  }

  void ReadTolerances(const YamlNode& node, StationConfig* config) {
    if (!IsSection(node)) return;
    YamlSection section(node);
    KeeperOptions& keeper = config->keeper;
    section.Scaled("closure_mm", 0.1, 100, "mm", kPerMm, &keeper.closure_tolerance_m);
    double minutes = 1e-9 / 60.0 * static_cast<double>(keeper.control_max_age.count());
    section.Number("control_max_age_min", 1, 10'080, "min", &minutes);
    keeper.control_max_age = Duration(static_cast<std::int64_t>(60e9 * minutes));
    section.Scaled("must_see_mm", 0.5, 1000, "mm", kPerMm, &keeper.must_see_m);
    section.Scaled("station_sigma_mm", 0.1, 100, "mm", kPerMm, &keeper.set_up.worst_sigma_m);
    section.Scaled(
        "orientation_sigma_arcsec", 0.5, 600, "arcsec", kPerArcsec, &keeper.set_up.worst_sigma_rad);
    section.Scaled("gross_mm", 10, 10'000, "mm", kPerMm, &keeper.gross_m);
    section.Scaled("prism_floor_mm", 0.1, 100, "mm", kPerMm, &keeper.watch.floor_m);
    section.Scaled("machine_speed_mm_per_s",
                   0.01,
                   50,
                   "mm/s",
                   kPerMm,
                   &keeper.watch.unknown_speed_sigma_m_per_s);
    section.Integer("missed_rounds", 1, 1000, &config->missed_rounds);
    section.RefuseOthers();
  }

  std::string file_;
};

}  // namespace

Result<StationConfig, RigFileFaults> ParseStationConfig(std::string_view yaml,
                                                        const std::string& file) {
  return ReadYaml(yaml, file, [&](const YamlNode& root) { return Reader(file).Read(root); });
}

Result<StationConfig, RigFileFaults> LoadStationConfig(const std::string& path) {
  const auto text = ReadConfigText(path, "total_station.yaml");
  if (!text) return Failure{text.error()};
  return ParseStationConfig(*text, path);
}

KeeperOptions KeeperOptionsOf(const StationConfig& config, const Machine& machine) {
  KeeperOptions options = config.keeper;
  for (const NamedPrism& named : machine.prisms) {
    options.prisms.push_back({named.name, named.prism.p_in_rear_shield, named.prism.sigma_m});
  }
  return options;
}

}  // namespace tbm
