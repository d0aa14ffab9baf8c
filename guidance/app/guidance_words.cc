#include "guidance/app/guidance_words.h"

#include <cmath>
#include <string>

#include <fmt/format.h>

namespace tbm {
namespace {

dds::Validity ValidityOf(Worth worth) {
  switch (worth) {
    case Worth::kInvalid:
      return dds::Validity::kInvalid;
    case Worth::kDegraded:
      return dds::Validity::kDegraded;
    case Worth::kValid:
      return dds::Validity::kValid;
  }
  return dds::Validity::kInvalid;
}

dds::SourceFreshness FreshnessOf(Freshness freshness) {
  switch (freshness) {
    case Freshness::kMissing:
      return dds::SourceFreshness::kMissing;
    case Freshness::kFresh:
      return dds::SourceFreshness::kFresh;
    case Freshness::kCoasting:
      return dds::SourceFreshness::kCoasting;
    case Freshness::kStale:
      return dds::SourceFreshness::kStale;
  }
  return dds::SourceFreshness::kMissing;
}

std::string_view WordOf(ShieldName shield) {
  return shield == ShieldName::kRear ? "rear" : "front";
}

double OrNaN(const std::optional<double>& value) { return value.value_or(dds::kNaN); }

dds::GuidanceSource SourceOf(std::string_view name,
                             const SourceState& source,
                             std::string_view trouble) {
  dds::GuidanceSource message;
  message.name = name;
  message.freshness = FreshnessOf(source.freshness);
  message.age_s = OrNaN(source.age_s);
  message.reason = trouble;
  return message;
}

dds::GuidedPoint PointOf(const MachinePoint& point, const PointState& state) {
  dds::GuidedPoint message;
  message.name = std::string_view(point.name);
  message.shield = WordOf(point.shield);
  message.validity = ValidityOf(state.worth);
  if (state.worth != Worth::kValid) message.reason = ReasonCode(state.reason);
  if (state.worth == Worth::kInvalid) return message;
  const Deviation& deviation = state.deviation;
  message.position_in_site_m = state.p_in_site.p;
  message.position_sigma_m = std::sqrt(state.p_in_site.covariance.trace());
  message.chainage_m = deviation.chainage.m;
  message.official_chainage_m = deviation.official.m;
  message.official_section = deviation.official.section;
  message.chainage_sigma_m = deviation.along_sigma_m;
  message.deviation_right_m = deviation.right_m;
  message.deviation_up_m = OrNaN(deviation.up_m);
  message.deviation_right_sigma_m = deviation.right_sigma_m;
  message.deviation_up_sigma_m = deviation.up_sigma_m;
  message.right_up_correlation = deviation.right_up_correlation;
  if (state.trend_right) {
    message.trend_right_per_m = state.trend_right->per_m;
    message.trend_right_sigma_per_m = state.trend_right->sigma_per_m;
    message.trend_length_m = state.trend_right->length_m;
  }
  if (state.trend_up) {
    message.trend_up_per_m = state.trend_up->per_m;
    message.trend_up_sigma_per_m = state.trend_up->sigma_per_m;
  }
  return message;
}

void FillJoint(const JointState& joint, dds::Guidance* message) {
  const Eigen::Vector3d sigma = joint.articulation_covariance.diagonal().cwiseSqrt();
  message->articulation_right_rad = joint.articulation.right_rad;
  message->articulation_up_rad = joint.articulation.up_rad;
  message->articulation_roll_rad = joint.articulation.roll_rad;
  message->articulation_right_sigma_rad = sigma[0];
  message->articulation_up_sigma_rad = sigma[1];
  message->articulation_roll_sigma_rad = sigma[2];
  if (joint.stroke_m) {
    message->stroke_m = *joint.stroke_m;
    message->stroke_sigma_m = joint.stroke_sigma_m;
  }
}

void FillPrisms(const RearShieldFix& fix, const Machine& machine, dds::Guidance* message) {
  message->prisms_used = fix.prisms_used;
  message->prisms_chi2 = fix.chi2;
  message->prisms_dof = fix.dof;
  message->prisms_rms_m = fix.rms_m;
  const auto name = [&](int prism) -> const std::string& {
    return machine.prisms[static_cast<std::size_t>(prism)].name;
  };
  std::string remark;
  if (fix.left_out) {
    remark = fmt::format("left_out {}", name(*fix.left_out));
  } else if (fix.exchanged) {
    remark = fmt::format("exchanged {} {}", name((*fix.exchanged)[0]), name((*fix.exchanged)[1]));
  }
  message->prisms_remark = std::string_view(remark);
}

}  // namespace

std::optional<GuidanceInput> InputOf(const dds::StationObservation& message,
                                     const Machine& machine) {
  if (message.kind != dds::ObservedKind::kPrism ||
      message.status == dds::ObservationStatus::kNone || !message.has_position()) {
    return {};
  }
  for (std::size_t i = 0; i < machine.prisms.size(); ++i) {
    if (machine.prisms[i].name != message.target.view()) continue;
    return PrismSeen{message.set_up_number,
                     i,
                     message.sensed_at,
                     message.position_in_site_m,
                     message.covariance_of_reading_m2,
                     message.by_station};
  }
  return {};
}

std::optional<GuidanceInput> InputOf(const dds::StationSetUp& message) {
  if (message.role.view() != "in_use") return {};
  SetUpKnown set_up;
  if (message.state == dds::SetUpState::kNone) return set_up;
  set_up.number = message.set_up_number;
  set_up.covariance = message.covariance;
  if (message.state == dds::SetUpState::kSuspect) {
    set_up.trusted_until = message.last_good_check_at;  // kNever lies before every reading
  }
  return set_up;
}

std::optional<GuidanceInput> InputOf(const dds::RelativePose& message) {
  RelativeSeen seen;
  seen.sensed_at = message.sensed_at;
  seen.status = message.status;
  seen.reason = message.reason;
  seen.tilts_used = message.tilts_used;
  if (message.status != PoseStatus::kNone) {
    seen.camera_from_target = {message.camera_from_target, message.covariance};
  }
  return seen;
}

std::optional<GuidanceInput> InputOf(const dds::TiltReading& message) {
  TiltSeen seen;
  if (message.sensor.view() == "target") {
    seen.place = TiltPlace::kTarget;
  } else if (message.sensor.view() == "camera") {
    seen.place = TiltPlace::kCamera;
  } else {
    return {};
  }
  seen.sensed_at = message.sensed_at;
  if (message.validity != dds::Validity::kInvalid) seen.inclination = message.inclination;
  return seen;
}

dds::ShieldPose PoseMessageOf(const Snapshot& snapshot,
                              ShieldName shield,
                              const GuidanceNames& names) {
  const ShieldState& state = shield == ShieldName::kRear ? snapshot.rear : snapshot.front;
  dds::ShieldPose message;
  message.machine_id = names.machine_id;
  message.shield = WordOf(shield);
  message.valid_at = snapshot.valid_at;
  message.validity = ValidityOf(state.worth);
  if (state.worth != Worth::kValid) message.reason = ReasonCode(state.reason);
  if (state.worth == Worth::kInvalid) return message;
  const Eigen::Vector3d sigma = state.attitude_covariance.diagonal().cwiseSqrt();
  message.age_s = state.age_s;
  message.site_from_shield = state.site_from_shield.b_from_a;
  message.covariance = state.site_from_shield.covariance;
  message.speed_m_per_s = state.speed_m_per_s;
  message.speed_sigma_m_per_s = state.speed_sigma_m_per_s;
  message.heading_rad = state.attitude.heading_rad;
  message.pitch_rad = state.attitude.pitch_rad;
  message.roll_rad = state.attitude.roll_rad;
  message.heading_sigma_rad = sigma[0];
  message.pitch_sigma_rad = sigma[1];
  message.roll_sigma_rad = sigma[2];
  return message;
}

void FillGuidance(const Snapshot& snapshot,
                  const Machine& machine,
                  const GuidanceNames& names,
                  dds::Guidance* message) {
  *message = {};
  message->machine_id = names.machine_id;
  message->axis_name = names.axis_name;
  message->axis_sha256 = names.axis_sha256;
  message->machine_sha256 = names.machine_sha256;
  message->steer_by = names.steer_by;
  message->valid_at = snapshot.valid_at;
  const PointState& steered = snapshot.points[machine.steer_by];
  message->validity = ValidityOf(steered.worth);
  if (steered.worth != Worth::kValid) message->reason = ReasonCode(steered.reason);
  message->set_up_number = snapshot.set_up_number;
  if (snapshot.lead) {
    message->lead_right_per_m = snapshot.lead->right_per_m;
    message->lead_up_per_m = OrNaN(snapshot.lead->up_per_m);
    message->lead_right_sigma_per_m = snapshot.lead->right_sigma_per_m;
    message->lead_up_sigma_per_m = snapshot.lead->up_sigma_per_m;
  }
  if (snapshot.joint) FillJoint(*snapshot.joint, message);
  if (snapshot.ring_number) message->ring_number = static_cast<std::int32_t>(*snapshot.ring_number);
  if (snapshot.fix) FillPrisms(*snapshot.fix, machine, message);
  message->sources.push_back(
      SourceOf("station", snapshot.station, ReasonCode(snapshot.fix_trouble)));
  message->sources.push_back(
      SourceOf("camera", snapshot.camera, ReasonCode(snapshot.camera_trouble)));
  message->sources.push_back(SourceOf("tilt_target", snapshot.target_tilt, ""));
  message->sources.push_back(SourceOf("tilt_camera", snapshot.camera_tilt, ""));
  for (std::size_t i = 0; i < machine.points.size(); ++i) {
    message->points.push_back(PointOf(machine.points[i], snapshot.points[i]));
  }
  for (const AheadState& ahead : snapshot.ahead) {
    dds::PredictedDeviation predicted;
    predicted.ahead_m = ahead.ahead_m;
    predicted.deviation_right_m = ahead.right.off_m;
    predicted.deviation_right_sigma_m = ahead.right.sigma_m;
    if (ahead.up) {
      predicted.deviation_up_m = ahead.up->off_m;
      predicted.deviation_up_sigma_m = ahead.up->sigma_m;
    }
    message->ahead.push_back(predicted);
  }
}

dds::AlarmStatus AlarmMessageOf(const GuidanceAlarmRule& rule,
                                const Alarm& alarm,
                                const GuidanceNames& names) {
  dds::AlarmStatus message;
  message.machine_id = names.machine_id;
  message.source = kGuidanceSource;
  message.code = rule.rule.code;
  message.phase = static_cast<dds::AlarmPhase>(alarm.state);
  message.urgency = static_cast<dds::AlarmUrgency>(rule.rule.priority);
  if (alarm.since.ns > 0) message.since = alarm.since;
  if (alarm.times_raised > 0) message.raised_at = alarm.raised_at;
  message.raise_number = alarm.raise_number;
  message.times_raised = alarm.times_raised;
  if (alarm.value) message.value = *alarm.value * rule.shown_per_si;
  message.raise_above = rule.rule.raise_above * rule.shown_per_si;
  message.clear_below = rule.rule.clear_below * rule.shown_per_si;
  message.unit = rule.unit;
  message.cause = rule.rule.cause;
  message.response = rule.rule.response;
  return message;
}

}  // namespace tbm
