#include "guidance/config/machine_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include <Eigen/LU>
#include <Eigen/SVD>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <yaml-cpp/yaml.h>

#include "guidance/config/sha256.h"
#include "pose/base/angle.h"
#include "pose/rig/rig_yaml.h"
#include "pose/rig/yaml_section.h"

namespace tbm {
namespace {

constexpr double kMmPerM = 1000.0;
constexpr std::size_t kLongestPrismName = 16;  // two of them stand in one remark on the wire
constexpr std::size_t kLongestName = 32;
constexpr YamlRange kCoordinateMm{-50'000.0, 50'000.0, "mm"};

// Names become columns of tables and stand beside each other in remarks.
bool IsName(std::string_view text, std::size_t longest) {
  const auto is_fine = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-' || c == '.';
  };
  return !text.empty() && text.size() <= longest && std::all_of(text.begin(), text.end(), is_fine);
}

// A place [x, y, z] that must be given, and the sigma of its coordinates.
struct Place {
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  double sigma_m = 0.0;
};
Place ReadPlace(YamlSection* section, std::string_view frame) {
  Place place;
  const auto xyz_mm = section->Require("xyz_mm", fmt::format("[x, y, z] in {}, in mm", frame))
                          .Numbers(3, kCoordinateMm);
  if (xyz_mm) place.p = Eigen::Vector3d((*xyz_mm)[0], (*xyz_mm)[1], (*xyz_mm)[2]) / kMmPerM;
  section->Scaled("sigma_mm", 0.0, 1000.0, "mm", kMmPerM, &place.sigma_m);
  return place;
}

// Rounding in the seventh decimal is taken out; what is further from a rotation than that is a slip
// of the pen, or too few decimals.
Eigen::Quaterniond ReadRotation(const YamlNode& node) {
  constexpr double kMostDisorder = 1e-6;
  const auto r = node.Numbers(9, {-1.000001, 1.000001, ""});
  if (!r) return Eigen::Quaterniond::Identity();
  Eigen::Matrix3d rotation;
  for (int i = 0; i < 9; ++i) rotation(i / 3, i % 3) = (*r)[static_cast<std::size_t>(i)];
  const double disorder =
      (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (disorder > kMostDisorder) {
    node.Fault(fmt::format(
        "is not a rotation: its rows are off unit length or right angles by {:.2g}; allowed is 0 "
        ".. {:g}, so write seven decimals",
        disorder,
        kMostDisorder));
    return Eigen::Quaterniond::Identity();
  }
  if (rotation.determinant() < 0.0) {
    node.Fault("is a mirror image, not a rotation (determinant -1): one axis points the wrong way");
    return Eigen::Quaterniond::Identity();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(rotation, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return Eigen::Quaterniond(Eigen::Matrix3d(svd.matrixU() * svd.matrixV().transpose()))
      .normalized();
}

class MachineReader {
 public:
  explicit MachineReader(std::string file) : file_(std::move(file)) {}

  MachineFile Read(const YamlNode& root) {
    if (!root.IsMap()) {
      root.Fault("the file must be a map with machine_id, rig, axis, built_in, prisms, points");
      return {};
    }
    YamlSection section(root);
    ReadId(section.Require("machine_id", "the machine's name, e.g. TBM-1"));
    const YamlNode rig = section.Require("rig", "path of the rig file, e.g. rig.yaml");
    read_.rig_file = ReadPath(rig);
    ReadAxis(section.Require("axis", "a map with file: axis.xml"));
    ReadBuiltIn(section.Require("built_in",
                                "a map with rear_shield_from_camera and front_shield_from_target"));
    ReadPrisms(section.Require("prisms", "a map: RS1: {xyz_mm: [x, y, z], sigma_mm: 0.3}"));
    ReadPoints(section.Require(
        "points", "a map: cutter_face: {shield: front, xyz_mm: [x, y, z], sigma_mm: 0.2}"));
    ReadSteerBy(section.Require("steer_by", "the name of a point on the front shield"));
    ReadRings(section.Know("rings"));
    ReadClosedJoint(section.Know("closed_joint_mm"));
    ReadSources(section.Know("sources"));
    ReadTrust(section.Know("trust"));
    ReadTrend(section.Know("trend"));
    ReadAlarms(section.Know("alarms"));
    section.RefuseOthers();
    return std::move(read_);
  }

 private:
  Machine& machine() { return read_.machine; }

  void ReadId(const YamlNode& node) {
    machine().machine_id = node.Text().value_or("");
    const std::size_t size = machine().machine_id.size();
    if (node.exists() && (size == 0 || size > kLongestName)) {
      node.Fault("must have 1 to 32 characters");
    }
  }

  std::string ReadPath(const YamlNode& node) const {
    const auto path = node.Text();
    if (!path) return {};
    if (path->empty()) node.Fault("is empty; give the path of a file, relative to this one");
    return BesideFile(file_, *path);
  }

  void ReadAxis(const YamlNode& node) {
    if (!IsSection(node)) return;
    YamlSection section(node);
    read_.axis_file = ReadPath(section.Require("file", "LandXML or a table, e.g. axis.xml"));
    section.Text("alignment", &read_.axis_options.alignment);
    section.Text("profile", &read_.axis_options.profile);
    if (const auto origin = section.Know("site_origin_m").Numbers(3, {-1e8, 1e8, "m"})) {
      read_.axis_options.site_origin = {(*origin)[0], (*origin)[1], (*origin)[2]};
    }
    section.RefuseOthers();
  }

  void ReadBuiltIn(const YamlNode& node) {
    if (!IsSection(node)) return;
    YamlSection section(node);
    constexpr std::string_view kRight = "a map with xyz_mm and rotation";
    machine().geometry.rear_shield_from_camera =
        ReadPlacement(section.Require("rear_shield_from_camera", kRight), "rear_shield");
    machine().geometry.front_shield_from_target =
        ReadPlacement(section.Require("front_shield_from_target", kRight), "front_shield");
    section.RefuseOthers();
  }

  static UncertainRigid3 ReadPlacement(const YamlNode& node, std::string_view frame) {
    UncertainRigid3 placed;
    if (!IsSection(node)) return placed;
    YamlSection section(node);
    const Place place = ReadPlace(&section, frame);
    placed.b_from_a.translation = place.p;
    placed.b_from_a.rotation =
        ReadRotation(section.Require("rotation", "nine numbers, row by row"));
    double sigma_rad = 0.0;
    section.Angle("sigma_deg", 0.0, 10.0, &sigma_rad);
    placed.covariance.diagonal().head<3>().setConstant(sigma_rad * sigma_rad);
    placed.covariance.diagonal().tail<3>().setConstant(place.sigma_m * place.sigma_m);
    section.RefuseOthers();
    return placed;
  }

  // The members of a map of 1 .. `most` named things, in the order of the file.
  static std::vector<std::pair<std::string, YamlNode>> Named(const YamlNode& node,
                                                             std::string_view kind,
                                                             std::size_t most,
                                                             std::size_t longest) {
    std::vector<std::pair<std::string, YamlNode>> named;
    if (!IsSection(node)) return named;
    const std::vector<std::string> names = node.Names();
    if (names.empty() || names.size() > most) {
      node.Fault(fmt::format("has {} {}; allowed is 1 .. {}", names.size(), kind, most));
      return named;
    }
    for (const std::string& name : names) {
      const YamlNode member = node.Optional(name);
      if (!IsName(name, longest)) {
        member.Fault(
            fmt::format("a name must be 1 to {} letters, digits, '_', '-' or '.'", longest));
      } else if (!member.exists()) {
        member.Fault("is empty; give {xyz_mm: [x, y, z], sigma_mm: 0.3}");
      } else if (IsSection(member)) {
        named.emplace_back(name, member);
      }
    }
    return named;
  }

  void ReadPrisms(const YamlNode& node) {
    constexpr double kClosest_m = 0.05;
    for (const auto& [name, member] : Named(node, "prisms", kMaxPrisms, kLongestPrismName)) {
      YamlSection section(member);
      const Place place = ReadPlace(&section, "rear_shield");
      section.RefuseOthers();
      for (const NamedPrism& other : machine().prisms) {
        if ((other.prism.p_in_rear_shield - place.p).norm() >= kClosest_m) continue;
        member.Fault(fmt::format("is less than 50 mm from {}; the station cannot tell them apart",
                                 other.name));
      }
      machine().prisms.push_back({name, {place.p, place.sigma_m}});
    }
  }

  void ReadPoints(const YamlNode& node) {
    for (const auto& [name, member] : Named(node, "points", kMaxGuidedPoints, kLongestName)) {
      YamlSection section(member);
      MachinePoint point;
      point.name = name;
      std::string shield;
      section.Require("shield", "front or rear");
      if (section.Word("shield", {"front", "rear"}, &shield)) {
        point.shield = shield == "rear" ? ShieldName::kRear : ShieldName::kFront;
      }
      const Place place =
          ReadPlace(&section, point.shield == ShieldName::kRear ? "rear_shield" : "front_shield");
      point.p_in_shield = place.p;
      point.sigma_m = place.sigma_m;
      section.RefuseOthers();
      machine().points.push_back(std::move(point));
    }
  }

  void ReadSteerBy(const YamlNode& node) {
    const auto name = node.Text();
    if (!name) return;
    std::vector<std::string_view> possible;
    for (std::size_t i = 0; i < machine().points.size(); ++i) {
      const MachinePoint& point = machine().points[i];
      if (point.shield != ShieldName::kFront) continue;
      possible.push_back(point.name);
      if (point.name == *name) {
        machine().steer_by = i;
        return;
      }
    }
    node.Fault(fmt::format("'{}' is no point on the front shield; {}",
                           *name,
                           possible.empty() ? "there is none in points"
                                            : fmt::format("there: {}", fmt::join(possible, ", "))));
  }

  void ReadRings(const YamlNode& node) {
    if (!IsSection(node)) return;
    YamlSection section(node);
    RingCount rings;
    const auto first = section.Require("first_number", "the number of the first ring, e.g. 1")
                           .Integer(0, 1'000'000);
    const auto at_m =
        section.Require("first_chainage_m", "internal chainage where the first ring begins")
            .Number({-1e6, 1e6, "m"});
    const auto length_mm =
        section.Require("length_mm", "length of one ring, e.g. 1500").Number({100.0, 5000.0, "mm"});
    section.RefuseOthers();
    rings.first_number = first.value_or(1);
    rings.first_chainage_m = at_m.value_or(0.0);
    rings.length_m = length_mm.value_or(1500.0) / kMmPerM;
    machine().rings = rings;
  }

  void ReadClosedJoint(const YamlNode& node) {
    if (const auto mm = node.Number({-50'000.0, 50'000.0, "mm"})) {
      machine().closed_joint_m = *mm / kMmPerM;
    }
  }

  void ReadSources(const YamlNode& node) {
    if (!IsSection(node)) return;
    YamlSection section(node);
    ReadSource(section.Know("station"), &machine().station);
    ReadSource(section.Know("camera"), &machine().camera);
    ReadSource(section.Know("tilt"), &machine().tilt);
    section.Number("fix_window_s", 1.0, 3600.0, "s", &machine().fix_window_s);
    section.RefuseOthers();
  }

  static void ReadSource(const YamlNode& node, SourceLimits* limits) {
    if (!IsSection(node)) return;
    YamlSection section(node);
    section.Number("period_s", 0.01, 86'400.0, "s", &limits->period_s);
    section.Number("stale_after_s", 0.01, 86'400.0, "s", &limits->stale_after_s);
    section.RefuseOthers();
    // Up to two periods a source counts as fresh.
    if (limits->stale_after_s < 2.0 * limits->period_s) {
      node.Fault(fmt::format("stale_after_s {} must be at least twice period_s {}",
                             limits->stale_after_s,
                             limits->period_s));
    }
  }

  void ReadTrust(const YamlNode& node) {
    if (!IsSection(node)) return;
    YamlSection section(node);
    section.Scaled("useful_sigma_mm", 1.0, 1000.0, "mm", kMmPerM, &machine().useful_sigma_m);
    const YamlNode coast = section.Know("coast");
    section.RefuseOthers();
    if (!IsSection(coast)) return;
    CoastOptions& rates = machine().coast;
    YamlSection law(coast);
    constexpr double kPerMinute = 60.0 * kMmPerM;
    law.Scaled("along_mm_per_min", 0.0, 1000.0, "mm/min", kPerMinute, &rates.along_m_per_s);
    law.Scaled("across_mm_per_min", 0.0, 1000.0, "mm/min", kPerMinute, &rates.across_m_per_s);
    law.Scaled("turn_mm_per_m_per_min", 0.0, 100.0, "mm/m/min", kPerMinute, &rates.turn_rad_per_s);
    law.RefuseOthers();
  }

  void ReadTrend(const YamlNode& node) {
    if (!IsSection(node)) return;
    YamlSection section(node);
    TrackOptions& track = machine().track;
    section.Number("length_m", 0.5, 100.0, "m", &machine().trend_length_m);
    section.Scaled("steering_mm_per_m", 0.001, 100.0, "mm/m", kMmPerM, &track.steering_per_sqrt_m);
    section.Scaled("crab_mm_per_m", 0.001, 100.0, "mm/m", kMmPerM, &track.crab_sigma_per_m);
    section.Scaled(
        "start_slope_mm_per_m", 0.001, 1000.0, "mm/m", kMmPerM, &track.start_slope_sigma);
    section.Scaled("least_step_mm", 1.0, 10'000.0, "mm", kMmPerM, &track.least_step_m);
    section.Scaled("back_mm", 1.0, 100'000.0, "mm", kMmPerM, &track.back_m);
    section.RefuseOthers();
  }

  void ReadAlarms(const YamlNode& node) {
    if (!IsSection(node)) return;
    YamlSection section(node);
    ReadLimit(section.Know("deviation"), "mm", &machine().deviation_m);
    ReadLimit(section.Know("predicted_deviation"), "mm", &machine().predicted_deviation_m);
    ReadLimit(section.Know("roll"), "mm_per_m", &machine().roll_rad);
    ReadLimit(section.Know("sigma"), "mm", &machine().sigma_m);
    section.RefuseOthers();
  }

  // Both in thousandths of the SI unit.
  static void ReadLimit(const YamlNode& node, std::string_view unit, AlarmLimit* limit) {
    if (!IsSection(node)) return;
    YamlSection section(node);
    const std::string raise = fmt::format("raise_above_{}", unit);
    const std::string clear = fmt::format("clear_below_{}", unit);
    section.Scaled(raise, 0.1, 10'000.0, unit, kMmPerM, &limit->raise_above);
    section.Scaled(clear, 0.1, 10'000.0, unit, kMmPerM, &limit->clear_below);
    section.RefuseOthers();
    if (limit->clear_below > limit->raise_above) {
      node.Fault(fmt::format("{} {:g} must not be above {} {:g}",
                             clear,
                             limit->clear_below * kMmPerM,
                             raise,
                             limit->raise_above * kMmPerM));
    }
  }

  std::string file_;
  MachineFile read_;
};

}  // namespace

Result<MachineFile, RigFileFaults> ParseMachineFile(std::string_view yaml,
                                                    const std::string& file) {
  return ReadYaml(yaml, file, [&](const YamlNode& root) {
    MachineFile read = MachineReader(file).Read(root);
    read.sha256 = Sha256(yaml);
    return read;
  });
}

Result<MachineFile, RigFileFaults> LoadMachineFile(const std::string& path) {
  const auto text = ReadConfigText(path, "machine.yaml");
  if (!text) return Failure{text.error()};
  return ParseMachineFile(*text, path);
}

}  // namespace tbm
