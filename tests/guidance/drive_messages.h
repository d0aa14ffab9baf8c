#pragma once

#include <string>
#include <vector>

#include "guidance/app/guidance_step.h"
#include "tests/support/drive.h"

// What a drive's instruments say, as the messages that carry it.
namespace tbm::test {

class DriveMessages {
 public:
  explicit DriveMessages(const Machine& machine) : machine_(machine) {}

  std::vector<GuidanceMessage> From(const std::vector<GuidanceInput>& inputs) {
    std::vector<GuidanceMessage> messages;
    for (const GuidanceInput& input : inputs) {
      std::visit([&](const auto& one) { Add(one, &messages); }, input);
    }
    return messages;
  }

 private:
  template <class Message>
  Message Begun(Timestamp at) {
    Message message;
    message.machine_id = std::string_view(machine_.machine_id);
    message.published_at = at;
    if constexpr (requires { message.sensed_at; }) message.sensed_at = at;
    if constexpr (requires { message.sample_number; }) message.sample_number = ++number_;
    return message;
  }

  void Add(const PrismSeen& seen, std::vector<GuidanceMessage>* messages) {
    auto m = Begun<dds::StationObservation>(seen.sensed_at);
    m.station = "total_station";
    m.set_up_number = seen.set_up_number;
    m.cycle_number = seen.set_up_number;
    m.target = std::string_view(machine_.prisms[seen.prism].name);
    m.status = dds::ObservationStatus::kGood;
    m.sensed_within_s = 0.5;
    m.circle_rad = 1.0;
    m.zenith_rad = 1.5;
    m.slope_m = 80.0;
    m.position_in_site_m = seen.p_in_site;
    m.covariance_of_reading_m2 = seen.covariance;
    m.by_station = seen.by_station;
    at_ = seen.sensed_at;
    messages->push_back(m);
  }
  void Add(const SetUpKnown& known, std::vector<GuidanceMessage>* messages) {
    auto m = Begun<dds::StationSetUp>(at_);
    m.role = "in_use";
    m.station = "total_station";
    m.set_up_number = known.number;
    m.state = known.trusted_until ? dds::SetUpState::kSuspect : dds::SetUpState::kGood;
    if (known.trusted_until) {
      m.reason = "station_moved";
      m.last_good_check_at = *known.trusted_until;
    }
    m.set_up_at = at_;
    m.position_in_site_m = {1.0, 2.0, 3.0};
    m.circle_zero_bearing_rad = 0.5;
    m.covariance = known.covariance;
    messages->push_back(m);
  }
  void Add(const RelativeSeen& seen, std::vector<GuidanceMessage>* messages) {
    auto m = Begun<dds::RelativePose>(seen.sensed_at);
    m.status = seen.status;
    m.reason = seen.reason;
    m.camera_from_target = seen.camera_from_target.b_from_a;
    m.covariance = seen.camera_from_target.covariance;
    m.leds_used = 0x1F;
    m.tilts_used = seen.tilts_used;
    m.chi2 = 5.0;
    m.dof = 6;
    m.rms_px = 0.1;
    messages->push_back(m);
  }
  void Add(const TiltSeen& seen, std::vector<GuidanceMessage>* messages) {
    auto m = Begun<dds::TiltReading>(seen.sensed_at);
    m.sensor = seen.place == TiltPlace::kTarget ? "target" : "camera";
    m.validity = dds::Validity::kValid;
    m.inclination = *seen.inclination;
    m.sigma_rad = 1e-4;
    at_ = seen.sensed_at;
    messages->push_back(m);
  }
  void Add(const AlarmOrder&, std::vector<GuidanceMessage>*) {}

  const Machine& machine_;
  Timestamp at_{1'700'000'000'000'000'000};
  std::uint64_t number_ = 0;
};

}  // namespace tbm::test
