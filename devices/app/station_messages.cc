#include "devices/app/station_messages.h"

#include <fmt/format.h>

namespace tbm {
namespace {

dds::StationSetUp EmptySetUp(const StationNames& names, std::string_view role) {
  dds::StationSetUp message;
  message.machine_id = std::string_view(names.machine_id);
  message.role = role;
  message.station = std::string_view(names.station);
  return message;
}

void Fill(const KeeperOptions& options, const KeptSetUp& kept, dds::StationSetUp* message) {
  message->set_up_number = kept.number;
  message->set_up_at = kept.set_up_at;
  message->last_good_check_at = kept.last_good_check_at;
  message->position_in_site_m = kept.station.p_axes_in_site;
  message->circle_zero_bearing_rad = kept.station.circle_zero_bearing_rad;
  message->covariance = kept.covariance;
  message->chi2 = kept.chi2;
  message->dof = kept.dof;
  message->sees_m = kept.sees_m.value_or(dds::kNaN);
  const std::size_t rows = std::min(kept.references.size(), options.references.size());
  for (std::size_t i = 0; i < rows && !message->references.full(); ++i) {
    const KeptReference& row = kept.references[i];
    dds::ReferenceState state;
    state.name = std::string_view(row.name);
    state.position_in_site_m = options.references[i].reference.p_in_site;
    state.used = row.is_used;
    state.reason = std::string_view(row.reason);
    if (row.residual) {
      state.across_m = row.residual->across_m;
      state.up_m = row.residual->up_m;
      state.slope_m = row.residual->slope_m.value_or(dds::kNaN);
      state.standardised = row.residual->standardised;
      state.checked_share = std::clamp(row.residual->checked_share, 0.0, 1.0);
    }
    message->references.push_back(state);
  }
}

}  // namespace

std::array<AlarmRule, kStationAlarmCount> StationAlarmRules(const StationConfig& config) {
  using enum AlarmPriority;
  std::array<AlarmRule, kStationAlarmCount> rules;
  const auto at = [&rules](StationAlarm alarm) -> AlarmRule& {
    return rules[static_cast<std::size_t>(alarm)];
  };
  at(StationAlarm::kStationMoved) = {
      "station_moved",
      kHigh,
      "The total station's bracket has moved or turned",
      "Do not steer by what came after the last good check. Look at bracket and lining; when it "
      "stands firm, ask for set_up."};
  at(StationAlarm::kSetUpMissing) = {
      "station_set_up_missing",
      kHigh,
      "The total station does not know where it stands",
      "Free the sight to the references, aim roughly at one of them, and ask for set_up with the "
      "station's rough place."};
  at(StationAlarm::kSetUpSuspect) = {"station_set_up_suspect",
                                     kHigh,
                                     "Nothing vouches for the station's set-up any more",
                                     "Free the sight to the references and ask for "
                                     "check_references; if it stays, ask for set_up."};
  at(StationAlarm::kReferenceDisagrees) = {
      "reference_disagrees",
      kMedium,
      "A reference does not stand where the others say",
      "Look at that prism and its bolt. Have it surveyed anew or take it out of the configuration, "
      "then ask for set_up."};
  at(StationAlarm::kStationSilent) = {
      "station_silent",
      kHigh,
      "The total station does not answer",
      "Check its power, the radio or cable, and that nobody works at its keys."};
  at(StationAlarm::kPrismNotFound) = {
      "prism_not_found",
      kMedium,
      "A prism of the shield was not found",
      "Clear the line of sight, clean the prism, and see that its cover is open."};
  at(StationAlarm::kWrongPrism) = {
      "wrong_prism",
      kMedium,
      "What was measured is not the prism that was meant",
      "Look for reflecting vests, lamps and strange prisms near the line of sight; compare the "
      "prism's place with machine.yaml."};
  at(StationAlarm::kSwappedPrism) = {
      "swapped_prism",
      kMedium,
      "Two prisms of the shield stand in each other's place",
      "Put the prisms back to their places, or correct their names in machine.yaml."};
  at(StationAlarm::kStationTilted) = {"station_tilted",
                                      kHigh,
                                      "The total station leans more than its compensator takes up",
                                      "Level the total station, then ask for set_up."};
  at(StationAlarm::kLowPower) = {"low_power",
                                 kLow,
                                 "The total station's battery is nearly empty",
                                 "Change the battery or connect external power."};
  at(StationAlarm::kSetUpMissing).raise_after = std::chrono::seconds(60);
  at(StationAlarm::kStationSilent).raise_after = config.silent_after;
  AlarmRule& missed = at(StationAlarm::kPrismNotFound);
  missed.raise_above = config.missed_rounds - 0.5;
  AlarmRule& power = at(StationAlarm::kLowPower);  // of a full charge, what is gone
  power.raise_above = 100.0 - config.low_power_percent;
  power.clear_below = std::max(0.0, power.raise_above - 10.0);
  return rules;
}

dds::StationObservation ObservationOf(const StationNames& names,
                                      const KeeperOptions& options,
                                      const Judged& judged,
                                      const Pointed& pointed,
                                      const std::optional<PolarObservation>& measured) {
  dds::StationObservation message;
  message.machine_id = std::string_view(names.machine_id);
  message.station = std::string_view(names.station);
  message.sensed_at = pointed.at;
  message.set_up_number = judged.set_up_number;
  message.cycle_number = judged.cycle_number;
  const auto index = static_cast<std::size_t>(judged.target.index);
  const bool is_prism = judged.target.kind == TargetKind::kPrism;
  message.kind = is_prism ? dds::ObservedKind::kPrism : dds::ObservedKind::kReference;
  message.target =
      std::string_view(is_prism ? options.prisms[index].name : options.references[index].name);
  message.face =
      judged.face == Face::kOne ? dds::ObservationFace::kOne : dds::ObservationFace::kTwo;
  message.reason = std::string_view(judged.reason);
  if (judged.trust == Trust::kNone || !measured) {
    message.status = dds::ObservationStatus::kNone;
    if (message.reason.empty()) message.reason = "not_measured";
    return message;
  }
  message.status = judged.trust == Trust::kGood ? dds::ObservationStatus::kGood
                                                : dds::ObservationStatus::kDegraded;
  message.sensed_within_s = pointed.within_s;
  message.circle_rad = measured->circles.horizontal_rad;
  message.zenith_rad = measured->circles.zenith_rad;
  message.slope_m = measured->slope_m.value_or(dds::kNaN);
  message.prism_constant_m = measured->prism_constant_m.value_or(dds::kNaN);
  message.ppm = measured->ppm.value_or(dds::kNaN);
  if (judged.p_in_site && measured->slope_m) {
    message.position_in_site_m = *judged.p_in_site;
    message.covariance_of_reading_m2 = judged.covariance.of_reading;
    message.by_station = judged.covariance.by_station;
  }
  return message;
}

dds::StationSetUp InUseOf(const StationNames& names, const StationKeeper& keeper) {
  dds::StationSetUp message = EmptySetUp(names, "in_use");
  message.reason = std::string_view(keeper.reason());
  if (keeper.health() == SetUpHealth::kNone) return message;
  message.state =
      keeper.health() == SetUpHealth::kGood ? dds::SetUpState::kGood : dds::SetUpState::kSuspect;
  Fill(keeper.options(), *keeper.state().in_use, &message);
  return message;
}

dds::StationSetUp ProposedOf(const StationNames& names, const StationKeeper& keeper) {
  dds::StationSetUp message = EmptySetUp(names, "proposed");
  message.reason = "none_proposed";
  if (!keeper.proposed()) return message;
  const ProposedMove& move = *keeper.proposed();
  Fill(keeper.options(), move.set_up, &message);
  message.closure_tolerance_m = keeper.options().closure_tolerance_m;
  message.state = dds::SetUpState::kSuspect;
  message.reason = "closure_missing";
  if (!move.closure) return message;
  message.closure_m = move.closure->mean_m;
  message.closure_worst_m = move.closure->worst_m;
  message.closure_points = move.closure->points;
  const bool is_within = move.closure->worst_m <= message.closure_tolerance_m;
  message.state = is_within ? dds::SetUpState::kGood : dds::SetUpState::kSuspect;
  message.reason = is_within ? "" : "closure_too_large";
  return message;
}

dds::StationSetUp PreviousOf(const StationNames& names, const StationKeeper& keeper) {
  dds::StationSetUp message = EmptySetUp(names, "previous");
  message.reason = "none_previous";
  if (!keeper.state().previous) return message;
  Fill(keeper.options(), *keeper.state().previous, &message);
  message.state = dds::SetUpState::kSuspect;
  message.reason = "superseded";
  return message;
}

dds::DeviceHealth HealthOf(const StationNames& names, const StationHealth& health) {
  dds::DeviceHealth message;
  message.machine_id = std::string_view(names.machine_id);
  message.device_id = std::string_view(names.station);
  switch (health.state) {
    case StationState::kClosed:
      message.state = dds::DeviceState::kClosed;
      break;
    case StationState::kOpening:
      message.state = dds::DeviceState::kOpening;
      break;
    case StationState::kReady:
      message.state = dds::DeviceState::kStreaming;
      break;
    case StationState::kSilent:
      message.state = dds::DeviceState::kSilent;
      break;
  }
  message.errors = health.counters.timeouts + health.counters.garbled;
  message.reconnects = health.counters.reconnects;
  if (health.last_fault) message.detail = FailureSentence(health.last_fault->why);
  return message;
}

dds::AlarmStatus AlarmOf(const StationNames& names,
                         const AlarmRule& rule,
                         const Alarm& alarm,
                         std::string_view detail) {
  dds::AlarmStatus message;
  message.machine_id = std::string_view(names.machine_id);
  message.source = kStationSource;
  message.code = rule.code;
  message.phase = static_cast<dds::AlarmPhase>(alarm.state);
  message.urgency = static_cast<dds::AlarmUrgency>(rule.priority);
  if (alarm.times_raised > 0) {
    message.since = alarm.since;
    message.raised_at = alarm.raised_at;
  }
  message.raise_number = alarm.raise_number;
  message.times_raised = alarm.times_raised;
  message.value = alarm.value.value_or(dds::kNaN);
  message.raise_above = rule.raise_above;
  message.clear_below = rule.clear_below;
  if (rule.code == "low_power") message.unit = "% gone";
  if (rule.code == "prism_not_found") message.unit = "rounds";
  message.cause = std::string_view(detail.empty() ? fmt::format("{}.", rule.cause)
                                                  : fmt::format("{}: {}.", rule.cause, detail));
  message.response = rule.response;
  return message;
}

}  // namespace tbm
