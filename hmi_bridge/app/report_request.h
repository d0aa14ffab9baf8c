#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "guidance/config/axis_file.h"
#include "hmi_bridge/server/console_source.h"
#include "pose/base/result.h"

namespace tbm::hmi {

enum class ReportKind {
  kAxisCheck,  // what is odd in the design axis, and its picture
  kAccuracy,   // the journal against independent shots of a total station
  kExport,     // tables out of the journal
};
// "axis_check", "accuracy", "export".
std::string_view WordOf(ReportKind kind);

// What a surveyor asks for; everything is within bounds.
struct ReportRequest {
  ReportKind kind = ReportKind::kAxisCheck;
  std::vector<std::string> points;        // kAccuracy; empty: all that both know
  std::string shots_text;                 // kAccuracy: the CSV or GSI file itself
  std::optional<std::int64_t> at_utc_ms;  // kAccuracy: time of shots without one
  std::vector<std::string> topics;        // kExport; at least one
  std::int64_t from_utc_ms = 0;           // kExport
  std::int64_t to_utc_ms = 0;
};

// The body of POST /api/reports. 400 with a sentence for anything else.
Result<ReportRequest, ApiFault> ParseReportRequest(std::string_view json);

// Where the programs and files are that reports are made with.
struct ReportPlaces {
  std::string tbm_program;
  std::string axis_file;
  AxisFileOptions axis_options;
  std::string journal_folder;  // empty: this bridge knows of none
};

// One program with its arguments, run without a shell.
using Arguments = std::vector<std::string>;

// What is run one after the other in the report's own folder, in which the shots stand as
// `shots.txt`. 400 when this bridge has no journal to read.
Result<std::vector<Arguments>, ApiFault> CommandsOf(const ReportRequest& request,
                                                    const ReportPlaces& places);

}  // namespace tbm::hmi
