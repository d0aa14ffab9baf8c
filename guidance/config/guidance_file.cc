#include "guidance/config/guidance_file.h"

#include <utility>

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include "devices/replay/csv.h"
#include "pose/rig/rig_yaml.h"
#include "pose/rig/yaml_section.h"

namespace tbm {
namespace {

constexpr std::size_t kMostAxisBytes = 256'000'000;
constexpr std::size_t kMostConfigBytes = 1'000'000;

GuidanceConfig Read(const YamlNode& root, const std::string& file) {
  GuidanceConfig config;
  if (!root.IsMap()) {
    root.Fault("is not a map; guidance/app/example/guidance.yaml shows what belongs here");
    return config;
  }
  YamlSection section(root);
  if (const auto machine =
          section.Require("machine", "path of the machine file, e.g. machine.yaml").Text()) {
    config.machine_file = BesideFile(file, *machine);
  }
  ReadDdsSection(section.Know("dds"), &config.dds);
  const YamlNode journal = section.Know("journal");
  if (IsSection(journal)) {
    YamlSection keys(journal);
    keys.Text("folder", &config.journal_folder);
    config.journal_folder = BesideFile(file, config.journal_folder);
    int minutes = static_cast<int>(config.journal_file_length.count());
    keys.Integer("file_length_min", 1, 1440, &minutes);
    config.journal_file_length = std::chrono::minutes(minutes);
    double limit_mb = 1e-6 * static_cast<double>(config.journal_limit_bytes);
    keys.Number("limit_mb", 10.0, 1e7, "MB", &limit_mb);
    config.journal_limit_bytes = static_cast<std::int64_t>(limit_mb * 1e6);
    keys.RefuseOthers();
  }
  section.RefuseOthers();
  return config;
}

void Append(const RigFileFaults& from, MachineFaults* to) {
  for (const RigFileFault& fault : from) to->push_back(fault.Text());
}
void Append(const AxisFileFaults& from, MachineFaults* to) {
  for (const AxisFileFault& fault : from) to->push_back(fault.Text());
}

// The whole file, or nothing and a fault.
std::optional<ReadFile> ReadAll(const std::string& path,
                                std::size_t most_bytes,
                                MachineFaults* faults) {
  auto text = ReadTextFile(path, most_bytes);
  if (text) return ReadFile{path, std::move(text).value()};
  faults->push_back(fmt::format("{}: {}", path, text.error().what));
  return {};
}

}  // namespace

Result<GuidanceConfig, RigFileFaults> ParseGuidanceConfig(std::string_view yaml,
                                                          const std::string& file) {
  return ReadYaml(yaml, file, [&](const YamlNode& root) { return Read(root, file); });
}

Result<GuidanceConfig, RigFileFaults> LoadGuidanceConfig(const std::string& path) {
  const auto text = ReadConfigText(path, "guidance.yaml");
  if (!text) return Failure{text.error()};
  return ParseGuidanceConfig(*text, path);
}

Result<GuidedMachine, MachineFaults> ParseGuidedMachine(const ReadFile& machine_file,
                                                        const ReadFile& rig_file,
                                                        const ReadFile& axis_file,
                                                        MachineFaults* warnings) {
  MachineFaults faults;
  auto machine = ParseMachineFile(machine_file.content, machine_file.path);
  if (!machine) Append(machine.error(), &faults);
  auto rig = ParseRig(rig_file.content, rig_file.path);
  if (!rig) {
    Append(rig.error(), &faults);
  } else {
    Append(rig->warnings, warnings);
  }
  if (!machine) return Failure{faults};
  const auto loaded = ParseAxis(axis_file.content, axis_file.path, machine->axis_options);
  if (!loaded) {
    Append(loaded.error(), &faults);
    return Failure{faults};
  }
  Append(loaded->warnings, warnings);
  auto axis = DesignAxis::Build(loaded->description);
  if (!axis) {
    for (const AxisRemark& remark : axis.error()) {
      faults.push_back(RemarkText(remark, axis_file.path));
    }
  }
  if (!faults.empty()) return Failure{faults};
  return GuidedMachine{machine->machine,
                       rig->rig,
                       std::move(axis).value(),
                       machine->sha256,
                       machine_file,
                       rig_file,
                       axis_file};
}

Result<GuidedMachine, MachineFaults> LoadGuidedMachine(const std::string& machine_path,
                                                       MachineFaults* warnings) {
  MachineFaults faults;
  const auto machine_text = ReadAll(machine_path, kMostConfigBytes, &faults);
  if (!machine_text) return Failure{faults};
  const auto machine = ParseMachineFile(machine_text->content, machine_path);
  if (!machine) {
    Append(machine.error(), &faults);
    return Failure{faults};
  }
  const auto rig_text = ReadAll(machine->rig_file, kMostConfigBytes, &faults);
  const auto axis_text = ReadAll(machine->axis_file, kMostAxisBytes, &faults);
  if (!rig_text || !axis_text) return Failure{faults};
  return ParseGuidedMachine(*machine_text, *rig_text, *axis_text, warnings);
}

}  // namespace tbm
