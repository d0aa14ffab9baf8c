#pragma once

#include <chrono>
#include <initializer_list>
#include <set>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "pose/rig/rig_yaml.h"

namespace tbm {

// False for an absent section, which keeps its defaults, and for one of the wrong kind, which is a
// fault.
bool IsSection(const YamlNode& node);

// `path` as seen from the folder of `file`; absolute and empty ones stay as they are.
std::string BesideFile(const std::string& file, const std::string& path);

// A file's whole text when it can be read and is not larger than 1 MB; `what` is "camera_box.yaml".
Result<std::string, RigFileFaults> ReadConfigText(const std::string& path, std::string_view what);

// What `read` makes of the text's root, or every fault that it found on the way. Text that is no
// YAML is a fault too.
template <class Read, class Config = std::invoke_result_t<Read, const YamlNode&>>
Result<Config, RigFileFaults> ReadYaml(std::string_view yaml,
                                       const std::string& file,
                                       const Read& read) {
  RigFileFaults faults;
  Config config;
  try {
    config = read(YamlNode(YAML::Load(std::string(yaml)), "", file, &faults));
  } catch (const YAML::Exception& error) {
    faults.push_back({file, error.mark.line + 1, "", "not YAML: " + error.msg});
  }
  if (!faults.empty()) return Failure{std::move(faults)};
  return config;
}

// Reads members of one map into fields that hold their defaults, and remembers which names it
// knows, so that the rest can be refused. An absent member leaves its field untouched to the bit.
class YamlSection {
 public:
  explicit YamlSection(const YamlNode& node) : node_(node) {}

  void Number(std::string_view name, double low, double high, std::string_view unit, double* value);
  // The file says it in `unit`, `per_si` of which are one SI unit: 1000 for mm.
  void Scaled(std::string_view name,
              double low,
              double high,
              std::string_view unit,
              double per_si,
              double* value_si);
  void Time(std::string_view name, double low_ms, double high_ms, std::chrono::nanoseconds* value);
  void Angle(std::string_view name, double low_deg, double high_deg, double* value_rad);
  void Integer(std::string_view name, int low, int high, int* value);
  void Text(std::string_view name, std::string* value);
  void Flag(std::string_view name, bool* value);
  // One of `words`; false and a fault otherwise. True also when the member is absent.
  bool Word(std::string_view name,
            std::initializer_list<std::string_view> words,
            std::string* value);
  void Texts(std::string_view name, std::vector<std::string>* value);

  YamlNode Know(std::string_view name);
  YamlNode Require(std::string_view name, std::string_view what_would_be_right);

  // A mistyped optional key would be lost silently; in a config it is a fault.
  void RefuseOthers() const;

 private:
  YamlNode node_;
  std::set<std::string> known_;
};

}  // namespace tbm
