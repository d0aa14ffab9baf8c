// The driver against the emulated unit on a pseudo-terminal, with all that can happen to the wire.
#include "devices/imu/stim_emulator.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/bus/serial_port.h"
#include "devices/imu/stim_unit.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using namespace std::chrono_literals;
using std::chrono::steady_clock;

// Never the same twice, and small enough to be told from any damage.
StimReading Truth(Timestamp at) {
  const double phase = static_cast<double>(at.ns % 1'000'000'000) * 2e-9 * std::numbers::pi;
  StimReading reading;
  reading.rate_rad_s = {0.10 + 1e-3 * std::sin(phase), -0.20, 0.30};
  reading.specific_force_m_s2 = Eigen::Vector3d(0.5, 1e-2 * std::cos(phase), 9.8);
  reading.gyro_temperature_celsius = 24.0;
  return reading;
}

struct Kind {
  std::string name;
  StimModel model = StimModel::kStim300;
  std::uint8_t id = 0xA5;
  bool has_terminator = false;
};
void PrintTo(const Kind& kind, std::ostream* out) { *out << kind.name; }

class EmulatedUnit : public testing::TestWithParam<Kind> {
 protected:
  EmulatedUnit() {
    config_.model = GetParam().model;
    config_.port.path = folder_ / "imu";
    config_.port.baud = 921600;
    settings_.family = FamilyOf(config_.model);
    settings_.id = GetParam().id;
    settings_.scales = config_.scales;
    settings_.has_terminator = GetParam().has_terminator;
  }

  void Emulate() {
    emulated_ = std::make_unique<StimEmulator>(config_.port, settings_, Truth, clock_);
    ASSERT_TRUE(emulated_->IsUp());
  }
  void Make() {
    ASSERT_TRUE(CheckStimConfig(config_).empty());
    driver_ = std::make_unique<StimUnit>(
        config_, std::make_unique<SerialPort>(config_.port), clock_, sleeper_);
  }
  Result<InertialSample, InertialFailure> Read() {
    const auto sample = driver_->Read(steady_clock::now() + 100ms);
    if (sample) ExpectTruth(*sample);
    return sample;
  }
  // Nothing but the truth ever comes out, whatever happens.
  void ExpectTruth(const InertialSample& sample) {
    EXPECT_NEAR(sample.rate_rad_s.x(), 0.10, 1.1e-3);
    EXPECT_NEAR(sample.rate_rad_s.y(), -0.20, 1e-5);
    EXPECT_NEAR(sample.rate_rad_s.z(), 0.30, 1e-5);
    const StimLayout* layout = FindStimLayout(settings_.family, settings_.id);
    ASSERT_EQ(sample.specific_force_m_s2.has_value(), layout->has_accel);
    if (layout->has_accel) {
      EXPECT_NEAR(sample.specific_force_m_s2->z(), 9.8, 1e-4);
    }
  }
  bool Reaches(const std::function<bool()>& goal) {
    const auto limit = steady_clock::now() + 20s;
    while (steady_clock::now() < limit) {
      [[maybe_unused]] const auto sample = Read();
      if (goal()) return true;
    }
    return false;
  }
  bool Reaches(InertialState state) {
    return Reaches([&] { return driver_->Health().state == state; });
  }
  InertialCounters Counters() const { return driver_->Health().counters; }

  test::TempFolder folder_;
  SystemClock clock_;
  SystemSleeper sleeper_;
  StimConfig config_;
  StimEmulatorSettings settings_;
  std::unique_ptr<StimEmulator> emulated_;
  std::unique_ptr<StimUnit> driver_;
};

TEST_P(EmulatedUnit, StreamsTheTruthAtItsPace) {
  Emulate();
  Make();
  const Timestamp before = clock_.Now();
  std::vector<InertialSample> samples;
  const auto limit = steady_clock::now() + 20s;
  while (samples.size() < 500 && steady_clock::now() < limit) {
    if (const auto sample = Read()) samples.push_back(*sample);
  }
  ASSERT_EQ(samples.size(), 500u);
  EXPECT_GE(samples.front().ends_at, before);
  EXPECT_LE(samples.back().ends_at, clock_.Now());
  if (Counters().clock_restarts > 0) GTEST_SKIP() << "this computer stood still for 0.3 s";
  // Between two samples lie whole steps of the unit, however late they came.
  for (std::size_t i = 1; i < samples.size(); ++i) {
    const double steps = SecondsBetween(samples[i - 1].ends_at, samples[i].ends_at) / 0.002;
    EXPECT_NEAR(steps, std::round(steps), 0.011 * std::round(steps));
    EXPECT_GE(steps, 0.9);
  }
}

TEST_P(EmulatedUnit, WaitsForAPortThatIsNotThereYet) {
  Make();
  const auto first = Read();
  ASSERT_FALSE(first);
  EXPECT_EQ(first.error(), InertialFailure::kPortMissing);
  Emulate();
  EXPECT_TRUE(Reaches(InertialState::kStreaming));
}

TEST_P(EmulatedUnit, CountsEveryDamageAndGoesOn) {
  Emulate();
  Make();
  ASSERT_TRUE(Reaches(InertialState::kStreaming));
  const InertialCounters before = Counters();
  for (int i = 0; i < 10; ++i) {
    for (const auto kind : {StimFaultKind::kDrop,
                            StimFaultKind::kFlippedBit,
                            StimFaultKind::kCut,
                            StimFaultKind::kNoise,
                            StimFaultKind::kSaturated,
                            StimFaultKind::kStartUp,
                            StimFaultKind::kFaulty}) {
      emulated_->faults().Add(kind);
    }
  }
  ASSERT_TRUE(Reaches([&] { return Counters().good > before.good + 200; }));
  const InertialCounters after = Counters();
  EXPECT_EQ(after.overloads - before.overloads, 10u);
  EXPECT_EQ(after.starting_up - before.starting_up, 10u);
  // Half a datagram and the noise behind it can be as long as a whole one, and an eight-bit
  // checksum is right by chance once in 256; the noise says in its status that it is faulty.
  const bool is_weak = settings_.family == StimFamily::kStim210;
  EXPECT_GE(after.faulty - before.faulty, 10u);
  EXPECT_LE(after.faulty - before.faulty, is_weak ? 12u : 10u);
  EXPECT_GE(after.garbled - before.garbled, 8u);  // a flipped identifier is only skipped
  EXPECT_GT(after.skipped_bytes, before.skipped_bytes);
  // Dropped, flipped (but for bits of CR LF) and cut ones; a terminal that is full may lose more.
  if (FindStimLayout(settings_.family, settings_.id)->has_counter) {
    EXPECT_GE(after.lost - before.lost, 28u);
  }
  EXPECT_EQ(driver_->Health().state, InertialState::kStreaming);
}

TEST_P(EmulatedUnit, ReportsFrozenAndSilentAndComesBack) {
  Emulate();
  Make();
  ASSERT_TRUE(Reaches(InertialState::kStreaming));
  emulated_->faults().SetLasting(StimFaultKind::kFrozen);
  ASSERT_TRUE(Reaches([&] { return Counters().frozen > 20; }));
  emulated_->faults().SetLasting(StimFaultKind::kDrop);
  ASSERT_TRUE(Reaches(InertialState::kSilent));
  ASSERT_TRUE(Reaches([&] { return driver_->Health().last_failure == InertialFailure::kNoData; }));
  emulated_->faults().SetLasting(std::nullopt);
  EXPECT_TRUE(Reaches(InertialState::kStreaming));
}

TEST_P(EmulatedUnit, SurvivesUnplugAndStartsUpAgain) {
  settings_.start_up = 200ms;
  Emulate();
  Make();
  for (int round = 0; round < 2; ++round) {
    ASSERT_TRUE(Reaches(InertialState::kStreaming)) << "round " << round;
    const auto starting_up_before = Counters().starting_up;
    emulated_->Unplug();
    ASSERT_TRUE(Reaches(InertialState::kClosed)) << "round " << round;
    emulated_->Replug();
    ASSERT_TRUE(Reaches([&] { return Counters().starting_up > starting_up_before; }));
  }
  ASSERT_TRUE(Reaches(InertialState::kStreaming));
  EXPECT_EQ(Counters().reconnects, 2u);
}

TEST_P(EmulatedUnit, RefusesAPortThatIsInUse) {
  Emulate();
  Make();
  ASSERT_TRUE(Reaches(InertialState::kStreaming));
  StimUnit second(config_, std::make_unique<SerialPort>(config_.port), clock_, sleeper_);
  const auto sample = second.Read(steady_clock::now() + 100ms);
  ASSERT_FALSE(sample);
  EXPECT_EQ(sample.error(), InertialFailure::kPortRefused);
}

INSTANTIATE_TEST_SUITE_P(Kinds,
                         EmulatedUnit,
                         testing::Values(Kind{"stim300"},
                                         Kind{"stim300_all_lines", StimModel::kStim300, 0xA7, true},
                                         Kind{"stim202", StimModel::kStim202, 0xA8},
                                         Kind{"stim202_unnumbered", StimModel::kStim202, 0x90}),
                         [](const auto& kind) { return kind.param.name; });

TEST(StimFaults, HaveTheirWords) {
  EXPECT_EQ(StimFaultFromWord("flipped_bit"), StimFaultKind::kFlippedBit);
  EXPECT_EQ(StimFaultFromWord("saturated"), StimFaultKind::kSaturated);
  EXPECT_FALSE(StimFaultFromWord("explode"));
}

}  // namespace
}  // namespace tbm
