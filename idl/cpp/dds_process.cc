#include "idl/cpp/dds_process.h"

#include <cstdio>
#include <utility>

#include <fmt/format.h>

namespace tbm::dds {

ParticipantConfig ParticipantOf(const DdsNetwork& network, const std::string& name) {
  ParticipantConfig config;
  config.domain_id = network.domain;
  config.name = name;
  config.interfaces = network.interfaces;
  config.peers = network.initial_peers;
  return config;
}

void LogDds(LogLevel level, std::string_view category, std::string_view text) {
  fmt::print(stderr,
             "source=fastdds severity={} category={} text=\"{}\"\n",
             level == LogLevel::kError ? "error" : "warning",
             category,
             text);
}

void LogEvent(const Event& event) {
  fmt::print(stderr,
             "at_utc_ns={} severity={} source={} code={} active={} text=\"{}\"\n",
             event.at.ns,
             SeverityCode(event.severity),
             event.source.view(),
             event.code.view(),
             event.active,
             event.text.view());
}

AlarmHandler AlarmRelay::Handler() {
  return [this](const Alarm& alarm) {
    const std::lock_guard lock(mutex_);
    if (receiver_) {
      receiver_(alarm);
    } else {
      waiting_.push_back(alarm);
    }
  };
}

void AlarmRelay::SendTo(Receiver receiver) {
  const std::lock_guard lock(mutex_);
  receiver_ = std::move(receiver);
  if (!receiver_) return;
  for (const Alarm& alarm : waiting_) receiver_(alarm);
  waiting_.clear();
}

}  // namespace tbm::dds
