#include <cmath>

#include <gtest/gtest.h>

#include "devices/inclinometer/make_inclinometers.h"
#include "tests/devices/inclinometer/fake_line.h"

namespace tbm {
namespace {

using namespace std::chrono_literals;
using test::FakeClock;
using test::FakeSleeper;

class SimAndReplay : public testing::Test {
 protected:
  std::unique_ptr<Inclinometer> Make(const InclinometerConfig& config,
                                     const InclinometerSources& sources) {
    return std::move(MakeInclinometers(std::span(&config, 1), sources, clock_, sleeper_)[0]);
  }
  InclinometerConfig Config(InclinometerDriver driver, const std::string& name) {
    InclinometerConfig config;
    config.driver = driver;
    config.name = name;
    return config;
  }
  FakeClock clock_;
  FakeSleeper sleeper_{clock_};
};

TEST_F(SimAndReplay, SimSeesTheTruthAtItsSensingInstant) {
  InclinometerConfig config = Config(InclinometerDriver::kSim, "target");
  config.sim_sigma_rad = 0.0;
  config.sim_resolution_rad = 0.0;
  config.latency = 30ms;
  const Timestamp start = clock_.Now();
  InclinometerSources sources;
  sources.truths["target"] = [start](Timestamp at) {
    return Inclination{SecondsBetween(start, at), -SecondsBetween(start, at)};
  };
  const auto sim = Make(config, sources);
  for (int i = 0; i < 10; ++i) {
    const auto sample = sim->Read(clock_.Steady() + 1s);
    ASSERT_TRUE(sample);
    EXPECT_EQ(sample->sensed_at, clock_.Now() - 30ms);
    EXPECT_DOUBLE_EQ(sample->raw.beta_rad, SecondsBetween(start, sample->sensed_at));
    EXPECT_NEAR(SecondsBetween(start, sample->sensed_at), 0.050 * i - 0.030, 1e-9);
  }
  EXPECT_EQ(sim->Health().state, InclinometerState::kStreaming);
}

TEST_F(SimAndReplay, SimNoiseHasTheDeclaredSigmaAndItsOwnStream) {
  InclinometerConfig config = Config(InclinometerDriver::kSim, "target");
  config.sim_sigma_rad = 1e-3;
  InclinometerSources sources;
  sources.truths["target"] = [](Timestamp) { return Inclination{0.1, 0.2}; };
  sources.truths["camera"] = sources.truths["target"];
  const auto draw = [&](const std::string& name, std::uint64_t seed) {
    sources.seed = seed;
    config.name = name;
    const auto sim = Make(config, sources);
    std::vector<double> values;
    for (int i = 0; i < 2000; ++i) {
      const auto sample = sim->Read(clock_.Steady() + 1s);
      values.push_back(sample->raw.beta_rad - 0.1);
      values.push_back(sample->raw.gamma_rad - 0.2);
    }
    return values;
  };
  const auto values = draw("target", 1);
  double sum = 0.0;
  double sum_squares = 0.0;
  for (const double value : values) {
    sum += value;
    sum_squares += value * value;
  }
  EXPECT_NEAR(sum / 4000, 0.0, 5e-5);                      // 3 sigma of the mean
  EXPECT_NEAR(std::sqrt(sum_squares / 4000), 1e-3, 4e-5);  // 3.5 sigma of the spread
  EXPECT_EQ(values, draw("target", 1));
  EXPECT_NE(values, draw("target", 2));
  EXPECT_NE(values, draw("camera", 1));
}

TEST_F(SimAndReplay, ReplayGivesEverySampleBitForBitAtItsTime) {
  InclinometerSources sources;
  const Timestamp start{1'000'000'000};
  std::vector<TiltSample> recorded;
  for (int i = 0; i < 20; ++i) {
    recorded.push_back({start + i * 70ms, {0.1 / (i + 1), -0.3 / (i + 1)}, std::nullopt});
  }
  sources.recordings["camera"] = recorded;
  sources.replay_start = start - 100ms;
  const auto replay = Make(Config(InclinometerDriver::kReplay, "camera"), sources);
  const auto began = clock_.Steady();
  std::size_t next = 0;
  while (next < recorded.size()) {
    const auto sample = replay->Read(clock_.Steady() + 50ms);
    if (!sample) {
      ASSERT_EQ(sample.error(), InclinometerFailure::kNotDue);
      continue;
    }
    EXPECT_EQ(sample->sensed_at, recorded[next].sensed_at);
    EXPECT_EQ(sample->raw.beta_rad, recorded[next].raw.beta_rad);
    EXPECT_EQ(sample->raw.gamma_rad, recorded[next].raw.gamma_rad);
    EXPECT_EQ(clock_.Steady() - began, 100ms + next * 70ms);
    ++next;
  }
  const auto before = clock_.Steady();
  const auto after_end = replay->Read(before + 50ms);
  ASSERT_FALSE(after_end);
  EXPECT_EQ(after_end.error(), InclinometerFailure::kEnded);
  EXPECT_EQ(clock_.Steady() - before, 50ms);
  EXPECT_EQ(replay->Health().state, InclinometerState::kClosed);
}

TEST_F(SimAndReplay, ReplayAtSpeedZeroDoesNotWait) {
  InclinometerSources sources;
  sources.recordings["camera"] = {{{0}, {0.1, 0.2}, {}}, {{3'600'000'000'000}, {0.3, 0.4}, {}}};
  sources.replay_speed = 0.0;
  const auto replay = Make(Config(InclinometerDriver::kReplay, "camera"), sources);
  const auto began = clock_.Steady();
  EXPECT_TRUE(replay->Read(began));
  EXPECT_TRUE(replay->Read(began));
  EXPECT_EQ(clock_.Steady(), began);
}

}  // namespace
}  // namespace tbm
