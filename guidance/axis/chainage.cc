#include "guidance/axis/chainage.h"

#include <algorithm>
#include <utility>

#include "pose/base/check.h"

namespace tbm {
namespace {

bool ComesEarlier(const StationEquation& a, const StationEquation& b) { return a.at < b.at; }

}  // namespace

ChainageEquations::ChainageEquations(std::vector<StationEquation> equations)
    : equations_(std::move(equations)) {
  TBM_CHECK(std::is_sorted(equations_.begin(), equations_.end(), ComesEarlier));
}

OfficialChainage ChainageEquations::ToOfficial(InternalChainage internal) const {
  const auto next =
      std::upper_bound(equations_.begin(),
                       equations_.end(),
                       internal,
                       [](InternalChainage at, const StationEquation& e) { return at < e.at; });
  const auto section = static_cast<int>(next - equations_.begin());
  if (section == 0) return {internal.m, 0};
  const StationEquation& equation = *std::prev(next);
  const double beyond_m = internal.m - equation.at.m;
  return {equation.ahead_m + (equation.is_increasing ? beyond_m : -beyond_m), section};
}

std::optional<InternalChainage> ChainageEquations::ToInternal(OfficialChainage official) const {
  if (official.section < 0 || official.section >= section_count()) return std::nullopt;
  const auto index = static_cast<std::size_t>(official.section);
  InternalChainage internal{official.m};
  if (index > 0) {
    const StationEquation& equation = equations_[index - 1];
    const double beyond_m = official.m - equation.ahead_m;
    if ((equation.is_increasing ? beyond_m : -beyond_m) < 0.0) return std::nullopt;
    internal.m = equation.at.m + (equation.is_increasing ? beyond_m : -beyond_m);
  }
  if (index < equations_.size() && internal >= equations_[index].at) return std::nullopt;
  return internal;
}

std::vector<InternalChainage> ChainageEquations::ToInternal(double official_m,
                                                            InternalChainage first,
                                                            InternalChainage last) const {
  std::vector<InternalChainage> places;
  for (int section = 0; section < section_count(); ++section) {
    const auto internal = ToInternal(OfficialChainage{official_m, section});
    if (internal && *internal >= first && *internal <= last) places.push_back(*internal);
  }
  return places;
}

}  // namespace tbm
