#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "guidance/app/output_file.h"

namespace tbm {

// A command's table, and beside it under the same name as .json what it rests on. The table may go
// to the standard output ("-"); then there is no report.
class TableAndReport {
 public:
  TableAndReport(const std::string& out, bool may_replace)
      : table_(out, may_replace),
        report_(NameOfReport(out), may_replace),
        has_report_(out != "-") {}

  bool has_report() const { return has_report_; }

  std::optional<std::string> Obstacle() const {
    if (has_report_ && report_.path() == table_.path()) {
      return table_.path() + ": .json is the name of the report beside it; give another ending";
    }
    if (auto obstacle = table_.Obstacle()) return obstacle;
    return has_report_ ? report_.Obstacle() : std::nullopt;
  }
  std::optional<std::string> Write(std::string_view table, std::string_view report) const {
    // No table without the report that says what it is worth.
    if (has_report_) {
      if (auto fault = report_.Write(report)) return fault;
    }
    return table_.Write(table);
  }

 private:
  static std::string NameOfReport(const std::string& out) {
    const std::size_t dot = out.rfind('.');
    const std::size_t slash = out.rfind('/');
    const bool has_suffix = dot != std::string::npos && (slash == std::string::npos || dot > slash);
    return (has_suffix ? out.substr(0, dot) : out) + ".json";
  }

  OutputFile table_;
  OutputFile report_;
  bool has_report_;
};

}  // namespace tbm
