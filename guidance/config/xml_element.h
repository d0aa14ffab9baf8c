#pragma once

#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <pugixml.hpp>

#include "guidance/config/axis_file.h"

namespace tbm {

// The document an element belongs to: where its lines begin, and what has been found wrong in it.
struct XmlSource {
  std::string file;
  std::vector<std::size_t> line_starts;  // offset of the first character of each line
  AxisFileFaults* faults = nullptr;

  XmlSource(std::string_view text, std::string file_name, AxisFileFaults* fault_list);
  int LineOf(std::ptrdiff_t offset) const;  // 0 for an unknown offset
};

// An element, together with the path to it. Prefixes of namespaces are passed over: `l:Line` is a
// `Line`. Every question it cannot answer becomes a fault, and the caller goes on, so that one
// reading finds all of them.
class XmlElement {
 public:
  XmlElement(pugi::xml_node node, std::string path, const XmlSource* source);

  std::string_view name() const;  // without prefix
  const std::string& path() const { return path_; }
  int line() const { return line_; }

  // Children of that name, or all, in the file's order; numbered from 1 among their like.
  std::vector<XmlElement> Children(std::string_view name) const;
  std::vector<XmlElement> Children() const;
  std::optional<XmlElement> Child(std::string_view name) const;  // the first

  std::optional<std::string_view> Attribute(std::string_view name) const;

  // Finite numbers. Missing optional ones are empty and no fault.
  std::optional<double> Number(std::string_view attribute) const;
  std::optional<double> RequiredNumber(std::string_view attribute,
                                       std::string_view what_would_be_right) const;
  // "INF" is welcome as well.
  std::optional<double> RequiredRadius(std::string_view attribute) const;
  // One of the words; the index of it.
  std::optional<std::size_t> RequiredWord(std::string_view attribute,
                                          std::initializer_list<std::string_view> words) const;
  // The numbers of the element's text, at least `least` and at most `most` of them.
  std::optional<std::vector<double>> Numbers(std::size_t least,
                                             std::size_t most,
                                             std::string_view what_would_be_right) const;
  std::string_view Text() const;

  void Fault(std::string what) const;
  void FaultAt(std::string_view attribute, std::string what) const;

 private:
  std::optional<double> ParsedNumber(std::string_view attribute,
                                     std::string_view text,
                                     bool may_be_infinite) const;

  pugi::xml_node node_;
  std::string path_;
  const XmlSource* source_;
  int line_ = 0;
};

// Words between blanks and line ends.
std::vector<std::string_view> WordsOf(std::string_view text);

}  // namespace tbm
