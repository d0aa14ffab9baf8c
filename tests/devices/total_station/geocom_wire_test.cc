// The driver against the emulator over a real TCP connection and a real pseudo-terminal, in real
// time: the same list for both.
#include <csignal>
#include <ctime>
#include <fstream>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/bus/tcp_server.h"
#include "devices/total_station/geocom_codes.h"
#include "devices/total_station/make_total_station.h"
#include "tests/devices/total_station/emulated_station.h"
#include "tests/support/process.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using namespace std::chrono_literals;
using enum StationFailure;
using std::chrono::steady_clock;
using test::SightOf;
using testing::HasSubstr;

const Eigen::Vector3d kLeftPrism(997.0, 2060.0, 52.0);

GeocomEmulatorOptions Quick() {
  GeocomEmulatorOptions options;
  options.think_time = 1ms;
  options.distance_time = 10ms;
  options.recognition_time = 5ms;
  options.turn_rad_per_s = 1000.0;
  return options;
}

// Limits that a machine under load keeps; a test that waits for one in vain sets shorter ones.
TotalStationConfig QuickConfig() {
  TotalStationConfig config;
  config.first_back_off = 20ms;
  config.longest_back_off = 100ms;
  return config;
}

class GeocomWire : public testing::TestWithParam<TotalStationDriver> {
 protected:
  void SetUp() override {
    config_.driver = GetParam();
    if (IsTcp()) {
      tcp_.emplace("127.0.0.1", 0, emulator_);
      ASSERT_TRUE(tcp_->IsUp());
      config_.tcp_port = tcp_->port();
    } else {
      config_.port.path = folder_ / "station";
      config_.port.baud = 115200;
      pty_.emplace(config_.port.path, emulator_);
      ASSERT_TRUE(pty_->IsUp());
    }
    station_ = MakeTotalStation(config_, clock_, sleeper_);
  }
  void ConnectWithLimits(Duration answer, Duration motion) {
    config_.answer_timeout = answer;
    config_.motion_timeout = motion;
    station_ = MakeTotalStation(config_, clock_, sleeper_);
    ASSERT_TRUE(Connect());
  }
  bool IsTcp() const { return GetParam() == TotalStationDriver::kGeocomTcp; }
  Result<StationIdentity, StationFault> Connect() {
    return station_->Connect(steady_clock::now() + 3s);
  }
  void Unplug() { IsTcp() ? tcp_->Unplug() : pty_->Unplug(); }
  void Replug() { IsTcp() ? tcp_->Replug() : pty_->Replug(); }
  void PointTo(const CircleReading& reading) {
    emulator_.With([&](EmulatedInstrument& instrument) {
      instrument.PointTo(reading);
      return 0;
    });
  }

  test::TempFolder folder_;
  const SystemClock clock_{};
  SystemSleeper sleeper_;
  TotalStationConfig config_ = QuickConfig();
  GeocomEmulator emulator_{Quick(), test::FaultlessInstrument(), clock_};
  std::optional<TcpServer> tcp_;
  std::optional<PtyServer> pty_;
  std::unique_ptr<TotalStation> station_;
};

TEST_P(GeocomWire, TurnsAndMeasuresInBothFaces) {
  ASSERT_TRUE(Connect());
  EXPECT_TRUE(station_->Health().has_checksum);
  const auto truth = SightOf(kLeftPrism);
  ASSERT_TRUE(station_->TurnTo(truth.circles, Aim::kPrism));
  const Timestamp begun = clock_.Now();
  const auto one = station_->Measure();
  const Timestamp ended = clock_.Now();
  ASSERT_TRUE(one) << FailureCode(one.error().why);
  EXPECT_NEAR(one->circles.horizontal_rad, truth.circles.horizontal_rad, 1e-12);
  EXPECT_NEAR(one->circles.zenith_rad, truth.circles.zenith_rad, 1e-12);
  EXPECT_NEAR(one->slope_m.value(), truth.slope_m, 1e-9);
  EXPECT_GE(one->sensed_at - one->sensed_within, begun);
  EXPECT_LE(one->sensed_at + one->sensed_within, ended);
  ASSERT_TRUE(station_->ChangeFace(Aim::kPrism));
  EXPECT_EQ(station_->Measure()->face, Face::kTwo);
  EXPECT_TRUE(station_->ReadPower());
}

TEST_P(GeocomWire, NoFaultMakesAWrongValueAndEachIsOvercome) {
  ConnectWithLimits(250ms, 250ms);
  int step = 0;
  for (const auto kind : test::kLineFaults) {
    emulator_.faults().Add({kind, -1, 0, kind == GeocomFaultKind::kLate ? 260ms : 20ms, 0});
    for (int i = 0; i < 3; ++i) {
      const CircleReading truth{0.1 * ++step, 1.0};
      PointTo(truth);
      const auto observation = station_->MeasureAngles();
      if (observation) {
        EXPECT_NEAR(observation->circles.horizontal_rad, truth.horizontal_rad, 1e-12)
            << static_cast<int>(kind);
      } else if (!station_->IsConnected()) {
        emulator_.faults().Clear();
        ASSERT_TRUE(Connect()) << static_cast<int>(kind);
      }
    }
    emulator_.faults().Clear();
    EXPECT_TRUE(station_->MeasureAngles()) << static_cast<int>(kind);
  }
}

TEST_P(GeocomWire, AMotionWithoutAnswerIsToldOnce) {
  ConnectWithLimits(2s, 250ms);
  PointTo({2.0, 1.5});
  emulator_.faults().Add({GeocomFaultKind::kLostReply, geocom::kMakePositioning});
  EXPECT_TRUE(station_->TurnTo({2.0, 1.5}, Aim::kDirection));
  EXPECT_EQ(emulator_.carried_out(geocom::kMakePositioning), 1);
}

TEST_P(GeocomWire, ComesBackAfterThePlugWasPulled) {
  ASSERT_TRUE(Connect());
  for (int round = 1; round <= 2; ++round) {
    Unplug();
    const auto lost = station_->ReadPower();
    ASSERT_FALSE(lost);
    EXPECT_EQ(lost.error().why, kLinkLost);
    EXPECT_EQ(station_->Health().state, StationState::kClosed);
    const auto gone = Connect();
    ASSERT_FALSE(gone);
    EXPECT_EQ(gone.error().why, kUnreachable);
    Replug();
    ASSERT_TRUE(Connect());
    EXPECT_TRUE(station_->MeasureAngles());
    EXPECT_EQ(station_->Health().counters.reconnects, static_cast<std::uint64_t>(round));
  }
}

// Another thread stops a motion and reads the health meanwhile, as a process that ends does.
TEST_P(GeocomWire, IsStoppedAndWatchedFromAnotherThread) {
  ASSERT_TRUE(Connect());
  PointTo({0.0, 1.5});
  emulator_.Change([](GeocomEmulatorOptions& options) { options.turn_rad_per_s = 4.0; });
  std::jthread watcher([this](const std::stop_token& stop) {
    const auto abort_at = steady_clock::now() + 200ms;
    while (!stop.stop_requested()) {
      (void)station_->Health();
      if (steady_clock::now() > abort_at) station_->RequestAbort();
      std::this_thread::sleep_for(5ms);
    }
  });
  const auto turned = station_->TurnTo({3.0, 1.5}, Aim::kDirection);
  ASSERT_FALSE(turned);
  EXPECT_EQ(turned.error().why, kAborted);
}

TEST_P(GeocomWire, WaitingCostsNoProcessorTime) {
  ConnectWithLimits(250ms, 250ms);
  emulator_.faults().AddLasting({GeocomFaultKind::kLostReply});
  const std::clock_t before = std::clock();
  const auto begun = steady_clock::now();
  EXPECT_FALSE(station_->ReadPower());
  while (steady_clock::now() < begun + 1s) {
    (void)station_->ReadPower();
    if (!station_->IsConnected()) (void)Connect();
  }
  const double used_s = static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC;
  const double passed_s = std::chrono::duration<double>(steady_clock::now() - begun).count();
  EXPECT_LT(used_s, 0.1 * passed_s);
}

INSTANTIATE_TEST_SUITE_P(Lines,
                         GeocomWire,
                         testing::Values(TotalStationDriver::kGeocomTcp,
                                         TotalStationDriver::kGeocomSerial),
                         [](const auto& line) { return std::string(WordOf(line.param)); });

TEST(GeocomPorts, SayWhyTheyCannotBeOpened) {
  const test::TempFolder folder;
  const SystemClock clock;
  SystemSleeper sleeper;
  TotalStationConfig config = QuickConfig();
  const auto why = [&] {
    const auto station = MakeTotalStation(config, clock, sleeper);
    return station->Connect(steady_clock::now() + 1s).error().why;
  };
  GeocomEmulator emulator(Quick(), test::FaultlessInstrument(), clock);
  {
    const TcpServer server("127.0.0.1", 0, emulator);
    config.tcp_port = server.port();
  }
  EXPECT_EQ(why(), kUnreachable) << "nobody listens";

  config.driver = TotalStationDriver::kGeocomSerial;
  config.port.path = folder / "station";
  EXPECT_EQ(why(), kUnreachable) << "no such file";
  test::WriteText(config.port.path, "a plain file\n");
  EXPECT_EQ(why(), kRefused);
  std::filesystem::remove(config.port.path);
  const PtyServer server(config.port.path, emulator);
  const auto first = MakeTotalStation(config, clock, sleeper);
  ASSERT_TRUE(first->Connect(steady_clock::now() + 1s));
  EXPECT_EQ(why(), kRefused) << "locked by the first";
}

TEST(TotalStationSim, IsAStationForWhoeverConnects) {
  const test::TempFolder folder;
  test::WriteText(folder / "prisms.csv",
                  "prism,x_m,y_m,z_m,constant_mm\nleft,997,2060,52,11.3\nback,1001,1960,51,0\n");
  test::Process simulator({TBM_TOTAL_STATION_SIM,
                           "--prisms",
                           folder / "prisms.csv",
                           "--station",
                           "1000,2000,50",
                           "--circle-zero-deg",
                           "10",
                           "--port",
                           "0",
                           "--refraction-k",
                           "0",
                           "--earth-radius-m",
                           "1e15",
                           "--distance-ms",
                           "20",
                           "--turn-deg-per-s",
                           "10000",
                           "--recognition-ms",
                           "5",
                           "--angle-sigma-arcsec",
                           "0",
                           "--slope-sigma-mm",
                           "0",
                           "--fault",
                           "garbage_before:0.5",
                           "--hide",
                           "back"});
  const auto until = steady_clock::now() + 10s;
  while (!simulator.HasLine("ready") && steady_clock::now() < until) {
    std::this_thread::sleep_for(5ms);
  }
  ASSERT_TRUE(simulator.HasLine("ready")) << simulator.Output();
  TotalStationConfig config = QuickConfig();
  const std::string output = simulator.Output();
  config.tcp_port = std::stoi(output.substr(output.find("port=") + 5));

  const SystemClock clock;
  SystemSleeper sleeper;
  const auto station = MakeTotalStation(config, clock, sleeper);
  ASSERT_TRUE(station->Connect(steady_clock::now() + 5s));
  const auto truth = SightOf(kLeftPrism, 10.0 * std::numbers::pi / 180);
  ASSERT_TRUE(station->SetPrismConstant(0.0113));
  const auto turned = station->TurnTo(truth.circles, Aim::kPrism);
  ASSERT_TRUE(turned) << FailureCode(turned.error().why);
  const auto observation = station->Measure();
  ASSERT_TRUE(observation) << FailureCode(observation.error().why);
  EXPECT_NEAR(observation->slope_m.value(), truth.slope_m, 1e-9);
  EXPECT_NEAR(observation->circles.horizontal_rad, truth.circles.horizontal_rad, 1e-12);
  const auto hidden = SightOf({1001, 1960, 51}, 10.0 * std::numbers::pi / 180);
  EXPECT_FALSE(station->TurnTo(hidden.circles, Aim::kPrism));
  simulator.Signal(SIGTERM);
  EXPECT_EQ(simulator.Wait(), 0) << simulator.Output();
}

TEST(TotalStationSim, SaysWhatIsWrongWithItsCommandLine) {
  const test::TempFolder folder;
  test::WriteText(folder / "prisms.csv", "prism,x_m,y_m,z_m\nleft,997,2060,high\n");
  const auto run = [&](std::vector<std::string> options) {
    options.insert(options.begin(),
                   {TBM_TOTAL_STATION_SIM, "--prisms", folder / "prisms.csv", "--port", "0"});
    test::Process simulator(options);
    EXPECT_EQ(simulator.Wait(), 2);
    // The last line may still be on its way through the pipe.
    const auto until = steady_clock::now() + 5s;
    while (simulator.LineCount() == 0 && steady_clock::now() < until) {
      std::this_thread::sleep_for(2ms);
    }
    return simulator.Output();
  };
  EXPECT_THAT(run({}), HasSubstr("prisms.csv:2: column z_m: 'high' is not a number"));
  test::WriteText(folder / "prisms.csv", "prism,x_m,y_m,z_m\nleft,997,2060,52\n");
  EXPECT_THAT(run({"--recognition-ms",
                   "5",
                   "--angle-sigma-arcsec",
                   "0",
                   "--slope-sigma-mm",
                   "0",
                   "--fault",
                   "slow:0.1"}),
              HasSubstr("--fault slow:0.1: wanted KIND:RATIO"));
  EXPECT_THAT(run({"--hide", "right"}),
              HasSubstr("--hide right: wanted one prism by name, such as left"));
  EXPECT_THAT(run({"--swap", "left"}), HasSubstr("--swap left: wanted"));
  EXPECT_THAT(run({"--station", "1,2"}), HasSubstr("--station 1,2: wanted X,Y,Z"));
  EXPECT_THAT(run({"--knock", "1,2,3"}), HasSubstr("--knock 1,2,3: wanted"));
}

}  // namespace
}  // namespace tbm
