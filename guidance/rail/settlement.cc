#include "guidance/rail/settlement.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "guidance/rail/chance.h"
#include "guidance/rail/line_places.h"

namespace tbm {
namespace {

constexpr double kSecondsPerDay = 86400.0;
// So much of the line has to agree with one shift for the datum to be suspected.
constexpr double kShiftedPart = 0.75;

std::optional<HeightTrend> TrendOf(const std::vector<std::optional<PlaceHeight>>& heights,
                                   double bound) {
  const PlaceHeight& base = *heights.front();
  double weight = 0.0;
  double mean_days = 0.0;
  double mean_m = 0.0;
  const auto days = [&](const PlaceHeight& height) {
    return SecondsBetween(base.at, height.at) / kSecondsPerDay;
  };
  std::size_t count = 0;
  for (const auto& height : heights) {
    if (!height) continue;
    const double w = 1.0 / (height->sigma_m * height->sigma_m);
    weight += w;
    mean_days += w * days(*height);
    mean_m += w * (height->z_world_m - base.z_world_m);
    ++count;
  }
  if (count < 3) return std::nullopt;
  mean_days /= weight;
  mean_m /= weight;
  double normal = 0.0;
  double right = 0.0;
  for (const auto& height : heights) {
    if (!height) continue;
    const double w = 1.0 / (height->sigma_m * height->sigma_m);
    const double off_days = days(*height) - mean_days;
    normal += w * off_days * off_days;
    right += w * off_days * (height->z_world_m - base.z_world_m - mean_m);
  }
  if (!(normal > 0.0)) return std::nullopt;
  const double rate = right / normal;
  const double sigma = 1.0 / std::sqrt(normal);
  return HeightTrend{rate, sigma, std::abs(rate) > bound * sigma};
}

// The places where an epoch is compared with the base.
struct Compared {
  std::vector<double> distance_m;
  std::vector<HeightChange> changes;
};

Compared ComparedOf(const std::vector<SettlementPlace>& places, std::size_t epoch) {
  Compared compared;
  for (const SettlementPlace& place : places) {
    if (!place.changes[epoch]) continue;
    compared.distance_m.push_back(place.distance_m);
    compared.changes.push_back(*place.changes[epoch]);
  }
  return compared;
}

// `direction` is -1 for settlement, +1 for heave.
std::optional<SettlementPeak> PeakOf(const Compared& compared, double direction, double level) {
  std::optional<std::size_t> peak;
  for (std::size_t i = 0; i < compared.changes.size(); ++i) {
    const HeightChange& change = compared.changes[i];
    if (direction * change.dz_m <= 0.0) continue;
    if (!IsMoreThanChance(change.dz_m, change.sigma_m, compared.changes.size(), level)) continue;
    if (!peak || direction * change.dz_m > direction * compared.changes[*peak].dz_m) peak = i;
  }
  if (!peak) return std::nullopt;
  const auto belongs = [&](std::size_t i) {
    return compared.changes[i].is_significant && direction * compared.changes[i].dz_m > 0.0;
  };
  std::size_t from = *peak;
  while (from > 0 && belongs(from - 1)) --from;
  std::size_t to = *peak;
  while (to + 1 < compared.changes.size() && belongs(to + 1)) ++to;
  return SettlementPeak{compared.distance_m[*peak],
                        compared.changes[*peak].dz_m,
                        compared.changes[*peak].sigma_m,
                        compared.distance_m[from],
                        compared.distance_m[to]};
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::optional<DatumShift> DatumOf(const Compared& compared, double bound) {
  std::vector<double> dz_m;
  std::vector<double> sigma_m;
  for (const HeightChange& change : compared.changes) {
    dz_m.push_back(change.dz_m);
    sigma_m.push_back(change.sigma_m);
  }
  const DatumShift shift{Median(std::move(dz_m)), Median(std::move(sigma_m))};
  if (std::abs(shift.dz_m) <= bound * shift.sigma_m) return std::nullopt;
  const auto agreeing = [&](double offset_m) {
    return std::count_if(
        compared.changes.begin(), compared.changes.end(), [&](const HeightChange& change) {
          return std::abs(change.dz_m - offset_m) <= bound * change.sigma_m;
        });
  };
  const auto with_shift = static_cast<double>(agreeing(shift.dz_m));
  const double count = static_cast<double>(compared.changes.size());
  if (with_shift < kShiftedPart * count || agreeing(0.0) >= agreeing(shift.dz_m)) {
    return std::nullopt;
  }
  return shift;
}

EpochSummary SummaryOf(const std::vector<SettlementPlace>& places,
                       std::size_t epoch,
                       const SettlementOptions& options) {
  const Compared compared = ComparedOf(places, epoch);
  EpochSummary summary;
  summary.compared = compared.changes.size();
  summary.significant = static_cast<std::size_t>(std::count_if(
      compared.changes.begin(), compared.changes.end(), [](const HeightChange& change) {
        return change.is_significant;
      }));
  summary.settlement = PeakOf(compared, -1.0, options.level);
  summary.heave = PeakOf(compared, 1.0, options.level);
  summary.datum = DatumOf(compared, TwoSidedBound(options.level));
  if (!summary.settlement) return summary;
  std::vector<TroughSample> samples;
  for (std::size_t i = 0; i < compared.changes.size(); ++i) {
    samples.push_back(
        {compared.distance_m[i], compared.changes[i].dz_m, compared.changes[i].sigma_m});
  }
  summary.trough = FitTrough(samples, summary.settlement->distance_m);
  return summary;
}

// `direction` is -1 for what sinks, +1 for what rises.
std::optional<TrendPeak> TrendPeakOf(const std::vector<SettlementPlace>& places,
                                     double direction,
                                     double level) {
  const auto count = static_cast<std::size_t>(std::count_if(
      places.begin(), places.end(), [](const SettlementPlace& place) { return !!place.trend; }));
  std::optional<TrendPeak> peak;
  for (const SettlementPlace& place : places) {
    if (!place.trend || direction * place.trend->rate_m_per_day <= 0.0) continue;
    const HeightTrend& trend = *place.trend;
    if (!IsMoreThanChance(trend.rate_m_per_day, trend.sigma_m_per_day, count, level)) continue;
    if (peak && direction * trend.rate_m_per_day <= direction * peak->trend.rate_m_per_day) {
      continue;
    }
    peak = TrendPeak{place.distance_m, trend};
  }
  return peak;
}

// Where the whole line moved, what moved beside it; the sum of two sigmas is the most that the
// difference can have.
void SetAlerts(const SettlementOptions& options, Settlement* settlement) {
  const EpochSummary& last = settlement->epochs.back();
  const DatumShift shift = last.datum.value_or(DatumShift{});
  for (SettlementPlace& place : settlement->places) {
    const auto& change = place.changes.back();
    if (!change) continue;
    const double dz_m = change->dz_m - shift.dz_m;
    const double sigma_m = change->sigma_m + shift.sigma_m;
    if (IsMoreThanChance(dz_m, sigma_m, last.compared, options.level)) {
      place.alert = SizesReached(dz_m, options.alert_m);
    }
  }
}

}  // namespace

std::size_t SizesReached(double change_m, std::span<const double> sizes_m) {
  return static_cast<std::size_t>(std::count_if(
      sizes_m.begin(), sizes_m.end(), [&](double m) { return std::abs(change_m) >= m; }));
}

double TwoSidedBound(double level) {
  double low = 0.0;
  double high = 40.0;
  while (high - low > 1e-12) {
    const double middle = 0.5 * (low + high);
    if (TwoSidedTail(middle) > 1.0 - level) {
      low = middle;
    } else {
      high = middle;
    }
  }
  return 0.5 * (low + high);
}

Result<Settlement, SettlementFailure> CompareEpochs(std::span<const std::vector<RailPoint>> epochs,
                                                    const SettlementOptions& options) {
  TBM_CHECK(epochs.size() >= 2);
  std::vector<PlanLine> lines;
  for (std::size_t i = 0; i < epochs.size(); ++i) {
    lines.emplace_back(epochs[i]);
    if (const auto point = lines.back().TurnsBackAt()) {
      return Failure{SettlementFailure{SettlementFault::kTurnsBack, i, *point}};
    }
  }
  const std::vector<LinePlace> places = lines.front().EqualPlaces(options.step_m);
  if (places.empty()) return Failure{SettlementFailure{SettlementFault::kNoLine, 0, 0}};
  const double bound = TwoSidedBound(options.level);
  Settlement settlement;
  for (const LinePlace& place : places) {
    std::vector<std::optional<PlaceHeight>> heights;
    for (const PlanLine& line : lines) heights.push_back(line.HeightAt(place));
    SettlementPlace compared;
    compared.distance_m = place.distance_m;
    compared.changes.resize(epochs.size() - 1);
    for (std::size_t i = 1; heights.front() && i < heights.size(); ++i) {
      if (!heights[i]) continue;
      const double dz_m = heights[i]->z_world_m - heights.front()->z_world_m;
      const double sigma_m = std::hypot(heights[i]->sigma_m, heights.front()->sigma_m);
      compared.changes[i - 1] = HeightChange{dz_m, sigma_m, std::abs(dz_m) > bound * sigma_m};
    }
    if (heights.front()) compared.trend = TrendOf(heights, bound);
    settlement.places.push_back(std::move(compared));
  }
  for (std::size_t epoch = 0; epoch + 1 < epochs.size(); ++epoch) {
    const bool is_compared = std::any_of(
        settlement.places.begin(), settlement.places.end(), [&](const SettlementPlace& place) {
          return place.changes[epoch].has_value();
        });
    if (!is_compared) {
      return Failure{SettlementFailure{SettlementFault::kNoOverlap, epoch + 1, 0}};
    }
    settlement.epochs.push_back(SummaryOf(settlement.places, epoch, options));
  }
  SetAlerts(options, &settlement);
  settlement.sinking = TrendPeakOf(settlement.places, -1.0, options.level);
  settlement.rising = TrendPeakOf(settlement.places, 1.0, options.level);
  return settlement;
}

}  // namespace tbm
