#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "idl/cpp/alarm.h"

namespace tbm::dds {

// What stands behind the alarms of one participant: of which topic and whom. So that the end of one
// cause is not taken for the end of all. Knows no DDS and no clock of its own. Not thread-safe.
class AlarmCauses {
 public:
  using Instant = std::chrono::steady_clock::time_point;

  // Nothing tells that samples are in order again: none refused for so long.
  static constexpr std::chrono::seconds kRejectedStands{60};

  // What is to be told of it: with `kind_stands` filled in. Empty for the end of what never began.
  std::optional<Alarm> Told(Alarm alarm, Instant now);

  // What has ended by time alone.
  std::vector<Alarm> Expire(Instant now);

  // All that was known of others is so no longer: what is left is why there is no network.
  std::vector<Alarm> EndOfNetwork();

 private:
  struct Cause {
    Alarm alarm;
    Instant told_at;
  };

  bool Stands(AlarmKind kind) const;
  template <class IsOver>
  std::vector<Alarm> EndAll(const IsOver& is_over, const char* why);

  std::vector<Cause> causes_;
};

}  // namespace tbm::dds
