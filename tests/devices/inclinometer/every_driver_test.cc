// What every inclinometer driver must do, on its emulator over a pseudo-terminal. A new driver is
// added as one more Kind and passes the same list.
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include "tests/devices/inclinometer/emulated_rig.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using namespace std::chrono_literals;
using std::chrono::steady_clock;

constexpr double kDeg = std::numbers::pi / 180.0;

// One instrument of either family behind the same few knobs.
class Emulated {
 public:
  virtual ~Emulated() = default;
  virtual void Unplug() = 0;
  virtual void Replug() = 0;
  virtual FaultQueue& faults() = 0;
};

class EmulatedModbus final : public Emulated {
 public:
  EmulatedModbus(const InclinometerConfig& config, TiltTruth truth, const Clock& clock)
      : emulator_(
            config.port, {{config.address, config.registers, std::move(truth), 21.0}}, 1ms, clock) {
  }
  void Unplug() override { emulator_.Unplug(); }
  void Replug() override { emulator_.Replug(); }
  FaultQueue& faults() override { return emulator_.faults(); }

 private:
  ModbusEmulator emulator_;
};

class EmulatedFrames final : public Emulated {
 public:
  EmulatedFrames(const InclinometerConfig& config,
                 FrameFamily family,
                 FrameLayout layout,
                 TiltTruth truth,
                 const Clock& clock)
      : emulator_(config.port,
                  family,
                  {{static_cast<std::uint8_t>(config.address), layout, std::move(truth), 21.0}},
                  1ms,
                  10ms,
                  clock) {}
  void Unplug() override { emulator_.Unplug(); }
  void Replug() override { emulator_.Replug(); }
  FaultQueue& faults() override { return emulator_.faults(); }

 private:
  BcdFrameEmulator emulator_;
};

struct Kind {
  std::string name;
  InclinometerDriver driver;
  FrameLayout layout = FrameLayout::kFourByte;
  bool automatic = false;
  double resolution_deg = 0.0001;
};

void PrintTo(const Kind& kind, std::ostream* out) { *out << kind.name; }

class EveryDriver : public testing::TestWithParam<Kind> {
 protected:
  EveryDriver() {
    config_ = test::QuickConfig(GetParam().driver, folder_ / "tilt");
    config_.automatic_output = GetParam().automatic;
  }

  void Emulate() {
    if (GetParam().driver == InclinometerDriver::kModbus) {
      emulated_ = std::make_unique<EmulatedModbus>(config_, truth_.Function(), clock_);
      return;
    }
    const FrameFamily family = GetParam().driver == InclinometerDriver::kRion68
                                   ? FrameFamily::kRion68
                                   : FrameFamily::kBewis77;
    emulated_ = std::make_unique<EmulatedFrames>(
        config_, family, GetParam().layout, truth_.Function(), clock_);
  }
  void Make() {
    ASSERT_TRUE(FindFaults(config_).empty());
    driver_ = std::move(MakeInclinometers(std::span(&config_, 1), {}, clock_, sleeper_)[0]);
  }

  Result<TiltSample, InclinometerFailure> Read() {
    return driver_->Read(steady_clock::now() + 100ms);
  }
  // Reads until the state is reached; false after a time that only a broken driver needs.
  bool Reaches(InclinometerState state) {
    const auto limit = steady_clock::now() + 10s;
    while (steady_clock::now() < limit) {
      [[maybe_unused]] const auto sample = Read();
      if (driver_->Health().state == state) return true;
    }
    return false;
  }
  std::optional<TiltSample> NextSample() {
    const auto limit = steady_clock::now() + 10s;
    while (steady_clock::now() < limit) {
      if (const auto sample = Read()) return *sample;
    }
    return std::nullopt;
  }

  test::TempFolder folder_;
  SystemClock clock_;
  SystemSleeper sleeper_;
  test::MovableTruth truth_{{1.2345 * kDeg, -2.3456 * kDeg}};
  InclinometerConfig config_;
  std::unique_ptr<Emulated> emulated_;
  std::unique_ptr<Inclinometer> driver_;
};

TEST_P(EveryDriver, OpensAndStreamsTheTruth) {
  Emulate();
  Make();
  EXPECT_EQ(driver_->Health().state, InclinometerState::kClosed);
  const Timestamp before = clock_.Now();
  const auto sample = NextSample();
  ASSERT_TRUE(sample.has_value());
  EXPECT_EQ(driver_->Health().state, InclinometerState::kStreaming);
  const double half_digit = 0.5001 * GetParam().resolution_deg * kDeg;
  EXPECT_NEAR(sample->raw.beta_rad, 1.2345 * kDeg, half_digit);
  EXPECT_NEAR(sample->raw.gamma_rad, -2.3456 * kDeg, half_digit);
  EXPECT_GE(sample->sensed_at, before);
  EXPECT_LE(sample->sensed_at, clock_.Now());
}

TEST_P(EveryDriver, FollowsAMove) {
  Emulate();
  Make();
  ASSERT_TRUE(NextSample());
  truth_.Set({1.5 * kDeg, -2.0 * kDeg});
  const auto limit = steady_clock::now() + 10s;
  double beta_rad = 0.0;
  while (std::abs(beta_rad - 1.5 * kDeg) > 1e-6 && steady_clock::now() < limit) {
    const auto sample = NextSample();
    ASSERT_TRUE(sample);
    beta_rad = sample->raw.beta_rad;
  }
  EXPECT_NEAR(beta_rad, 1.5 * kDeg, 1e-6);
}

TEST_P(EveryDriver, WaitsForAPortThatIsNotThereYet) {
  Make();
  const auto first = Read();
  ASSERT_FALSE(first);
  EXPECT_EQ(first.error(), InclinometerFailure::kPortMissing);
  EXPECT_EQ(driver_->Health().state, InclinometerState::kClosed);
  Emulate();
  EXPECT_TRUE(Reaches(InclinometerState::kStreaming));
}

TEST_P(EveryDriver, GoesSilentAndComesBack) {
  Emulate();
  Make();
  ASSERT_TRUE(Reaches(InclinometerState::kStreaming));
  emulated_->faults().SetLasting(EmulatorFault{EmulatorFaultKind::kDrop});
  ASSERT_TRUE(Reaches(InclinometerState::kSilent));
  EXPECT_EQ(driver_->Health().last_failure, InclinometerFailure::kNoReply);
  emulated_->faults().Clear();
  EXPECT_TRUE(Reaches(InclinometerState::kStreaming));
}

TEST_P(EveryDriver, RefusesGarbageAndGoesOn) {
  Emulate();
  Make();
  ASSERT_TRUE(NextSample());
  const auto good_before = driver_->Health().counters.good;
  for (const auto kind : {EmulatorFaultKind::kWrongCheck,
                          EmulatorFaultKind::kTruncated,
                          EmulatorFaultKind::kOtherId,
                          EmulatorFaultKind::kOutOfRange}) {
    emulated_->faults().Add({kind}, 2);
  }
  const auto limit = steady_clock::now() + 20s;
  while (driver_->Health().counters.good < good_before + 20 && steady_clock::now() < limit) {
    const auto sample = Read();
    if (!sample) continue;
    // Nothing but the truth ever comes out.
    EXPECT_NEAR(sample->raw.beta_rad, 1.2345 * kDeg, 0.01 * kDeg);
    EXPECT_NEAR(sample->raw.gamma_rad, -2.3456 * kDeg, 0.01 * kDeg);
  }
  const InclinometerHealth health = driver_->Health();
  EXPECT_GE(health.counters.good, good_before + 20);
  const auto refused =
      health.counters.garbled + health.counters.no_reply + health.counters.implausible;
  // A frame out of range that a good one follows in the same piece of a stream is never looked at.
  EXPECT_GE(refused, GetParam().automatic ? 6u : 8u);
}

TEST_P(EveryDriver, SurvivesUnplugAndReplug) {
  Emulate();
  Make();
  for (int round = 0; round < 3; ++round) {
    ASSERT_TRUE(Reaches(InclinometerState::kStreaming)) << "round " << round;
    emulated_->Unplug();
    ASSERT_TRUE(Reaches(InclinometerState::kClosed)) << "round " << round;
    emulated_->Replug();
  }
  ASSERT_TRUE(Reaches(InclinometerState::kStreaming));
  EXPECT_EQ(driver_->Health().counters.reconnects, 3u);
}

double ProcessorSeconds() {
  rusage usage{};
  getrusage(RUSAGE_THREAD, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

TEST_P(EveryDriver, SleepsWhileUnpluggedAndWhileSilent) {
  Emulate();
  Make();
  ASSERT_TRUE(Reaches(InclinometerState::kStreaming));
  for (const bool unplugged : {true, false}) {
    if (unplugged) {
      emulated_->Unplug();
    } else {
      emulated_->Replug();
      emulated_->faults().SetLasting(EmulatorFault{EmulatorFaultKind::kDrop});
    }
    const auto start = steady_clock::now();
    const double used_before = ProcessorSeconds();
    while (steady_clock::now() < start + 600ms) {
      [[maybe_unused]] const auto sample = Read();
    }
    const double wall_s = std::chrono::duration<double>(steady_clock::now() - start).count();
    // A driver that spins uses 0.7 and more; sleeping ones were seen below 0.01.
    EXPECT_LT((ProcessorSeconds() - used_before) / wall_s, 0.1) << "unplugged: " << unplugged;
  }
}

TEST_P(EveryDriver, RefusesAPortThatIsInUse) {
  Emulate();
  Make();
  ASSERT_TRUE(NextSample());
  auto second = std::move(MakeInclinometers(std::span(&config_, 1), {}, clock_, sleeper_)[0]);
  const auto sample = second->Read(steady_clock::now() + 100ms);
  ASSERT_FALSE(sample);
  EXPECT_EQ(sample.error(), InclinometerFailure::kPortRefused);
}

INSTANTIATE_TEST_SUITE_P(
    Kinds,
    EveryDriver,
    testing::Values(
        Kind{"modbus", InclinometerDriver::kModbus, FrameLayout::kFourByte, false, 0.001},
        Kind{"rion68", InclinometerDriver::kRion68, FrameLayout::kFourByteTemperature},
        Kind{
            "rion68_three_byte", InclinometerDriver::kRion68, FrameLayout::kThreeByte, false, 0.01},
        Kind{"bewis77", InclinometerDriver::kBewis77},
        Kind{"rion68_automatic",
             InclinometerDriver::kRion68,
             FrameLayout::kFourByteTemperature,
             true},
        Kind{"bewis77_automatic", InclinometerDriver::kBewis77, FrameLayout::kFourByte, true}),
    [](const auto& kind) { return kind.param.name; });

}  // namespace
}  // namespace tbm
