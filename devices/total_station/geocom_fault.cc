#include "devices/total_station/geocom_fault.h"

#include <algorithm>
#include <array>
#include <utility>

#include "devices/sim/hash_noise.h"

namespace tbm {
namespace {

constexpr std::array<std::pair<std::string_view, GeocomFaultKind>, 14> kWords = {{
    {"late", GeocomFaultKind::kLate},
    {"lost_reply", GeocomFaultKind::kLostReply},
    {"lost_request", GeocomFaultKind::kLostRequest},
    {"missing_values", GeocomFaultKind::kMissingValues},
    {"garbage_before", GeocomFaultKind::kGarbageBefore},
    {"bit_error", GeocomFaultKind::kBitError},
    {"lost_first", GeocomFaultKind::kLostFirst},
    {"split", GeocomFaultKind::kSplit},
    {"glued", GeocomFaultKind::kGlued},
    {"twice", GeocomFaultKind::kTwice},
    {"closes", GeocomFaultKind::kCloses},
    {"return_code", GeocomFaultKind::kReturnCode},
    {"com_code", GeocomFaultKind::kComCode},
    {"wrong_prism", GeocomFaultKind::kWrongPrism},
}};

bool Fits(const GeocomFault& fault, int rpc) { return fault.rpc < 0 || fault.rpc == rpc; }

}  // namespace

std::optional<GeocomFaultKind> GeocomFaultFromWord(std::string_view word) {
  for (const auto& [name, kind] : kWords) {
    if (name == word) return kind;
  }
  return std::nullopt;
}

void GeocomFaultQueue::Add(const GeocomFault& fault, int calls) {
  const std::lock_guard lock(mutex_);
  for (int i = 0; i < calls; ++i) queue_.push_back(fault);
}

void GeocomFaultQueue::Clear() {
  const std::lock_guard lock(mutex_);
  queue_.clear();
  lasting_.clear();
}

void GeocomFaultQueue::AddLasting(const GeocomFault& fault, double ratio, unsigned seed) {
  const std::lock_guard lock(mutex_);
  lasting_.push_back({fault, ratio, seed, 0});
}

std::optional<GeocomFault> GeocomFaultQueue::Take(int rpc) {
  const std::lock_guard lock(mutex_);
  const auto found =
      std::ranges::find_if(queue_, [&](const GeocomFault& fault) { return Fits(fault, rpc); });
  std::optional<GeocomFault> fault;
  if (found != queue_.end() && found->skip > 0) {
    --found->skip;
  } else if (found != queue_.end()) {
    fault = *found;
    queue_.erase(found);
  }
  for (Lasting& one : lasting_) {
    if (fault || !Fits(one.fault, rpc)) continue;
    const double draw = sim::UnitFrom(sim::Mixed(sim::Mixed(one.seed) + ++one.draws));
    if (draw <= one.ratio) fault = one.fault;
  }
  if (fault) ++taken_;
  return fault;
}

int GeocomFaultQueue::taken() const {
  const std::lock_guard lock(mutex_);
  return taken_;
}

}  // namespace tbm
