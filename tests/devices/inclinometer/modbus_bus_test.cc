// Two Modbus inclinometers on one RS-485 pair, libmodbus against the byte-level emulator: every
// fault costs exactly one reading, and no reading ever belongs to another question or another
// instrument.
#include <array>
#include <atomic>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/devices/inclinometer/emulated_rig.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using namespace std::chrono_literals;
using std::chrono::steady_clock;

// Counts up by one digit with every question, so each answer tells which question it belongs to.
class CountingTruth {
 public:
  TiltTruth Function() {
    return [this](Timestamp) {
      const int asked = ++asked_;
      return Inclination{DegToRad(0.001 * asked), DegToRad(-0.001 * asked)};
    };
  }
  int asked() const { return asked_; }

 private:
  std::atomic<int> asked_ = 0;
};

int CountOf(const TiltSample& sample) {
  return static_cast<int>(std::lround(RadToDeg(sample.raw.beta_rad) / 0.001));
}

// A machine too busy to let the emulator answer within 100 ms looks like one more fault. A mistake
// in the driver comes back in every attempt; a pause does not.
bool ComesOutExact(const std::function<bool()>& attempt) {
  for (int i = 0; i < 5; ++i) {
    if (attempt()) return true;
  }
  return false;
}

class OneInstrument : public testing::Test {
 protected:
  OneInstrument() : config_(test::QuickConfig(InclinometerDriver::kModbus, folder_ / "tilt")) {
    config_.poll_period = 1ms;
  }
  // Asks until `wanted` good readings have come in. How many questions failed, or empty when a
  // reading did not belong to its question.
  std::optional<int> ReadGood(Inclinometer& driver, int wanted) {
    int failed = 0;
    const auto limit = steady_clock::now() + 30s;
    while (wanted > 0 && steady_clock::now() < limit) {
      const int asked_before = truth_.asked();
      const auto sample = driver.Read(steady_clock::now() + 1s);
      if (sample && CountOf(*sample) != asked_before + 1) return std::nullopt;
      if (sample) --wanted;
      if (!sample && sample.error() != InclinometerFailure::kNotDue) ++failed;
    }
    return failed;
  }

  test::TempFolder folder_;
  SystemClock clock_;
  SystemSleeper sleeper_;
  CountingTruth truth_;
  InclinometerConfig config_;
};

TEST_F(OneInstrument, LateRepliesAreNeverTakenForTheNextAnswer) {
  EXPECT_TRUE(ComesOutExact([&] {
    ModbusEmulator emulator(
        config_.port, {{1, config_.registers, truth_.Function(), 21.0}}, 1ms, clock_);
    const auto driver =
        std::move(MakeInclinometers(std::span(&config_, 1), {}, clock_, sleeper_)[0]);
    if (ReadGood(*driver, 5) != 0) return false;
    constexpr int kFaults = 6;
    for (int i = 0; i < kFaults; ++i) {
      emulator.faults().Add({EmulatorFaultKind::kLate, 150ms});
      if (ReadGood(*driver, 5) != 1) return false;
    }
    const InclinometerCounters counters = driver->Health().counters;
    return counters.no_reply == kFaults && counters.stale == kFaults &&
           counters.good == 5u * (kFaults + 1) && counters.requests == counters.good + kFaults;
  }));
}

TEST_F(OneInstrument, EveryFaultCostsOneReading) {
  for (const EmulatorFault& fault : {EmulatorFault{EmulatorFaultKind::kDrop},
                                     EmulatorFault{EmulatorFaultKind::kWrongCheck},
                                     EmulatorFault{EmulatorFaultKind::kTruncated},
                                     EmulatorFault{EmulatorFaultKind::kNoise},
                                     EmulatorFault{EmulatorFaultKind::kOtherId},
                                     EmulatorFault{EmulatorFaultKind::kOutOfRange},
                                     EmulatorFault{EmulatorFaultKind::kLate, 150ms}}) {
    EXPECT_TRUE(ComesOutExact([&] {
      ModbusEmulator emulator(
          config_.port, {{1, config_.registers, truth_.Function(), 21.0}}, 1ms, clock_);
      const auto driver =
          std::move(MakeInclinometers(std::span(&config_, 1), {}, clock_, sleeper_)[0]);
      if (ReadGood(*driver, 3) != 0) return false;
      emulator.faults().Add(fault);
      return ReadGood(*driver, 3) == 1 && emulator.faults().taken() == 1 &&
             driver->Health().counters.reconnects == 0;
    })) << "fault "
        << static_cast<int>(fault.kind);
  }
}

TEST_F(OneInstrument, NamesAWrongRegisterMap) {
  ModbusEmulator emulator(
      config_.port, {{1, config_.registers, truth_.Function(), 21.0}}, 1ms, clock_);
  config_.registers.beta_register = 700;
  config_.registers.gamma_register = 701;
  const auto driver = std::move(MakeInclinometers(std::span(&config_, 1), {}, clock_, sleeper_)[0]);
  const auto sample = driver->Read(steady_clock::now() + 1s);
  ASSERT_FALSE(sample);
  EXPECT_EQ(sample.error(), InclinometerFailure::kException);
}

TEST_F(OneInstrument, ReadsEveryRegisterFormat) {
  struct Case {
    int function;
    RegisterFormat format;
    WordOrder order;
    int offset_lsb;
    double deg_per_lsb;
  };
  for (const Case& c : {Case{3, RegisterFormat::kInt16, WordOrder::kHighFirst, 0, 0.001},
                        Case{4, RegisterFormat::kUint16, WordOrder::kHighFirst, 20000, 0.01},
                        Case{3, RegisterFormat::kInt32, WordOrder::kHighFirst, 0, 0.0001},
                        Case{4, RegisterFormat::kInt32, WordOrder::kLowFirst, 0, 0.0001},
                        Case{3, RegisterFormat::kFloat32, WordOrder::kLowFirst, 0, 1.0}}) {
    config_.registers.function = c.function;
    config_.registers.format = c.format;
    config_.registers.word_order = c.order;
    config_.registers.offset_lsb = c.offset_lsb;
    config_.registers.rad_per_lsb = DegToRad(c.deg_per_lsb);
    config_.registers.beta_register = 12;
    config_.registers.gamma_register = 10;
    config_.registers.temperature_register = 20;
    ASSERT_TRUE(FindFaults(config_).empty());
    const TiltTruth truth = [](Timestamp) { return Inclination{DegToRad(-12.34), DegToRad(5.67)}; };
    ModbusEmulator emulator(config_.port, {{1, config_.registers, truth, -7.5}}, 1ms, clock_);
    const auto driver =
        std::move(MakeInclinometers(std::span(&config_, 1), {}, clock_, sleeper_)[0]);
    const auto sample = driver->Read(steady_clock::now() + 1s);
    ASSERT_TRUE(sample) << FailureCode(sample.error());
    EXPECT_NEAR(RadToDeg(sample->raw.beta_rad), -12.34, 1e-6);
    EXPECT_NEAR(RadToDeg(sample->raw.gamma_rad), 5.67, 1e-6);
    EXPECT_NEAR(sample->temperature_celsius.value_or(0.0), -7.5, 1e-9);
  }
}

class TwoOnOneBus : public testing::Test {
 protected:
  TwoOnOneBus() {
    for (int i = 0; i < 2; ++i) {
      InclinometerConfig config = test::QuickConfig(InclinometerDriver::kModbus, folder_ / "bus");
      config.name = i == 0 ? "target" : "camera";
      config.address = 1 + i;
      config.poll_period = 5ms;
      config.silent_after = 500ms;
      configs_.push_back(config);
    }
  }
  TiltTruth TruthOf(int i) {
    return [i](Timestamp) { return Inclination{DegToRad(1.0 + i), DegToRad(-1.0 - i)}; };
  }
  std::vector<EmulatedModbusTilt> Both() {
    return {{1, configs_[0].registers, TruthOf(0), 21.0},
            {2, configs_[1].registers, TruthOf(1), 22.0}};
  }

  // Both are read by a thread each, while every few readings one answer is spoilt. How many
  // readings failed in all.
  int FaultsSeenByTwoThreads(int faults) {
    ModbusEmulator emulator(configs_[0].port, Both(), 1ms, clock_);
    const auto drivers = MakeInclinometers(configs_, {}, clock_, sleeper_);
    std::atomic<int> failed = 0;
    std::atomic<bool> is_done = false;
    const auto run = [&](std::size_t i) {
      while (!is_done) {
        const auto sample = drivers[i]->Read(steady_clock::now() + 50ms);
        if (sample) {
          EXPECT_NEAR(RadToDeg(sample->raw.beta_rad), 1.0 + static_cast<double>(i), 1e-6);
          EXPECT_NEAR(RadToDeg(sample->raw.gamma_rad), -1.0 - static_cast<double>(i), 1e-6);
        } else if (sample.error() != InclinometerFailure::kNotDue) {
          ++failed;
        }
      }
    };
    std::thread target(run, 0);
    std::thread camera(run, 1);
    const auto limit = steady_clock::now() + 20s;
    const auto wait_for_good = [&](std::uint64_t more) {
      const auto good = [&](int i) {
        return drivers[static_cast<std::size_t>(i)]->Health().counters.good;
      };
      const std::uint64_t enough[] = {good(0) + more, good(1) + more};
      while ((good(0) < enough[0] || good(1) < enough[1]) && steady_clock::now() < limit) {
        std::this_thread::sleep_for(1ms);
      }
    };
    for (int i = 0; i < faults; ++i) {
      wait_for_good(3);
      const auto kind = i % 2 == 0 ? EmulatorFaultKind::kLate : EmulatorFaultKind::kOtherId;
      emulator.faults().Add({kind, 150ms});
      while (emulator.faults().taken() <= i && steady_clock::now() < limit) {
        std::this_thread::sleep_for(1ms);
      }
    }
    wait_for_good(3);
    is_done = true;
    target.join();
    camera.join();
    return failed;
  }

  test::TempFolder folder_;
  SystemClock clock_;
  SystemSleeper sleeper_;
  std::vector<InclinometerConfig> configs_;
};

TEST_F(TwoOnOneBus, EachThreadGetsItsOwnAnglesThroughFaults) {
  EXPECT_TRUE(ComesOutExact([&] { return FaultsSeenByTwoThreads(5) == 5; }));
}

TEST_F(TwoOnOneBus, ADeadOneDoesNotStopTheOther) {
  ModbusEmulator emulator(configs_[0].port, {Both()[0]}, 1ms, clock_);
  const auto drivers = MakeInclinometers(configs_, {}, clock_, sleeper_);
  const auto end = steady_clock::now() + 3s;
  int good = 0;
  while (steady_clock::now() < end) {
    if (drivers[0]->Read(steady_clock::now() + 20ms)) ++good;
    EXPECT_FALSE(drivers[1]->Read(steady_clock::now()));
  }
  EXPECT_EQ(drivers[0]->Health().state, InclinometerState::kStreaming);
  EXPECT_EQ(drivers[1]->Health().state, InclinometerState::kSilent);
  // The dead one is asked once a second; each question keeps the wire for 0.3 s of it.
  EXPECT_LE(drivers[1]->Health().counters.requests, 7u);
  EXPECT_GT(good, 10);
}

TEST_F(TwoOnOneBus, BothComeBackAfterUnplugging) {
  ModbusEmulator emulator(configs_[0].port, Both(), 1ms, clock_);
  const auto drivers = MakeInclinometers(configs_, {}, clock_, sleeper_);
  const auto both_are = [&](InclinometerState state) {
    const auto limit = steady_clock::now() + 10s;
    while (steady_clock::now() < limit) {
      for (const auto& driver : drivers) {
        [[maybe_unused]] const auto sample = driver->Read(steady_clock::now() + 20ms);
      }
      if (drivers[0]->Health().state == state && drivers[1]->Health().state == state) return true;
    }
    return false;
  };
  ASSERT_TRUE(both_are(InclinometerState::kStreaming));
  emulator.Unplug();
  ASSERT_TRUE(both_are(InclinometerState::kClosed));
  emulator.Replug();
  EXPECT_TRUE(both_are(InclinometerState::kStreaming));
}

}  // namespace
}  // namespace tbm
