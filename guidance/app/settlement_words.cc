#include "guidance/app/settlement_words.h"

#include <cmath>

#include <fmt/format.h>

namespace tbm {
namespace {

// Null where there is none.
const SettlementPlace* WorstAlert(const Settlement& settlement) {
  const DatumShift shift = settlement.epochs.back().datum.value_or(DatumShift{});
  const auto off_m = [&](const SettlementPlace& place) {
    return std::abs(place.changes.back()->dz_m - shift.dz_m);
  };
  const SettlementPlace* worst = nullptr;
  for (const SettlementPlace& place : settlement.places) {
    if (place.alert == 0) continue;
    if (worst == nullptr || off_m(place) > off_m(*worst)) worst = &place;
  }
  return worst;
}

}  // namespace

FileFault Explain(const SettlementFailure& failure, std::span<const LineFile> lines) {
  const LineFile& line = lines[failure.epoch];
  switch (failure.fault) {
    case SettlementFault::kNoLine:
      return {line.file, 0, "distance_m", "no part of it is as long as a step"};
    case SettlementFault::kTurnsBack:
      return {line.file,
              line.line_of_point[failure.point],
              "x_m",
              "the trolley runs back here; give a line that runs one way"};
    case SettlementFault::kNoOverlap:
      return {line.file,
              0,
              "x_m",
              fmt::format("no part of the line is within half a metre, in plan, of {}: another "
                          "track, or coordinates of another frame",
                          lines.front().file)};
  }
  return {};
}

std::string ShiftText(const DatumShift& shift) {
  return fmt::format("the whole line is {:.2f} mm +- {:.2f} {}",
                     1e3 * std::abs(shift.dz_m),
                     1e3 * shift.sigma_m,
                     shift.dz_m < 0.0 ? "lower" : "higher");
}

std::string PeakText(std::string_view what, const SettlementPeak& peak) {
  return fmt::format("{} {:.2f} mm +- {:.2f} at {:.2f} m",
                     what,
                     1e3 * std::abs(peak.dz_m),
                     1e3 * peak.sigma_m,
                     peak.distance_m);
}

std::string SentenceOf(const Settlement& settlement) {
  const EpochSummary& last = settlement.epochs.back();
  std::string text =
      fmt::format("{} of {} places compared", last.compared, settlement.places.size());
  if (last.datum) {
    text += "; the datum may have moved: " + ShiftText(*last.datum);
    if (const SettlementPlace* place = WorstAlert(settlement)) {
      text += fmt::format("; beside it {:+.2f} mm at {:.2f} m",
                          1e3 * (place->changes.back()->dz_m - last.datum->dz_m),
                          place->distance_m);
    }
    return text;
  }
  if (last.settlement) text += "; " + PeakText("settlement", *last.settlement);
  if (last.heave) text += "; " + PeakText("heave", *last.heave);
  if (!last.settlement && !last.heave) text += "; nothing moved that chance would not give";
  return text;
}

}  // namespace tbm
