#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "guidance/rail/rail_line.h"
#include "guidance/rail/trough_fit.h"
#include "pose/base/result.h"

namespace tbm {

// Heights of the same rail in two or more runs (docs/settlement.md).
struct SettlementOptions {
  double step_m = 0.1;  // > 0, from place to place along the base line
  double level = 0.95;  // of the two-sided test at each place, between 0 and 1
  // Ascending, > 0: a change of this size or more, up or down, gives the alert 1, 2, ..; only where
  // it is more than chance gives anywhere on the line, and beside what moved the whole line.
  std::vector<double> alert_m;
};

// Later minus base: settlement is negative, heave positive.
struct HeightChange {
  double dz_m = 0.0;
  double sigma_m = 0.0;
  bool is_significant = false;
};

// Weighted straight line through the heights of all epochs at a place.
struct HeightTrend {
  double rate_m_per_day = 0.0;
  double sigma_m_per_day = 0.0;
  bool is_significant = false;
};

struct SettlementPlace {
  double distance_m = 0.0;                           // along the base line
  std::vector<std::optional<HeightChange>> changes;  // one for each later epoch
  std::optional<HeightTrend> trend;                  // of three or more epochs
  std::size_t alert = 0;                             // of the last epoch; 0: none
};

// The largest change in one direction that chance does not give: so large a one is found anywhere
// on a line that has not moved in less than 1 - level of all cases.
struct SettlementPeak {
  double distance_m = 0.0;
  double dz_m = 0.0;
  double sigma_m = 0.0;
  double from_m = 0.0;  // significant, without a break, from here
  double to_m = 0.0;    // to here
};

// The whole line is higher or lower by the same: rather the datum than the ground.
struct DatumShift {
  double dz_m = 0.0;
  double sigma_m = 0.0;  // as if the errors were the same all along the line: the largest it can be
};

// One later epoch against the base.
struct EpochSummary {
  std::size_t compared = 0;  // places
  std::size_t significant = 0;
  std::optional<SettlementPeak> settlement;
  std::optional<SettlementPeak> heave;
  std::optional<TroughFit> trough;  // of the settlement
  std::optional<DatumShift> datum;
};

// The fastest trend that chance does not give, by the same measure as SettlementPeak.
struct TrendPeak {
  double distance_m = 0.0;
  HeightTrend trend;
};

struct Settlement {
  std::vector<SettlementPlace> places;
  std::vector<EpochSummary> epochs;  // one for each later epoch
  std::optional<TrendPeak> sinking;
  std::optional<TrendPeak> rising;
};

enum class SettlementFault {
  kNoLine,     // fewer than two points that lie apart
  kTurnsBack,  // the trolley ran back on its way
  kNoOverlap,  // nowhere within reach of the base line
};

struct SettlementFailure {
  SettlementFault fault = SettlementFault::kNoLine;
  std::size_t epoch = 0;  // 0: base
  std::size_t point = 0;  // kTurnsBack
};

// How many of `sizes_m`, ascending, a change reaches, up or down.
std::size_t SizesReached(double change_m, std::span<const double> sizes_m);

// How many sigma a normal variable leaves, to either side, in 1 - `level` of all cases.
double TwoSidedBound(double level);

// `epochs`: base first, two or more, in the order of time. Errors of different epochs are taken as
// independent, those of one epoch may hang together as they like.
Result<Settlement, SettlementFailure> CompareEpochs(std::span<const std::vector<RailPoint>> epochs,
                                                    const SettlementOptions& options);

}  // namespace tbm
