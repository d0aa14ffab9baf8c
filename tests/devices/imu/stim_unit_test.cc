#include "devices/imu/stim_unit.h"

#include <cmath>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/devices/imu/stim_stream.h"
#include "tests/devices/inclinometer/fake_line.h"
#include "tests/support/random.h"

namespace tbm {
namespace {

using namespace std::chrono_literals;
using std::chrono::steady_clock;
using test::Bytes;
using test::FakeClock;
using test::FakeLink;
using test::FakeSleeper;
using test::Random;

double Seconds(Duration span) { return static_cast<double>(span.count()) * 1e-9; }
Duration FromSeconds(double seconds) { return Duration(std::llround(seconds * 1e9)); }

// The driver on a line and a clock that only the test moves.
class Unit : public testing::Test {
 protected:
  Unit() {
    config_.port.path = "/dev/imu";
    config_.port.baud = 460800;
  }

  void Make() {
    ASSERT_TRUE(CheckStimConfig(config_).empty());
    auto link = std::make_unique<FakeLink>(clock_);
    link_ = link.get();
    driver_ = std::make_unique<StimUnit>(config_, std::move(link), clock_, sleeper_);
    [[maybe_unused]] const auto nothing = driver_->Read(clock_.Steady());  // opens the port
    start_ = clock_.Steady();
    start_utc_ = clock_.Now();
  }

  static constexpr double kRatePerSample_rad_s = 1e-5;

  // Sample i was taken at start + i / rate; gyro x tells i, so that every one is known again.
  StimDatagram At(int i) const {
    StimReading reading;
    reading.rate_rad_s.x() = kRatePerSample_rad_s * i;
    reading.specific_force_m_s2 = Eigen::Vector3d(0.0, 0.0, 9.8);
    StimDatagram datagram = StimFromReading(FamilyOf(config_.model), id_, reading, config_.scales);
    if (datagram.counter) datagram.counter = static_cast<std::uint8_t>(i * config_.CounterStep());
    if (datagram.latency_us) datagram.latency_us = 400;
    return datagram;
  }
  Duration Sampled(int i) const { return FromSeconds(i / config_.scales.sample_rate_hz); }
  Bytes Encoded(const StimDatagram& datagram) const {
    return EncodeStim(FamilyOf(config_.model), datagram, false);
  }
  // Its last byte arrives when the line allows, and `late` after.
  void Arrive(int i, const Bytes& bytes, Duration late = 0ns) {
    const Duration latency = At(i).latency_us ? 400us : 0us;
    link_->ArriveAt(start_ + Sampled(i) + latency + config_.port.LineTime(bytes.size()) + late,
                    bytes);
  }
  void Send(int from, int to, const std::function<Duration(int)>& late = {}) {
    for (int i = from; i < to; ++i) Arrive(i, Encoded(At(i)), late ? late(i) : 0ns);
  }
  int NumberOf(const InertialSample& sample) const {
    return static_cast<int>(std::lround(sample.rate_rad_s.x() / kRatePerSample_rad_s));
  }

  struct Heard {
    std::vector<InertialSample> samples;
    std::vector<InertialFailure> failures;  // but for kNotDue
  };
  // Reads until sample `to` would be long through.
  Heard Listen(int to) {
    Heard heard;
    const auto end = start_ + Sampled(to);
    for (int calls = 0; clock_.Steady() < end; ++calls) {
      EXPECT_LT(calls, 100'000) << "spins";
      if (calls >= 100'000) break;
      const auto sample = driver_->Read(std::min(end, clock_.Steady() + 100ms));
      if (sample) heard.samples.push_back(*sample);
      if (!sample && sample.error() != InertialFailure::kNotDue) {
        heard.failures.push_back(sample.error());
      }
    }
    return heard;
  }
  // A unit that has settled: samples up to this one have been heard.
  void Settle(int samples = 300) {
    Send(0, samples);
    const Heard heard = Listen(samples);
    ASSERT_FALSE(heard.samples.empty());
    ASSERT_EQ(driver_->Health().state, InertialState::kStreaming);
  }

  FakeClock clock_;
  FakeSleeper sleeper_{clock_};
  StimConfig config_;
  std::uint8_t id_ = 0x91;
  FakeLink* link_ = nullptr;
  std::unique_ptr<StimUnit> driver_;
  steady_clock::time_point start_;
  Timestamp start_utc_;
};

TEST_F(Unit, TakesLineTimeAndLatencyOut) {
  config_.constant_delay = 1ms;
  Make();
  Send(0, 500);
  const Heard heard = Listen(500);
  ASSERT_GT(heard.samples.size(), 200u);
  for (const InertialSample& sample : heard.samples) {
    const double ended_s = Seconds(sample.ends_at - start_utc_);
    EXPECT_NEAR(ended_s, Seconds(Sampled(NumberOf(sample))) - 1e-3, 2e-6);
    EXPECT_DOUBLE_EQ(sample.interval_s, 0.002);
    EXPECT_EQ(sample.missing_before, 0u);
    EXPECT_NEAR(sample.specific_force_m_s2->z(), 9.8, 1e-5);
  }
  // Half a second of arrivals is only watched, and said so.
  EXPECT_NEAR(NumberOf(heard.samples.front()), 250, 3);
  EXPECT_THAT(heard.failures, testing::Each(InertialFailure::kSettling));
  EXPECT_EQ(heard.failures.size(), driver_->Health().counters.untimed);
}

TEST_F(Unit, StampsByTheCounterNotByTheArrival) {
  Make();
  Random random("arrivals");
  std::vector<Duration> late;
  for (int i = 0; i < 1500; ++i) late.push_back(FromSeconds(random.Uniform(0.0, 1.9e-3)));
  std::vector<InertialSample> samples;
  for (int from = 0; from < 1500; from += 100) {
    Send(from, from + 100, [&](int i) { return late[static_cast<std::size_t>(i)]; });
    for (const InertialSample& sample : Listen(from + 100).samples) samples.push_back(sample);
  }
  ASSERT_GT(samples.size(), 1200u);
  for (std::size_t i = 1; i < samples.size(); ++i) {
    EXPECT_EQ(NumberOf(samples[i]), NumberOf(samples[i - 1]) + 1);
    EXPECT_NEAR(Seconds(samples[i].ends_at - samples[i - 1].ends_at), 2e-3, 21e-6);
    EXPECT_NEAR(
        Seconds(samples[i].ends_at - start_utc_), Seconds(Sampled(NumberOf(samples[i]))), 2e-4);
  }
}

TEST_F(Unit, HandsOutAllThatCameInOnePiece) {
  Make();
  Settle();
  Bytes together;
  for (int i = 300; i < 320; ++i) together = test::operator+(together, Encoded(At(i)));
  Arrive(320, together, 20ms);
  const Heard heard = Listen(350);
  ASSERT_EQ(heard.samples.size(), 20u);
  for (int i = 0; i < 20; ++i) {
    const InertialSample& sample = heard.samples[static_cast<std::size_t>(i)];
    EXPECT_EQ(NumberOf(sample), 300 + i);
    EXPECT_NEAR(Seconds(sample.ends_at - start_utc_), Seconds(Sampled(300 + i)), 1e-4);
  }
}

TEST_F(Unit, TellsWhatIsMissingBeforeASample) {
  Make();
  Settle();
  Send(300, 310);
  Send(313, 320);
  Bytes damaged = Encoded(At(320));
  damaged[5] ^= 4;
  Arrive(320, damaged);
  StimDatagram beyond = At(321);
  beyond.gyro.status = stim_status::kOverload;
  Arrive(321, Encoded(beyond));
  Send(322, 330);
  const Heard heard = Listen(331);
  ASSERT_EQ(heard.samples.size(), 10u + 7u + 8u);
  EXPECT_EQ(heard.samples[10].missing_before, 3u);
  EXPECT_EQ(heard.samples[17].missing_before, 2u);
  EXPECT_EQ(heard.samples[18].missing_before, 0u);
  for (const InertialSample& sample : heard.samples) {
    EXPECT_NEAR(Seconds(sample.ends_at - start_utc_), Seconds(Sampled(NumberOf(sample))), 1e-4);
  }
  EXPECT_THAT(heard.failures,
              testing::ElementsAre(InertialFailure::kGarbled, InertialFailure::kOverload));
  const InertialCounters counters = driver_->Health().counters;
  EXPECT_EQ(counters.lost, 4u);
  EXPECT_EQ(counters.garbled, 1u);
  EXPECT_EQ(counters.overloads, 1u);
}

TEST_F(Unit, NothingOfAStartUpComesOut) {
  Make();
  for (int i = 0; i < 500; ++i) {
    StimDatagram datagram = At(i);
    if (i < 400) datagram.gyro.status = stim_status::kStartUp;
    Arrive(i, Encoded(datagram));
  }
  const Heard early = Listen(399);
  EXPECT_TRUE(early.samples.empty());
  EXPECT_THAT(early.failures, testing::Each(InertialFailure::kStartingUp));
  EXPECT_EQ(driver_->Health().state, InertialState::kOpening);
  // Its arrivals were watched meanwhile: the first good sample comes out.
  const Heard late = Listen(500);
  ASSERT_FALSE(late.samples.empty());
  EXPECT_EQ(NumberOf(late.samples.front()), 400);
  EXPECT_EQ(driver_->Health().state, InertialState::kStreaming);
}

TEST_F(Unit, RefusesWhatTheUnitCallsBadOrThatStandsStill) {
  Make();
  Settle();
  StimDatagram faulty = At(300);
  faulty.accel->status = stim_status::kChannel | 2;
  Arrive(300, Encoded(faulty));
  EXPECT_THAT(Listen(301).failures, testing::ElementsAre(InertialFailure::kFaulty));
  // The counter runs on, the values do not: from 200 ms on it is no measurement.
  for (int i = 301; i < 501; ++i) {
    StimDatagram frozen = At(301);
    frozen.counter = At(i).counter;
    Arrive(i, Encoded(frozen));
  }
  const Heard heard = Listen(502);
  EXPECT_NEAR(static_cast<double>(heard.samples.size()), 100.0, 2.0);
  EXPECT_NEAR(static_cast<double>(heard.failures.size()), 100.0, 2.0);
  EXPECT_THAT(heard.failures, testing::Each(InertialFailure::kFrozen));
  Send(502, 510);
  EXPECT_EQ(Listen(511).samples.size(), 8u);
}

TEST_F(Unit, PassesOnThatItWorksOutsideOfItsConditions) {
  Make();
  Settle();
  StimDatagram hot = At(300);
  hot.gyro.status = stim_status::kOutsideConditions;
  Arrive(300, Encoded(hot));
  Arrive(301, Encoded(At(301)));
  const Heard heard = Listen(302);
  ASSERT_EQ(heard.samples.size(), 2u);
  EXPECT_TRUE(heard.samples[0].is_outside_conditions);
  EXPECT_FALSE(heard.samples[1].is_outside_conditions);
}

TEST_F(Unit, IncrementsAndRatesAreTheSameMotion) {
  config_.scales.gyro = config_.scales.accel = StimOutput::kIncrement;
  Make();
  Send(0, 300);
  const Heard heard = Listen(300);
  ASSERT_FALSE(heard.samples.empty());
  for (const InertialSample& sample : heard.samples) {
    EXPECT_NEAR(sample.specific_force_m_s2->z(), 9.8, 1e-4);
    EXPECT_NEAR(NumberOf(sample) * 0.002, Seconds(sample.ends_at - start_utc_), 0.01);
  }
}

TEST_F(Unit, AGyroModuleHasNoSpecificForce) {
  config_.model = StimModel::kStim202;
  for (const auto id : {std::uint8_t{0x90}, std::uint8_t{0xA8}}) {
    id_ = id;
    Make();
    Send(0, 300);
    const Heard heard = Listen(300);
    ASSERT_GT(heard.samples.size(), 30u) << int{id};
    for (const InertialSample& sample : heard.samples) {
      EXPECT_FALSE(sample.specific_force_m_s2);
      EXPECT_EQ(sample.gyro_temperature_celsius.has_value(), id == 0xA8);
    }
  }
}

TEST_F(Unit, SaysThatTheRateIsAnother) {
  Make();
  config_.scales.sample_rate_hz = 250.0;  // the unit's; the driver has been told 500
  Send(0, 500);
  const Heard heard = Listen(500);
  EXPECT_TRUE(heard.samples.empty());
  EXPECT_EQ(driver_->Health().last_failure, InertialFailure::kWrongRate);
}

TEST_F(Unit, TellsNoiseFromNothing) {
  Make();
  Settle();
  Heard heard = Listen(600);  // 600 ms of nothing
  EXPECT_THAT(heard.failures, testing::Not(testing::IsEmpty()));
  EXPECT_THAT(heard.failures, testing::Each(InertialFailure::kNoData));
  EXPECT_EQ(driver_->Health().state, InertialState::kSilent);
  for (int i = 600; i < 1000; ++i) Arrive(i, {0x00, 0x55, 0xFF});
  heard = Listen(1000);
  EXPECT_THAT(heard.failures, testing::Contains(InertialFailure::kGarbled));
  EXPECT_EQ(driver_->Health().state, InertialState::kSilent);
  EXPECT_EQ(driver_->Health().counters.skipped_bytes, 1200u);
}

TEST_F(Unit, ReopensASilentPortAndComesBack) {
  Make();
  Settle();
  Listen(2500);
  EXPECT_EQ(link_->opens, 1);
  Listen(2500 + 600);
  EXPECT_EQ(link_->opens, 2);
  Send(3100, 3500);
  const Heard heard = Listen(3500);
  ASSERT_FALSE(heard.samples.empty());
  EXPECT_EQ(heard.samples.front().missing_before, 0u);
  EXPECT_NEAR(NumberOf(heard.samples.front()), 3350, 3);
  EXPECT_EQ(driver_->Health().state, InertialState::kStreaming);
  EXPECT_TRUE(link_->written.empty());
}

TEST_F(Unit, ClosesOnHangUpAndWaitsBeforeItOpensAgain) {
  Make();
  Settle();
  link_->hung_up = true;
  const auto sample = driver_->Read(clock_.Steady() + 100ms);
  ASSERT_FALSE(sample);
  EXPECT_EQ(sample.error(), InertialFailure::kHungUp);
  EXPECT_EQ(driver_->Health().state, InertialState::kClosed);
  link_->hung_up = false;
  link_->open_failure = LinkFailure::kMissing;
  const int opens_before = link_->opens;
  const Heard heard = Listen(300 + 5000);
  EXPECT_THAT(heard.failures, testing::Each(InertialFailure::kPortMissing));
  EXPECT_NEAR(link_->opens - opens_before, 100, 2);
  link_->open_failure.reset();
  Listen(5400);
  EXPECT_EQ(driver_->Health().counters.reconnects, 1u);
  Send(5400, 5800);
  EXPECT_FALSE(Listen(5800).samples.empty());
}

TEST_F(Unit, AfterAShortHangUpTheUnitsCounterIsAnother) {
  Make();
  Settle();
  link_->hung_up = true;
  EXPECT_FALSE(driver_->Read(clock_.Steady() + 100ms));
  link_->hung_up = false;
  Listen(355);  // 110 ms: opened again, and no pause yet that the clock would notice
  for (int i = 355; i < 700; ++i) {
    StimDatagram datagram = At(i);
    datagram.counter = static_cast<std::uint8_t>(*datagram.counter + 130);
    Arrive(i, Encoded(datagram));
  }
  const Heard heard = Listen(700);
  ASSERT_FALSE(heard.samples.empty());
  EXPECT_NEAR(NumberOf(heard.samples.front()), 355 + 250, 3);
  EXPECT_EQ(heard.samples.front().missing_before, 0u);
  EXPECT_NEAR(Seconds(heard.samples.front().ends_at - start_utc_),
              Seconds(Sampled(NumberOf(heard.samples.front()))),
              1e-4);
}

TEST_F(Unit, SaysWhyThePortCannotBeOpened) {
  for (const auto& [link, failure] :
       {std::pair{LinkFailure::kMissing, InertialFailure::kPortMissing},
        std::pair{LinkFailure::kBusy, InertialFailure::kPortRefused},
        std::pair{LinkFailure::kBadSettings, InertialFailure::kPortRefused}}) {
    auto fake = std::make_unique<FakeLink>(clock_);
    fake->open_failure = link;
    StimUnit driver(config_, std::move(fake), clock_, sleeper_);
    const auto sample = driver.Read(clock_.Steady() + 100ms);
    ASSERT_FALSE(sample);
    EXPECT_EQ(sample.error(), failure);
  }
}

TEST_F(Unit, FollowsTheCivilClockWhenItIsSet) {
  Make();
  Settle();
  clock_.StepCivilTime(10s);
  Send(300, 310);
  const Heard heard = Listen(311);
  ASSERT_EQ(heard.samples.size(), 10u);
  for (const InertialSample& sample : heard.samples) {
    EXPECT_NEAR(
        Seconds(sample.ends_at - start_utc_), Seconds(Sampled(NumberOf(sample))) + 10.0, 1e-4);
  }
}

TEST(StimConfigs, EveryFaultNamesItsKeyAndWhatIsRight) {
  StimConfig good;
  good.port.path = "/dev/imu";
  ASSERT_THAT(CheckStimConfig(good), testing::IsEmpty());
  struct Case {
    std::function<void(StimConfig&)> spoil;
    std::string message;
  };
  const std::vector<Case> cases = {
      {[](StimConfig& c) { c.port.path.clear(); },
       "imu.port: empty: must be a device such as /dev/ttyUSB0"},
      {[](StimConfig& c) { c.port.baud = 1843200; }, "imu.baud: 1843200: must be one of 1200, "},
      {[](StimConfig& c) { c.port.baud = 57600; },
       "imu.baud: 57600: too slow for 500 samples a second"},
      {[](StimConfig& c) { c.port.stop_bits = 3; }, "imu.stop_bits: 3: must be 1 or 2"},
      {[](StimConfig& c) { c.scales.sample_rate_hz = 400.0; },
       "imu.sample_rate_hz: 400: must be 125, 250, 500, 1000 or 2000"},
      {[](StimConfig& c) {
         c.model = StimModel::kStim202;
         c.scales.sample_rate_hz = 2000.0;
       },
       "imu.sample_rate_hz: 2000: must be 125, 250, 500, 1000"},
      {[](StimConfig& c) { c.scales.accel_range_g = 2; },
       "imu.accel_range_g: 2: must be 5, 10, 30, 80"},
      {[](StimConfig& c) { c.counter_hz = 1200.0; },
       "imu.counter_hz: 1200: must be 1 to 128 times sample_rate_hz"},
      {[](StimConfig& c) { c.constant_delay = -1ms; },
       "imu.constant_delay_ms: -1: must be 0 to 100"},
      {[](StimConfig& c) { c.silent_after = 1ms; }, "imu.silent_after_ms: 1: must be 50 to 600000"},
      {[](StimConfig& c) { c.reconnect_period = 0ms; },
       "imu.reconnect_period_ms: 0: must be 20 to 60000"},
      {[](StimConfig& c) { c.reopen_after = -1ms; },
       "imu.reopen_after_ms: -1: must be 0 to 600000"},
      {[](StimConfig& c) { c.frozen_after = 2min; },
       "imu.frozen_after_ms: 120000: must be 0 to 60000"},
  };
  for (const Case& c : cases) {
    StimConfig config = good;
    c.spoil(config);
    EXPECT_THAT(CheckStimConfig(config), testing::ElementsAre(testing::HasSubstr(c.message)));
  }
}

TEST(StimConfigs, ModelsHaveTheirWords) {
  for (const StimModel model : {StimModel::kStim300, StimModel::kStim210, StimModel::kStim202}) {
    EXPECT_EQ(StimModelFromWord(WordOf(model)), model);
  }
  EXPECT_FALSE(StimModelFromWord("stim318"));
}

}  // namespace
}  // namespace tbm
