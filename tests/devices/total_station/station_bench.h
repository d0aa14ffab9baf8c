#pragma once

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/app/station_process.h"
#include "idl/cpp/codec.h"
#include "tests/devices/total_station/geocom_bench.h"
#include "tests/support/temp_folder.h"

namespace tbm::test {

// Keeps all messages, and refuses what would not pass the contract's boundary.
class ListSink final : public StationSink {
 public:
  void Publish(const dds::StationObservation& m) override { Keep(m, observations); }
  void Publish(const dds::StationSetUp& m) override { Keep(m, set_ups); }
  void Publish(const dds::DeviceHealth& m) override { Keep(m, health); }
  void Publish(const dds::Event& m) override { Keep(m, events); }
  void Publish(const dds::AlarmStatus& m) override { Keep(m, alarms); }
  void Publish(const dds::CommandReply& m) override { Keep(m, replies); }

  std::vector<dds::StationObservation> observations;
  std::vector<dds::StationSetUp> set_ups;
  std::vector<dds::DeviceHealth> health;
  std::vector<dds::Event> events;
  std::vector<dds::AlarmStatus> alarms;
  std::vector<dds::CommandReply> replies;

  // The last one of a role or code; nullptr when there was none.
  const dds::StationSetUp* SetUp(std::string_view role) const {
    const auto at = std::find_if(
        set_ups.rbegin(), set_ups.rend(), [&](const auto& m) { return m.role.view() == role; });
    return at == set_ups.rend() ? nullptr : &*at;
  }
  const dds::AlarmStatus* Alarm(std::string_view code) const {
    const auto at = std::find_if(
        alarms.rbegin(), alarms.rend(), [&](const auto& m) { return m.code.view() == code; });
    return at == alarms.rend() ? nullptr : &*at;
  }
  bool IsRaised(std::string_view code) const {
    const auto* alarm = Alarm(code);
    return alarm != nullptr && (alarm->phase == dds::AlarmPhase::kUnacknowledged ||
                                alarm->phase == dds::AlarmPhase::kAcknowledged);
  }
  bool HasEvent(std::string_view code) const {
    return std::ranges::any_of(events, [&](const auto& m) { return m.code.view() == code; });
  }
  std::string AllEvents() const {
    std::string all;
    for (const auto& m : events) {
      all += std::string(m.code.view()) + ": " + std::string(m.text.view()) + "\n";
    }
    return all;
  }

 private:
  template <class M>
  void Keep(const M& message, std::vector<M>& list) {
    std::vector<std::byte> bytes;
    EXPECT_EQ(dds::EncodeCdr(message, &bytes), dds::BoundaryFault::kNone);
    list.push_back(message);
  }
};

// The whole process with its driver, an emulated GeoCOM instrument in a tunnel, and a clock that
// moves only while somebody waits.
class StationBench : public testing::Test {
 protected:
  static constexpr double kArcsec = std::numbers::pi / 180.0 / 3600.0;

  StationBench() {
    instrument_.pillar.p_in_site = {1000.0, 2000.0, 50.0};
    instrument_.pillar.circle_zero_bearing_rad = 0.25;
    instrument_.errors.angle_sigma_rad = 1.0 * kArcsec;
    instrument_.errors.slope_sigma_m = 0.5e-3;
    instrument_.errors.collimation_rad = 6.0 * kArcsec;
    instrument_.errors.index_rad = 4.0 * kArcsec;
    const std::vector<Eigen::Vector3d> references = {{997.0, 1960.0, 51.5},
                                                     {1003.0, 1975.0, 50.5},
                                                     {997.5, 1985.0, 52.5},
                                                     {1003.0, 2030.0, 51.0}};
    for (std::size_t i = 0; i < references.size(); ++i) {
      const std::string name = "R" + std::to_string(i + 1);
      const Eigen::Vector3d p = references[i];
      instrument_.prisms.push_back({name, [p](Timestamp) { return std::optional(p); }, 0.0});
      config_.keeper.references.push_back({name, {p, 0.3e-3}, false});
      config_.reference_constants_m.push_back(0.0);
    }
    machine_.machine_id = "TBM-1";
    const std::vector<std::pair<std::string, Eigen::Vector3d>> prisms = {
        {"left", {-4.0, 1.9, 1.5}}, {"right", {-4.0, -1.9, 1.5}}, {"top", {-1.0, 0.6, 2.9}}};
    shield_.translation = {1000.0, 2045.0, 50.0};
    shield_.rotation = Eigen::AngleAxisd(0.5 * std::numbers::pi, Eigen::Vector3d::UnitZ());
    for (const auto& [name, p] : prisms) {
      machine_.prisms.push_back({name, {p, 3e-4}});
      instrument_.prisms.push_back(
          {name,
           [this, p = p, name = name](Timestamp) -> std::optional<Eigen::Vector3d> {
             if (hidden_ == name) return {};
             return Eigen::Vector3d(shield_ * p);
           },
           kPrismConstant_m});
    }
    config_.prism_constant_m = kPrismConstant_m;
    config_.distance.air = {25.0, 950.0, 40.0};
    instrument_.errors.air_ppm = AirCorrection_ppm(config_.distance.air, config_.distance.meter);
    config_.keeper.start = {{1000.1, 1999.9, 50.05}, 0.251};
    config_.keeper.shield_start =
        Rigid3{shield_.rotation, shield_.translation + Eigen::Vector3d(0.1, 0.1, 0)};
    config_.keeper.angle_sigma_rad = 1.0 * kArcsec;
    config_.keeper.slope_sigma_m = 0.5e-3;
    config_.keeper.slope_sigma_ppm = 0.0;
    config_.keeper.check_period = std::chrono::minutes(3);
    config_.state_file = folder_ / "station.state";
  }

  void Start(GeocomEmulatorOptions options = {}) {
    emulator_.emplace(options, instrument_, clock_);
    station_.emplace(config_.instrument,
                     std::make_unique<EmulatorLink>(*emulator_, clock_, sleeper_),
                     1,
                     clock_,
                     sleeper_);
    StartProcess();
  }
  // As after a kill: nothing is handed over but the files.
  void StartProcess() {
    process_.reset();
    process_.emplace(config_, machine_, *station_, clock_, sleeper_, sink_);
  }
  void Run(Duration span) {
    const auto until = clock_.Steady() + span;
    while (clock_.Steady() < until) Step();
  }
  template <class Condition>
  bool RunUntil(Condition is_there, Duration at_most) {
    const auto until = clock_.Steady() + at_most;
    while (!is_there() && clock_.Steady() < until) Step();
    return is_there();
  }
  bool BecomesGood(Duration at_most = std::chrono::minutes(4)) {
    return RunUntil([&] { return IsGood(); }, at_most);
  }
  void Step() {
    process_->Step();
    clock_.Advance(std::chrono::milliseconds(1));  // nothing that fails at once stops the clock
    process_->Beat();
  }
  bool IsGood() const { return process_->keeper().health() == SetUpHealth::kGood; }

  void Send(std::string_view verb, std::string_view argument, std::string_view because) {
    dds::Command command;
    command.machine_id = "TBM-1";
    last_request_ = "request-" + std::to_string(++requests_);
    command.request_id = std::string_view(last_request_);
    command.addressee = "total_station";
    command.verb = verb;
    command.argument = argument;
    command.by = "surveyor";
    command.because = because;
    command.issued_at = clock_.Now();
    command.expires_at = clock_.Now() + std::chrono::minutes(5);
    process_->Hear(command);
  }
  // The last reply to the last request.
  std::optional<dds::CommandReply> Answer() const {
    std::optional<dds::CommandReply> last;
    for (const auto& reply : sink_.replies) {
      if (reply.request_id.view() == last_request_) last = reply;
    }
    return last;
  }
  std::optional<dds::CommandOutcome> Ask(std::string_view verb,
                                         std::string_view argument = {},
                                         std::string_view because = {}) {
    Send(verb, argument, because);
    RunUntil(
        [&] {
          const auto answer = Answer();
          return answer && answer->outcome != dds::CommandOutcome::kAccepted;
        },
        std::chrono::minutes(6));
    const auto answer = Answer();
    if (!answer) return {};
    return answer->outcome;
  }

  // Of all positions that were published as good, the one furthest from the truth.
  double WorstGood_m(std::size_t from = 0) const {
    double worst_m = 0.0;
    for (std::size_t i = from; i < sink_.observations.size(); ++i) {
      const auto& one = sink_.observations[i];
      if (one.kind != dds::ObservedKind::kPrism || one.status != dds::ObservationStatus::kGood) {
        continue;
      }
      for (const NamedPrism& named : machine_.prisms) {
        if (named.name != one.target.view()) continue;
        const Eigen::Vector3d truth = shield_ * named.prism.p_in_rear_shield;
        worst_m = std::max(worst_m, (one.position_in_site_m - truth).norm());
      }
    }
    return worst_m;
  }
  int Good(std::string_view target = {}, std::size_t from = 0) const {
    int count = 0;
    for (std::size_t i = from; i < sink_.observations.size(); ++i) {
      const auto& one = sink_.observations[i];
      count += one.kind == dds::ObservedKind::kPrism &&
               one.status == dds::ObservationStatus::kGood &&
               (target.empty() || one.target.view() == target);
    }
    return count;
  }

  static constexpr double kPrismConstant_m = 0.0175;
  TempFolder folder_;
  FakeClock clock_;
  ActingSleeper sleeper_{clock_};
  EmulatedInstrument instrument_;  // until Start
  StationConfig config_;
  Machine machine_;
  Rigid3 shield_;
  std::string hidden_;
  ListSink sink_;
  std::optional<GeocomEmulator> emulator_;
  std::optional<GeocomTotalStation> station_;
  std::optional<StationProcess> process_;
  std::string last_request_;
  int requests_ = 0;
};

}  // namespace tbm::test
