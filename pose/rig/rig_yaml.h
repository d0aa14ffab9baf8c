#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "pose/rig/rig_file.h"

namespace tbm {

// Allowed values of a number, both ends included unless `above_low`.
struct YamlRange {
  double low = 0.0;
  double high = 0.0;
  std::string_view unit;  // "mm"; empty when there is none
  bool above_low = false;
};

// A node that may be missing, together with where it stands in the file. Every question it cannot
// answer becomes a fault in the list it was made with, and the caller goes on: so one reading finds
// all faults.
class YamlNode {
 public:
  YamlNode(const YAML::Node& node, std::string key, const std::string& file, RigFileFaults* faults);

  bool exists() const { return node_.IsDefined() && !node_.IsNull(); }
  bool IsMap() const { return exists() && node_.IsMap(); }
  bool IsList() const { return exists() && node_.IsSequence(); }
  const std::string& key() const { return key_; }
  int line() const { return line_; }

  // Members. A missing optional member answers exists() == false; a missing required one is a
  // fault.
  YamlNode Optional(std::string_view name) const;
  YamlNode Required(std::string_view name, std::string_view what_would_be_right) const;
  std::vector<std::string> Names() const;  // of a map; names that stand twice are a fault
  std::vector<YamlNode> Items() const;     // of a list

  std::optional<std::string> Text() const;
  std::optional<double> Number(const YamlRange& range) const;
  std::optional<int> Integer(int low, int high) const;
  // A list of exactly `count` numbers.
  std::optional<std::vector<double>> Numbers(std::size_t count, const YamlRange& range) const;

  void Fault(std::string what) const;

 private:
  YamlNode Member(const YAML::Node& node, std::string_view name) const;

  YAML::Node node_;
  std::string key_;
  std::string file_;
  RigFileFaults* faults_;
  int line_ = 0;
};

// A member that must be there and be a map of keys; `hint` says what belongs into it.
YamlNode SectionOf(const YamlNode& parent, std::string_view name, std::string_view hint);

}  // namespace tbm
