#include "idl/cpp/alarm_causes.h"

#include <algorithm>
#include <utility>

namespace tbm::dds {

bool AlarmCauses::Stands(AlarmKind kind) const {
  return std::any_of(
      causes_.begin(), causes_.end(), [&](const Cause& cause) { return cause.alarm.kind == kind; });
}

std::optional<Alarm> AlarmCauses::Told(Alarm alarm, Instant now) {
  const auto known = std::find_if(causes_.begin(), causes_.end(), [&](const Cause& cause) {
    return cause.alarm.kind == alarm.kind && cause.alarm.topic == alarm.topic &&
           cause.alarm.subject == alarm.subject;
  });
  if (alarm.active) {
    alarm.kind_stands = true;
    if (known == causes_.end()) {
      causes_.push_back({alarm, now});
    } else {
      *known = {alarm, now};
    }
    return alarm;
  }
  if (known == causes_.end()) return {};
  causes_.erase(known);
  alarm.kind_stands = Stands(alarm.kind);
  return alarm;
}

template <class IsOver>
std::vector<Alarm> AlarmCauses::EndAll(const IsOver& is_over, const char* why) {
  std::vector<Alarm> ended;
  while (true) {
    const auto over = std::find_if(causes_.begin(), causes_.end(), is_over);
    if (over == causes_.end()) return ended;
    Alarm alarm = std::move(over->alarm);
    causes_.erase(over);
    alarm.active = false;
    alarm.kind_stands = Stands(alarm.kind);
    alarm.text = why;
    ended.push_back(std::move(alarm));
  }
}

std::vector<Alarm> AlarmCauses::Expire(Instant now) {
  return EndAll(
      [&](const Cause& cause) {
        return cause.alarm.kind == AlarmKind::kRejected && now - cause.told_at > kRejectedStands;
      },
      "no sample was refused for a minute");
}

std::vector<Alarm> AlarmCauses::EndOfNetwork() {
  return EndAll(
      [](const Cause& cause) {
        const bool is_of_the_process = cause.alarm.topic.empty();
        return !is_of_the_process || cause.alarm.kind == AlarmKind::kInterfaceMismatch;
      },
      "the network has ended: nothing is known of it");
}

}  // namespace tbm::dds
