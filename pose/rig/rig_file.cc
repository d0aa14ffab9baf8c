#include "pose/rig/rig_file.h"

#include <fstream>
#include <set>

#include <fmt/format.h>

#include "pose/rig/rig_sections.h"
#include "pose/rig/rig_yaml.h"

namespace tbm {
namespace {

constexpr std::size_t kMostBytes = 1 << 20;

class RigReader {
 public:
  explicit RigReader(const std::string& file) : file_(file) {}

  void Read(const YAML::Node& document) {
    const YamlNode root(document, "", file_, &faults_);
    if (!root.IsMap()) {
      root.Fault("must be a map with the keys camera, target, inclinometers and points");
      return;
    }
    Known(root, {"rig_name", "camera", "target", "inclinometers", "points"});
    rig_.name = root.Optional("rig_name").Text().value_or("");
    const KnownKeys known = [this](const YamlNode& map, const std::set<std::string_view>& keys) {
      Known(map, keys);
    };
    ReadCameraSection(
        SectionOf(root, "camera", "the layout of a ROS camera_info file goes here"), known, &rig_);
    ReadTargetSection(SectionOf(root, "target", "with the list `leds`"), known, &rig_.leds);
    const YamlNode mounts = SectionOf(root, "inclinometers", "with `target` and `camera`");
    if (mounts.IsMap()) {
      Known(mounts, {"target", "camera"});
      ReadTiltMount(SectionOf(mounts, "target", kTiltMountRule), known, &rig_.target_tilt);
      ReadTiltMount(SectionOf(mounts, "camera", kTiltMountRule), known, &rig_.camera_tilt);
    }
    ReadPointsSection(root.Optional("points"), known, &rig_.points);
  }

  Rig& rig() { return rig_; }
  RigFileFaults& faults() { return faults_; }
  RigFileFaults& warnings() { return warnings_; }

 private:
  // Says which keys nobody reads: `mounting_sigma_dg` would otherwise silently promise a perfect
  // mounting. Double keys become faults inside Names().
  void Known(const YamlNode& map, const std::set<std::string_view>& known) {
    for (const std::string& name : map.Names()) {
      if (known.contains(name)) continue;
      std::string list;
      for (const std::string_view word : known)
        list += (list.empty() ? "" : ", ") + std::string(word);
      const YamlNode member = map.Optional(name);
      warnings_.push_back({file_,
                           member.line(),
                           member.key(),
                           fmt::format("is read by nobody; known here are {}", list)});
    }
  }

  std::string file_;
  Rig rig_;
  RigFileFaults faults_;
  RigFileFaults warnings_;
};

Failure<RigFileFaults> WholeFile(const std::string& file, int line, std::string what) {
  return Failure{RigFileFaults{{file, line, "", std::move(what)}}};
}

}  // namespace

std::string RigFileFault::Text() const {
  std::string text = file;
  if (line > 0) text += fmt::format(":{}", line);
  if (!key.empty()) text += ": " + key;
  return text + ": " + what;
}

Result<LoadedRig, RigFileFaults> ParseRig(std::string_view yaml, const std::string& file) {
  if (yaml.size() > kMostBytes)
    return WholeFile(file, 0, "is larger than 1 MB; this is no rig file");
  if (yaml.find('\0') != std::string_view::npos) {
    return WholeFile(file, 0, "holds zero bytes; a rig file is UTF-8 text");
  }
  try {
    RigReader reader(file);
    reader.Read(YAML::Load(std::string(yaml)));
    if (!reader.faults().empty()) return Failure{std::move(reader.faults())};
    return LoadedRig{std::move(reader.rig()), std::move(reader.warnings())};
  } catch (const YAML::Exception& error) {
    const int line = error.mark.is_null() ? 0 : error.mark.line + 1;
    return WholeFile(file, line, fmt::format("is not YAML: {}", error.msg));
  } catch (const std::exception& error) {
    return WholeFile(file, 0, fmt::format("cannot be read as YAML: {}", error.what()));
  }
}

Result<LoadedRig, RigFileFaults> LoadRigFile(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  if (!stream)
    return WholeFile(
        path, 0, "cannot be opened; a run folder needs it (camera, LEDs, inclinometers)");
  std::string text(kMostBytes + 1, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (stream.bad()) return WholeFile(path, 0, "cannot be read");
  text.resize(static_cast<std::size_t>(stream.gcount()));
  return ParseRig(text, path);
}

}  // namespace tbm
