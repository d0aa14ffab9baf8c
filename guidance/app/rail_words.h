#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "guidance/config/rail_line_file.h"
#include "guidance/rail/rail_line.h"
#include "guidance/rail/rail_tracker.h"
#include "guidance/rail/settlement.h"
#include "idl/cpp/rail_messages.h"

namespace tbm {

inline constexpr std::string_view kRailLineSource = "rail_line";

// The rail line in the words of the contract. published_at and sample_number are left to the
// sender.

// `why_none`: a reason of idl/README.md; empty where the tracker has a place.
dds::TrolleyState TrolleyStateOf(const std::optional<TrolleyPlace>& place,
                                 std::string_view why_none);

// A finished line as it stands in its file.
struct FinishedLine {
  std::string run_id;
  std::string sha256;  // of line.csv
  std::vector<RailPoint> points;
};

// In pieces, thinned out to a point in `step_m`, or in more where there would be too many.
std::vector<dds::RailLinePiece> PiecesOf(const FinishedLine& line, double step_m);

// `settlement` of two epochs. No pieces where there is no place. Where there are too many places,
// the worst of every few: no alert is thinned out.
std::vector<dds::SettlementPiece> PiecesOf(const Settlement& settlement,
                                           const FinishedLine& base,
                                           const FinishedLine& later,
                                           double level);

// The calibrations that rail.yaml holds: of the unit, and of what is built in beside it.
std::vector<dds::CalibrationStatus> CalibrationsOf(const RailSetup& setup,
                                                   const RailLineConfig& config,
                                                   std::string_view rail_yaml_sha256,
                                                   Timestamp now);

}  // namespace tbm
