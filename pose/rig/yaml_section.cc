#include "pose/rig/yaml_section.h"

#include <filesystem>
#include <fstream>
#include <sstream>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "pose/base/angle.h"

namespace tbm {

bool IsSection(const YamlNode& node) {
  if (!node.exists()) return false;
  if (!node.IsMap()) node.Fault("must be a map of keys");
  return node.IsMap();
}

std::string BesideFile(const std::string& file, const std::string& path) {
  const std::filesystem::path given(path);
  if (path.empty() || given.is_absolute()) return path;
  return (std::filesystem::path(file).parent_path() / given).string();
}

Result<std::string, RigFileFaults> ReadConfigText(const std::string& path, std::string_view what) {
  constexpr std::size_t kLargest = 1'000'000;
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  if (!stream.is_open() || stream.bad()) {
    return Failure{
        RigFileFaults{{path, 0, "", fmt::format("cannot be read; give the path of a {}", what)}}};
  }
  if (text.str().size() > kLargest) {
    return Failure{RigFileFaults{{path, 0, "", "larger than 1 MB: not a configuration"}}};
  }
  return text.str();
}

void YamlSection::Number(
    std::string_view name, double low, double high, std::string_view unit, double* value) {
  const YamlNode member = Know(name);
  if (!member.exists()) return;
  if (const auto number = member.Number({low, high, unit})) *value = *number;
}

void YamlSection::Scaled(std::string_view name,
                         double low,
                         double high,
                         std::string_view unit,
                         double per_si,
                         double* value_si) {
  const YamlNode member = Know(name);
  if (!member.exists()) return;
  if (const auto number = member.Number({low, high, unit})) *value_si = *number / per_si;
}

void YamlSection::Time(std::string_view name,
                       double low_ms,
                       double high_ms,
                       std::chrono::nanoseconds* value) {
  const YamlNode member = Know(name);
  if (!member.exists()) return;
  if (const auto ms = member.Number({low_ms, high_ms, "ms"})) {
    *value = std::chrono::nanoseconds(static_cast<std::int64_t>(*ms * 1e6));
  }
}

void YamlSection::Angle(std::string_view name, double low_deg, double high_deg, double* value_rad) {
  const YamlNode member = Know(name);
  if (!member.exists()) return;
  if (const auto number = member.Number({low_deg, high_deg, "degree"}))
    *value_rad = DegToRad(*number);
}

void YamlSection::Integer(std::string_view name, int low, int high, int* value) {
  const YamlNode member = Know(name);
  if (!member.exists()) return;
  if (const auto number = member.Integer(low, high)) *value = *number;
}

void YamlSection::Text(std::string_view name, std::string* value) {
  const YamlNode member = Know(name);
  if (!member.exists()) return;
  if (const auto text = member.Text()) *value = *text;
}

void YamlSection::Flag(std::string_view name, bool* value) {
  std::string word = *value ? "true" : "false";
  if (Word(name, {"true", "false"}, &word)) *value = word == "true";
}

bool YamlSection::Word(std::string_view name,
                       std::initializer_list<std::string_view> words,
                       std::string* value) {
  const YamlNode member = Know(name);
  if (!member.exists()) return true;
  const auto text = member.Text();
  if (!text) return false;
  for (const std::string_view word : words) {
    if (*text == word) {
      *value = *text;
      return true;
    }
  }
  member.Fault(fmt::format("'{}' is not one of {}", *text, fmt::join(words, ", ")));
  return false;
}

void YamlSection::Texts(std::string_view name, std::vector<std::string>* value) {
  const YamlNode member = Know(name);
  if (!member.exists()) return;
  if (!member.IsList()) {
    member.Fault("must be a list, e.g. [127.0.0.1]");
    return;
  }
  value->clear();
  for (const YamlNode& item : member.Items()) {
    if (const auto text = item.Text()) value->push_back(*text);
  }
}

YamlNode YamlSection::Know(std::string_view name) {
  known_.insert(std::string(name));
  return node_.Optional(name);
}

YamlNode YamlSection::Require(std::string_view name, std::string_view what_would_be_right) {
  known_.insert(std::string(name));
  return node_.Required(name, what_would_be_right);
}

void YamlSection::RefuseOthers() const {
  for (const std::string& name : node_.Names()) {
    if (known_.count(name) != 0) continue;
    node_.Optional(name).Fault(
        fmt::format("nobody reads this key; known here: {}", fmt::join(known_, ", ")));
  }
}

}  // namespace tbm
