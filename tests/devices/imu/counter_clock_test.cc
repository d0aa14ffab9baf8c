#include "devices/imu/counter_clock.h"

#include <chrono>
#include <cmath>
#include <functional>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace tbm {
namespace {

using std::chrono::steady_clock;
using test::Random;

double Seconds(Duration span) { return static_cast<double>(span.count()) * 1e-9; }
Duration FromSeconds(double seconds) { return Duration(std::llround(seconds * 1e9)); }

// A unit of 500 samples a second, whose crystal is off, and the delays of the way to us.
struct Crystal {
  double error_ppm = 0.0;
  double rate_hz = 500.0;
  int counter_step = 4;

  double SampledAt(int sample) const { return sample * (1.0 + 1e-6 * error_ppm) / rate_hz; }
  std::uint8_t Counter(int sample) const {
    return static_cast<std::uint8_t>(sample * counter_step);
  }
};

const steady_clock::time_point kStart{std::chrono::hours(30)};

struct Stamped {
  int sample;
  double error_s;  // stamp minus the instant it was sampled
  double at_s;
};

std::vector<Stamped> StampAll(CounterClock& clock,
                              const Crystal& crystal,
                              int samples,
                              const std::function<double(int)>& delay_s) {
  std::vector<Stamped> stamped;
  for (int i = 0; i < samples; ++i) {
    const double sampled_s = crystal.SampledAt(i);
    const auto time =
        clock.Next({crystal.Counter(i), i > 0, kStart + FromSeconds(sampled_s + delay_s(i))});
    if (!time) continue;
    const double at_s = Seconds(time->at - kStart);
    stamped.push_back({i, at_s - sampled_s, at_s});
  }
  return stamped;
}

double Spread(const std::vector<Stamped>& stamped) {
  double mean = 0.0;
  for (const Stamped& s : stamped) mean += s.error_s;
  mean /= static_cast<double>(stamped.size());
  double sum = 0.0;
  for (const Stamped& s : stamped) sum += (s.error_s - mean) * (s.error_s - mean);
  return std::sqrt(sum / static_cast<double>(stamped.size()));
}

TEST(CounterClock, MakesNoJitterOfTheUnitOutOfJitterOfThePort) {
  for (const double error_ppm : {-100.0, -30.0, 0.0, 30.0, 100.0}) {
    Random random("port jitter");
    CounterClock clock({});
    const Crystal crystal{error_ppm};
    const auto stamped = StampAll(clock, crystal, 30'000, [&](int) {
      const bool is_late = random.Unit() < 0.002;
      return random.Uniform(0.0, 2e-3) + (is_late ? 30e-3 : 0.0);
    });
    ASSERT_GT(stamped.size(), 29'000u);
    EXPECT_LT(Spread(stamped), 30e-6) << error_ppm;  // of 1530 us that the arrivals spread
    for (std::size_t i = 1; i < stamped.size(); ++i) {
      const double step_s = stamped[i].at_s - stamped[i - 1].at_s;
      ASSERT_GE(step_s, 0.99 * 2e-3 - 2e-9) << i;
      ASSERT_LE(step_s, 1.0002 * 2e-3 + 2e-9) << i;
      ASSERT_GT(stamped[i].error_s, -60e-6) << i;
      ASSERT_LT(stamped[i].error_s, 250e-6) << i;
    }
  }
}

TEST(CounterClock, FollowsACrystalThatIsOffForAnHour) {
  for (const double error_ppm : {-100.0, 100.0}) {
    CounterClock clock({});
    const auto stamped =
        StampAll(clock, {error_ppm}, 1'800'000, [](int i) { return i % 10 == 0 ? 0.0 : 0.5e-3; });
    ASSERT_FALSE(stamped.empty());
    EXPECT_NEAR(stamped.back().error_s, 0.0, 20e-6);  // the crystal is 360 ms off by then
    EXPECT_EQ(clock.restarts(), 0u);
  }
}

TEST(CounterClock, CountsOnOverLostDatagramsAlsoMoreThanOnceRound) {
  for (const int lost : {1, 5, 31, 62, 63, 64, 100, 140}) {
    CounterClock clock({});
    const Crystal crystal;
    for (int i = 0; i < 600; ++i) {
      const int sample = i < 500 ? i : i + lost;
      const double delay_s = i % 7 * 1e-3;
      const auto time = clock.Next({crystal.Counter(sample),
                                    i != 500,
                                    kStart + FromSeconds(crystal.SampledAt(sample) + delay_s)});
      if (i < 400) continue;
      ASSERT_TRUE(time) << lost;
      EXPECT_EQ(time->ticks, 4 * sample) << lost;
      EXPECT_NEAR(Seconds(time->at - kStart), crystal.SampledAt(sample), 80e-6) << lost;
    }
  }
}

TEST(CounterClock, IsNotMisledWhenTheComputerStopsForAWhile) {
  CounterClock clock({});
  // For 100 ms nothing is read, then fifty datagrams at once, each behind the other.
  const auto stamped =
      StampAll(clock, {}, 1000, [](int i) { return i >= 600 && i < 650 ? (650 - i) * 2e-3 : 0.0; });
  ASSERT_GT(stamped.size(), 700u);
  for (const Stamped& s : stamped) EXPECT_NEAR(s.error_s, 0.0, 30e-6) << s.sample;
  EXPECT_EQ(clock.restarts(), 0u);
}

TEST(CounterClock, GivesNoStampWhileItSettles) {
  CounterClock clock({});
  // The first arrivals are very late, as after a port was opened.
  const auto stamped =
      StampAll(clock, {}, 500, [](int i) { return i < 100 ? 25e-3 : i % 2 * 1e-3; });
  ASSERT_FALSE(stamped.empty());
  EXPECT_NEAR(stamped.front().sample, 263, 2);  // 0.5 s after the first arrival
  for (const Stamped& s : stamped) EXPECT_NEAR(s.error_s, 0.0, 20e-6) << s.sample;
}

// What a clock says to a unit that is set up otherwise, over four seconds.
struct Said {
  int stamps = 0;
  int wrong_rate = 0;
};
Said Listen(const CounterClockSettings& settings, const Crystal& crystal, bool has_counter) {
  CounterClock clock(settings);
  Said said;
  for (int i = 0; i < static_cast<int>(4.0 * crystal.rate_hz); ++i) {
    CounterClock::Arrival arrival{std::nullopt, i > 0, kStart + FromSeconds(crystal.SampledAt(i))};
    if (has_counter) arrival.counter = crystal.Counter(i);
    const auto time = clock.Next(arrival);
    if (time) ++said.stamps;
    if (!time && time.error() == CounterClockFailure::kWrongRate) ++said.wrong_rate;
  }
  return said;
}

TEST(CounterClock, SaysWhenTheUnitIsSetToAnotherRate) {
  for (const auto& [rate_hz, counter_step] : {std::pair{250.0, 8},
                                              std::pair{1000.0, 2},
                                              std::pair{125.0, 16},
                                              std::pair{500.0, 1},
                                              std::pair{500.0, 0}}) {
    const Said said = Listen({}, {0.0, rate_hz, counter_step}, true);
    EXPECT_EQ(said.stamps, 0) << rate_hz << " Hz, steps of " << counter_step;
    EXPECT_GT(said.wrong_rate, 2 * rate_hz) << rate_hz << " Hz, steps of " << counter_step;
  }
  const Said right = Listen({}, {}, true);
  EXPECT_GT(right.stamps, 1700);
  EXPECT_EQ(right.wrong_rate, 0);
}

TEST(CounterClock, WithoutACounterCountsDatagrams) {
  EXPECT_GT(Listen({}, {}, false).stamps, 1700);
  EXPECT_EQ(Listen({}, {0.0, 250.0, 8}, false).stamps, 0);
  EXPECT_EQ(Listen({}, {0.0, 1000.0, 2}, false).stamps, 0);
  CounterClock clock({});
  for (int i = 0; i < 600; ++i) {
    const int sample = i < 500 ? i : i + 7;
    const auto time =
        clock.Next({std::nullopt, i != 500, kStart + FromSeconds(0.002 * sample + i % 3 * 0.3e-3)});
    if (i < 400) continue;
    ASSERT_TRUE(time);
    EXPECT_EQ(time->ticks, 4 * sample);
  }
}

TEST(CounterClock, StartsAnewAfterAPauseAndAfterAJump) {
  for (const double jump_s : {-0.08, 0.08, 2.0}) {
    CounterClock clock({});
    int refused = 0;
    int stamps_astray = 0;
    for (int i = 0; i < 3000; ++i) {
      const double sampled_s = 0.002 * i + (i < 1000 ? 0.0 : jump_s);
      // A pause is the unit's (its counter begins elsewhere), a jump the computer's.
      const int number = i >= 1000 && jump_s > 1.0 ? i + 17 : i;
      const bool follows = i > 0 && !(i == 1000 && jump_s > 1.0);
      const auto time =
          clock.Next({Crystal{}.Counter(number), follows, kStart + FromSeconds(sampled_s)});
      if (i < 1000) continue;
      if (!time) ++refused;
      if (time && std::abs(Seconds(time->at - kStart) - sampled_s) > 1e-3) ++stamps_astray;
    }
    EXPECT_EQ(clock.restarts(), 1u) << jump_s;
    EXPECT_NEAR(refused, 250, 5) << jump_s;
    // Late by 80 ms may be congestion: it is believed after a second.
    EXPECT_NEAR(stamps_astray, jump_s == 0.08 ? 500 : 0, 5) << jump_s;
  }
}

}  // namespace
}  // namespace tbm
