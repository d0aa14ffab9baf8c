#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <utility>

#include <gtest/gtest.h>

#include "devices/total_station/emulator_link.h"
#include "devices/total_station/geocom_total_station.h"
#include "tests/devices/total_station/emulated_station.h"
#include "tests/support/fake_clock.h"

namespace tbm::test {

// Moves the clock instead of waiting, and lets a test act at an instant on the way.
class ActingSleeper final : public Sleeper {
 public:
  explicit ActingSleeper(FakeClock& clock) : clock_(clock) {}
  void SleepUntil(std::chrono::steady_clock::time_point wake) override {
    if (act && act_at <= wake) {
      clock_.AdvanceTo(act_at);
      std::exchange(act, nullptr)();
    }
    clock_.AdvanceTo(wake);
  }
  std::function<void()> act;
  std::chrono::steady_clock::time_point act_at{};

 private:
  FakeClock& clock_;
};

class EmulatedGeocom : public testing::Test {
 protected:
  void Start(GeocomEmulatorOptions options = {}, TotalStationConfig config = {}) {
    config_ = config;
    emulator_.emplace(options, FaultlessInstrument(), clock_);
    auto link = std::make_unique<EmulatorLink>(*emulator_, clock_, sleeper_);
    link_ = link.get();
    station_.emplace(config, std::move(link), 32760, clock_, sleeper_);
  }
  void SetUp() override { Start(); }

  Result<StationIdentity, StationFault> Connect(Duration patience = std::chrono::minutes(1)) {
    return station_->Connect(clock_.Steady() + patience);
  }
  // A telescope on a prism, without a word of protocol.
  void PointAt(std::size_t prism) {
    emulator_->With([&](EmulatedInstrument& instrument) {
      const auto p_in_site = instrument.prisms[prism].p_in_site(clock_.Now());
      instrument.PointTo(instrument.IdealReading(*p_in_site, clock_.Now(), Face::kOne));
    });
  }
  Eigen::Vector3d Prism(std::size_t prism) {
    return emulator_->With([&](EmulatedInstrument& instrument) {
      return *instrument.prisms[prism].p_in_site(clock_.Now());
    });
  }
  void Hide(std::size_t prism) {
    emulator_->With([&](EmulatedInstrument& instrument) {
      instrument.prisms[prism].p_in_site = [](Timestamp) { return std::nullopt; };
      return 0;
    });
  }
  void Fault(GeocomFaultKind kind,
             int rpc = -1,
             int skip = 0,
             Duration delay = Duration::zero(),
             int code = 0) {
    emulator_->faults().Add({kind, rpc, skip, delay, code});
  }
  CircleReading Telescope() {
    return emulator_->With([](EmulatedInstrument& instrument) { return instrument.telescope(); });
  }

  FakeClock clock_;
  ActingSleeper sleeper_{clock_};
  TotalStationConfig config_;
  std::optional<GeocomEmulator> emulator_;
  EmulatorLink* link_ = nullptr;
  std::optional<GeocomTotalStation> station_;
};

inline void ExpectNear(const CircleReading& got, const CircleReading& wanted, double within_rad) {
  EXPECT_NEAR(std::remainder(got.horizontal_rad - wanted.horizontal_rad, 2 * std::numbers::pi),
              0,
              within_rad);
  EXPECT_NEAR(got.zenith_rad, wanted.zenith_rad, within_rad);
}

}  // namespace tbm::test
