#include "guidance/config/xml_element.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "devices/replay/csv.h"
#include "pose/base/parse_number.h"

namespace tbm {
namespace {

constexpr std::size_t kMostFaults = 200;

std::string_view LocalName(std::string_view name) {
  const std::size_t colon = name.find(':');
  return colon == std::string_view::npos ? name : name.substr(colon + 1);
}

}  // namespace

std::vector<std::string_view> WordsOf(std::string_view text) {
  constexpr std::string_view kBlanks = " \t\r\n";
  std::vector<std::string_view> words;
  while (true) {
    const std::size_t first = text.find_first_not_of(kBlanks);
    if (first == std::string_view::npos) return words;
    text.remove_prefix(first);
    const std::size_t end = std::min(text.find_first_of(kBlanks), text.size());
    words.push_back(text.substr(0, end));
    text.remove_prefix(end);
  }
}

XmlSource::XmlSource(std::string_view text, std::string file_name, AxisFileFaults* fault_list)
    : file(std::move(file_name)), faults(fault_list) {
  line_starts.push_back(0);
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '\n') line_starts.push_back(i + 1);
  }
}

int XmlSource::LineOf(std::ptrdiff_t offset) const {
  if (offset < 0) return 0;
  const auto next =
      std::upper_bound(line_starts.begin(), line_starts.end(), static_cast<std::size_t>(offset));
  return static_cast<int>(next - line_starts.begin());
}

XmlElement::XmlElement(pugi::xml_node node, std::string path, const XmlSource* source)
    : node_(node), path_(std::move(path)), source_(source) {
  line_ = source_->LineOf(node_.offset_debug());
}

std::string_view XmlElement::name() const { return LocalName(node_.name()); }

std::vector<XmlElement> XmlElement::Children() const {
  std::vector<XmlElement> children;
  std::map<std::string, int, std::less<>> seen;
  for (const pugi::xml_node& child : node_.children()) {
    if (child.type() != pugi::node_element) continue;
    const std::string_view name = LocalName(child.name());
    auto found = seen.find(name);
    if (found == seen.end()) found = seen.emplace(name, 0).first;
    const int number = ++found->second;
    const std::string below =
        fmt::format("{}{} {}", path_.empty() ? "" : path_ + "/", name, number);
    children.emplace_back(child, below, source_);
  }
  return children;
}

std::vector<XmlElement> XmlElement::Children(std::string_view name) const {
  std::vector<XmlElement> children;
  int number = 0;
  for (const pugi::xml_node& child : node_.children()) {
    if (child.type() != pugi::node_element || LocalName(child.name()) != name) continue;
    children.emplace_back(
        child, fmt::format("{}{} {}", path_.empty() ? "" : path_ + "/", name, ++number), source_);
  }
  return children;
}

std::optional<XmlElement> XmlElement::Child(std::string_view name) const {
  for (const pugi::xml_node& child : node_.children()) {
    if (child.type() != pugi::node_element || LocalName(child.name()) != name) continue;
    return XmlElement(child, fmt::format("{}{}", path_.empty() ? "" : path_ + "/", name), source_);
  }
  return std::nullopt;
}

std::optional<std::string_view> XmlElement::Attribute(std::string_view name) const {
  for (const pugi::xml_attribute& attribute : node_.attributes()) {
    if (name == attribute.name()) return attribute.value();
  }
  return std::nullopt;
}

std::optional<double> XmlElement::ParsedNumber(std::string_view attribute,
                                               std::string_view text,
                                               bool may_be_infinite) const {
  const auto words = WordsOf(text);
  const auto number = words.size() == 1 ? ParseReal(words[0]) : std::nullopt;
  const bool is_fine =
      number && (std::isfinite(*number) || (may_be_infinite && !std::isnan(*number)));
  if (is_fine) return number;
  FaultAt(attribute,
          fmt::format("{} is no number; write digits with '.' as decimal mark{}",
                      Quoted(text),
                      may_be_infinite ? ", or INF" : ""));
  return std::nullopt;
}

std::optional<double> XmlElement::Number(std::string_view attribute) const {
  const auto text = Attribute(attribute);
  if (!text) return std::nullopt;
  return ParsedNumber(attribute, *text, false);
}

std::optional<double> XmlElement::RequiredNumber(std::string_view attribute,
                                                 std::string_view what_would_be_right) const {
  if (!Attribute(attribute)) {
    FaultAt(attribute, fmt::format("is missing; {}", what_would_be_right));
    return std::nullopt;
  }
  return Number(attribute);
}

std::optional<double> XmlElement::RequiredRadius(std::string_view attribute) const {
  const auto text = Attribute(attribute);
  if (!text) {
    FaultAt(attribute, "is missing; write the radius, or INF for the straight end");
    return std::nullopt;
  }
  const auto radius = ParsedNumber(attribute, *text, true);
  if (radius && *radius == 0.0) {
    FaultAt(attribute, "is 0; the straight end of a spiral is written INF");
    return std::nullopt;
  }
  return radius;
}

std::optional<std::size_t> XmlElement::RequiredWord(
    std::string_view attribute, std::initializer_list<std::string_view> words) const {
  const auto text = Attribute(attribute);
  const auto found = text ? std::find(words.begin(), words.end(), *text) : words.end();
  if (found != words.end()) return static_cast<std::size_t>(found - words.begin());
  const std::string choices = fmt::format("{}", fmt::join(words, ", "));
  FaultAt(attribute,
          text ? fmt::format("{} is not known; write one of {}", Quoted(*text), choices)
               : fmt::format("is missing; write one of {}", choices));
  return std::nullopt;
}

std::string_view XmlElement::Text() const { return node_.text().get(); }

std::optional<std::vector<double>> XmlElement::Numbers(std::size_t least,
                                                       std::size_t most,
                                                       std::string_view what_would_be_right) const {
  std::vector<double> numbers;
  for (const std::string_view word : WordsOf(Text())) {
    const auto number = ParseReal(word);
    if (!number || !std::isfinite(*number)) {
      Fault(fmt::format("{} is no number; {}", Quoted(word), what_would_be_right));
      return std::nullopt;
    }
    numbers.push_back(*number);
  }
  if (numbers.size() < least || numbers.size() > most) {
    Fault(fmt::format("holds {} numbers; {}", numbers.size(), what_would_be_right));
    return std::nullopt;
  }
  return numbers;
}

void XmlElement::Fault(std::string what) const {
  if (source_->faults->size() >= kMostFaults) return;
  source_->faults->push_back({source_->file, line_, path_, std::move(what)});
}

void XmlElement::FaultAt(std::string_view attribute, std::string what) const {
  if (source_->faults->size() >= kMostFaults) return;
  source_->faults->push_back(
      {source_->file, line_, fmt::format("{}/@{}", path_, attribute), std::move(what)});
}

}  // namespace tbm
