#include "pose/rig/rig_yaml.h"

#include <cmath>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "pose/base/parse_number.h"

namespace tbm {
namespace {

std::string Shortened(std::string text) {
  constexpr std::size_t kLongest = 40;
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  }
  if (text.size() > kLongest) text = text.substr(0, kLongest) + "..";
  return text;
}

std::string RangeText(const YamlRange& range) {
  return fmt::format("allowed is {}{} .. {}{}{}",
                     range.above_low ? "more than " : "",
                     range.low,
                     range.high,
                     range.unit.empty() ? "" : " ",
                     range.unit);
}

}  // namespace

YamlNode::YamlNode(const YAML::Node& node,
                   std::string key,
                   const std::string& file,
                   RigFileFaults* faults)
    : node_(node), key_(std::move(key)), file_(file), faults_(faults) {
  if (node_.IsDefined() && !node_.Mark().is_null()) line_ = node_.Mark().line + 1;
}

YamlNode YamlNode::Member(const YAML::Node& node, std::string_view name) const {
  const std::string key = key_.empty() ? std::string(name) : key_ + "." + std::string(name);
  YamlNode member(node, key, file_, faults_);
  if (member.line_ == 0) member.line_ = line_;
  return member;
}

YamlNode YamlNode::Optional(std::string_view name) const {
  // Walking the pairs instead of operator[]: that one compares every key as a string and throws on
  // a key that is itself a map.
  if (IsMap()) {
    for (const auto& pair : node_) {
      if (pair.first.IsScalar() && pair.first.Scalar() == name) return Member(pair.second, name);
    }
  }
  return Member(YAML::Node(YAML::NodeType::Undefined), name);
}

YamlNode YamlNode::Required(std::string_view name, std::string_view what_would_be_right) const {
  YamlNode member = Optional(name);
  // A parent that is itself missing or of the wrong kind has had its fault already.
  if (IsMap() && !member.exists()) member.Fault(fmt::format("missing; {}", what_would_be_right));
  return member;
}

std::vector<std::string> YamlNode::Names() const {
  std::vector<std::string> names;
  if (!IsMap()) return names;
  std::set<std::string> seen;
  for (const auto& pair : node_) {
    if (!pair.first.IsScalar()) {
      Fault("a key must be a plain word");
      continue;
    }
    const std::string name = pair.first.Scalar();
    if (seen.insert(name).second) {
      names.push_back(name);
    } else {
      Member(pair.first, Shortened(name)).Fault("stands here for the second time; keep one");
    }
  }
  return names;
}

std::vector<YamlNode> YamlNode::Items() const {
  std::vector<YamlNode> items;
  if (!IsList()) return items;
  for (std::size_t i = 0; i < node_.size(); ++i) {
    items.emplace_back(node_[i], fmt::format("{}[{}]", key_, i), file_, faults_);
    if (items.back().line_ == 0) items.back().line_ = line_;
  }
  return items;
}

std::optional<std::string> YamlNode::Text() const {
  if (!exists()) return std::nullopt;
  if (!node_.IsScalar()) {
    Fault("must be a plain word");
    return std::nullopt;
  }
  return node_.Scalar();
}

std::optional<double> YamlNode::Number(const YamlRange& range) const {
  if (!exists()) return std::nullopt;
  if (!node_.IsScalar()) {
    Fault(fmt::format("must be one number; {}", RangeText(range)));
    return std::nullopt;
  }
  const auto number = ParseReal(node_.Scalar());
  if (!number) {
    Fault(fmt::format("'{}' is not a number; {}", Shortened(node_.Scalar()), RangeText(range)));
    return std::nullopt;
  }
  const bool is_inside = std::isfinite(*number) && *number <= range.high &&
                         (range.above_low ? *number > range.low : *number >= range.low);
  if (!is_inside) {
    Fault(fmt::format("{} is outside; {}", *number, RangeText(range)));
    return std::nullopt;
  }
  return number;
}

std::optional<int> YamlNode::Integer(int low, int high) const {
  if (!exists()) return std::nullopt;
  const auto number = node_.IsScalar() ? ParseInteger(node_.Scalar()) : std::nullopt;
  if (!number || *number < low || *number > high) {
    const std::string value = node_.IsScalar() ? Shortened(node_.Scalar()) : "a list or map";
    Fault(fmt::format("'{}' must be an integer of {} .. {}", value, low, high));
    return std::nullopt;
  }
  return static_cast<int>(*number);
}

std::optional<std::vector<double>> YamlNode::Numbers(std::size_t count,
                                                     const YamlRange& range) const {
  if (!exists()) return std::nullopt;
  if (!node_.IsSequence() || node_.size() != count) {
    const std::string found =
        node_.IsSequence() ? fmt::format("has {}", node_.size()) : "is no list";
    Fault(fmt::format("must be a list of {} numbers, {}; {}", count, found, RangeText(range)));
    return std::nullopt;
  }
  std::vector<double> numbers;
  for (const YamlNode& item : Items()) {
    if (!item.exists()) item.Fault(fmt::format("is empty; {}", RangeText(range)));
    if (const auto number = item.Number(range)) numbers.push_back(*number);
  }
  if (numbers.size() != count) return std::nullopt;
  return numbers;
}

void YamlNode::Fault(std::string what) const {
  // A file of nothing but faults must not fill the memory with sentences.
  constexpr std::size_t kMostFaults = 200;
  if (faults_->size() < kMostFaults) faults_->push_back({file_, line_, key_, std::move(what)});
}

YamlNode SectionOf(const YamlNode& parent, std::string_view name, std::string_view hint) {
  YamlNode section = parent.Required(name, hint);
  if (section.exists() && !section.IsMap()) section.Fault(fmt::format("must be a map {}", hint));
  return section;
}

}  // namespace tbm
