#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "devices/replay/csv.h"
#include "pose/base/result.h"
#include "pose/base/time.h"

namespace tbm {

// One surveyed point: a row of stamp_ns,point,x_mm,y_mm,z_mm.
struct SurveyRow {
  std::optional<Timestamp> at;  // empty: rows pair in order with what they are compared to
  std::string point;
  double x_mm = 0.0;
  double y_mm = 0.0;
  double z_mm = 0.0;
  int line = 0;  // in the file; not written
};

// Every row of a survey log, in the order of the file. Further columns are ignored.
Result<std::vector<SurveyRow>, FileFault> ReadSurveyCsv(std::string text, const std::string& file);

// The same from either form: such a table, or a Leica GSI file, whose points have no stamps (east,
// north, height become x, y, z, and names lose their leading zeros).
Result<std::vector<SurveyRow>, FileFault> ReadSurvey(std::string text, const std::string& file);

inline constexpr std::string_view kSurveyCsvHeader = "stamp_ns,point,x_mm,y_mm,z_mm\n";

// One line of such a log, with LF: coordinates to a tenth of a micrometre, names in quotes where
// they must be.
std::string SurveyCsvLine(const SurveyRow& row);

}  // namespace tbm
