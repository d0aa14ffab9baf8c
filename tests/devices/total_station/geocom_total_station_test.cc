// The driver against the emulated instrument, both in one thread and on a clock that moves only
// while somebody waits: what took half a minute is over at once, and repeats to the bit.
#include "devices/total_station/geocom_total_station.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/total_station/emulator_link.h"
#include "devices/total_station/geocom_codes.h"
#include "tests/devices/total_station/emulated_station.h"
#include "tests/support/fake_clock.h"

namespace tbm {
namespace {

using namespace std::chrono_literals;
using enum StationFailure;
using test::FakeClock;
using test::kPillar;
using test::SightOf;
using testing::AnyOf;
using testing::Eq;

constexpr double kPi = std::numbers::pi;

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

class Geocom : public testing::Test {
 protected:
  void Start(GeocomEmulatorOptions options = {}, TotalStationConfig config = {}) {
    config_ = config;
    emulator_.emplace(options, test::FaultlessInstrument(), clock_);
    auto link = std::make_unique<EmulatorLink>(*emulator_, clock_, sleeper_);
    link_ = link.get();
    station_.emplace(config, std::move(link), 32760, clock_, sleeper_);
  }
  void SetUp() override { Start(); }

  Result<StationIdentity, StationFault> Connect(Duration patience = 1min) {
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
  void Fault(GeocomFaultKind kind, int rpc = -1, int skip = 0, Duration delay = 0ns, int code = 0) {
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

void ExpectNear(const CircleReading& got, const CircleReading& wanted, double within_rad) {
  EXPECT_NEAR(std::remainder(got.horizontal_rad - wanted.horizontal_rad, 2 * kPi), 0, within_rad);
  EXPECT_NEAR(got.zenith_rad, wanted.zenith_rad, within_rad);
}

// --- Measuring --------------------------------------------------------------------------------

TEST_F(Geocom, MeasuresThePrismItHasFound) {
  ASSERT_TRUE(Connect());
  for (std::size_t prism = 0; prism < 4; ++prism) {
    const auto truth = SightOf(Prism(prism));
    CircleReading roughly = truth.circles;
    roughly.horizontal_rad += 0.004;
    roughly.zenith_rad -= 0.003;
    ASSERT_TRUE(station_->TurnTo(roughly, Aim::kPrism));
    const auto observation = station_->Measure();
    ASSERT_TRUE(observation) << FailureCode(observation.error().why);
    ExpectNear(observation->circles, truth.circles, 1e-12);
    EXPECT_NEAR(observation->slope_m.value(), truth.slope_m, 1e-9);
    EXPECT_EQ(observation->face, Face::kOne);
    EXPECT_EQ(observation->quality, ObservationQuality::kFull);
    EXPECT_EQ(observation->return_code, 0);
  }
}

TEST_F(Geocom, NeverHandsOutTheDistanceOfThePrismBefore) {
  ASSERT_TRUE(Connect());
  PointAt(0);
  ASSERT_TRUE(station_->Measure());
  PointAt(3);
  const auto second = station_->Measure();
  ASSERT_TRUE(second);
  EXPECT_NEAR(second->slope_m.value(), SightOf(Prism(3)).slope_m, 1e-9);
  Hide(3);
  const auto third = station_->Measure();
  ASSERT_TRUE(third);
  EXPECT_FALSE(third->slope_m) << "the beam meets nothing";
}

TEST_F(Geocom, ReadsTheOtherFaceAsTheCirclesShowIt) {
  ASSERT_TRUE(Connect());
  const auto truth = SightOf(Prism(1));
  PointAt(1);
  ASSERT_TRUE(station_->ChangeFace(Aim::kPrism));
  const auto observation = station_->Measure();
  ASSERT_TRUE(observation);
  EXPECT_EQ(observation->face, Face::kTwo);
  ExpectNear(observation->circles,
             {truth.circles.horizontal_rad + kPi, 2 * kPi - truth.circles.zenith_rad},
             1e-12);
  EXPECT_NEAR(observation->slope_m.value(), truth.slope_m, 1e-9);
}

TEST_F(Geocom, StampsTheMiddleBetweenCommandAndAnswer) {
  ASSERT_TRUE(Connect());
  PointAt(0);
  const Timestamp begun = clock_.Now();
  const auto observation = station_->Measure();
  const Timestamp ended = clock_.Now();
  ASSERT_TRUE(observation);
  // Clearing comes first and takes 5 ms; starting, measuring and answering take 910 ms.
  EXPECT_EQ(observation->sensed_at - observation->sensed_within, begun + 5ms);
  EXPECT_EQ(observation->sensed_at + observation->sensed_within, ended);
  EXPECT_EQ(ended - begun, 915ms);
}

TEST_F(Geocom, AnglesAloneComeAtOnceWithTheLeanOfTheBracket) {
  ASSERT_TRUE(Connect());
  PointAt(0);
  emulator_->With([](EmulatedInstrument& instrument) {
    instrument.pillar.lean_north_rad = 3e-4;
    instrument.pillar.lean_east_rad = -1e-4;
    return 0;
  });
  const auto observation = station_->MeasureAngles();
  ASSERT_TRUE(observation);
  EXPECT_FALSE(observation->slope_m);
  ExpectNear(observation->circles, SightOf(Prism(0)).circles, 1e-12);
  // The prism is nearly north: the lean along the sight is nearly the one to the north.
  const double bearing_rad = SightOf(Prism(0), 0.0).circles.horizontal_rad;
  const double north = std::cos(bearing_rad);
  const double east = std::sin(bearing_rad);
  EXPECT_NEAR(observation->tilt_length_rad.value(), 3e-4 * north - 1e-4 * east, 1e-12);
  EXPECT_NEAR(observation->tilt_cross_rad.value(), -3e-4 * east - 1e-4 * north, 1e-12);
  const auto compensator = station_->ReadCompensator();
  ASSERT_TRUE(compensator);
  EXPECT_EQ(compensator->length_rad, observation->tilt_length_rad);
}

TEST_F(Geocom, WarningsComeWithTheirValuesAndAFlag) {
  ASSERT_TRUE(Connect());
  PointAt(0);
  const double slope_m = SightOf(Prism(0)).slope_m;
  const auto with_code = [&](int code) {
    Fault(GeocomFaultKind::kReturnCode, geocom::kGetFullMeasure, 0, 0ns, code);
    return station_->Measure();
  };
  for (const int code : {1283, 1284}) {
    const auto observation = with_code(code);
    ASSERT_TRUE(observation) << code;
    EXPECT_EQ(observation->return_code, code);
    EXPECT_NEAR(observation->slope_m.value(), slope_m, 1e-9);
  }
  EXPECT_EQ(with_code(1283)->quality, ObservationQuality::kNotFullyCorrected);
  EXPECT_EQ(with_code(1284)->quality, ObservationQuality::kNoAccuracy);
  // The field of the distance is there, with a plausible number in it, and means nothing.
  for (const int code : {1285, 1288, 1289}) {
    const auto observation = with_code(code);
    ASSERT_TRUE(observation) << code;
    EXPECT_FALSE(observation->slope_m) << code;
    ExpectNear(observation->circles, SightOf(Prism(0)).circles, 1e-12);
  }
}

TEST_F(Geocom, ABracketThatLeansTooFarIsToldAndNotCorrected) {
  ASSERT_TRUE(Connect());
  PointAt(0);
  emulator_->With([](EmulatedInstrument& instrument) {
    instrument.pillar.lean_north_rad = 0.002;
    return 0;
  });
  const auto observation = station_->Measure();
  ASSERT_TRUE(observation);
  EXPECT_EQ(observation->quality, ObservationQuality::kNotFullyCorrected);
  EXPECT_NEAR(observation->circles.zenith_rad - SightOf(Prism(0)).circles.zenith_rad, -0.002, 1e-5);
}

TEST_F(Geocom, PrismConstantAndAtmosphereAreSetReadBackAndApplied) {
  ASSERT_TRUE(Connect());
  PointAt(0);
  const double slope_m = SightOf(Prism(0)).slope_m;
  ASSERT_TRUE(station_->SetPrismConstant(0.0175));
  ASSERT_TRUE(station_->SetAtmosphere(-12.5));
  const auto observation = station_->Measure();
  ASSERT_TRUE(observation);
  EXPECT_EQ(observation->prism_constant_m, 0.0175);
  EXPECT_EQ(observation->ppm, -12.5);
  EXPECT_NEAR(observation->slope_m.value(), (slope_m + 0.0175) * (1 - 12.5e-6), 1e-9);
  // The same constant again is not sent again.
  const int sent = emulator_->carried_out(geocom::kSetPrismConstant);
  ASSERT_TRUE(station_->SetPrismConstant(0.0175));
  EXPECT_EQ(emulator_->carried_out(geocom::kSetPrismConstant), sent);
}

TEST_F(Geocom, ASettingThatIsNotTakenIsAFailure) {
  ASSERT_TRUE(Connect());
  // Answered with "done", and not done.
  Fault(GeocomFaultKind::kReturnCode, geocom::kSetPrismConstant, 0, 0ns, 3);
  EXPECT_EQ(station_->SetPrismConstant(0.03).error(), (StationFault{kInstrument, 3}));
  ASSERT_TRUE(station_->SetPrismConstant(0.03));
}

TEST_F(Geocom, ImplausibleValuesAreRefused) {
  config_.longest_distance_m = 50.0;
  Start({}, config_);
  ASSERT_TRUE(Connect());
  PointAt(0);
  const auto observation = station_->Measure();
  ASSERT_FALSE(observation);
  EXPECT_EQ(observation.error().why, kImplausible);
  EXPECT_EQ(station_->Health().last_fault->why, kImplausible);
}

TEST_F(Geocom, TellsIdentityPowerAndTemperature) {
  const auto identity = Connect();
  ASSERT_TRUE(identity);
  EXPECT_EQ(*identity, (StationIdentity{"TS16 A", 3'512'345, "5.60.1"}));
  EXPECT_EQ(station_->ReadPower()->capacity_percent, 87);
  EXPECT_FALSE(station_->ReadPower()->is_external);
  EXPECT_EQ(*station_->ReadTemperatureCelsius(), 21.0);
  EXPECT_EQ(station_->Health().power->capacity_percent, 87);
  EXPECT_EQ(station_->Health().identity, *identity);
}

// --- What goes wrong on the line --------------------------------------------------------------

constexpr GeocomFaultKind kLineFaults[] = {GeocomFaultKind::kLate,
                                           GeocomFaultKind::kLostReply,
                                           GeocomFaultKind::kLostRequest,
                                           GeocomFaultKind::kMissingValues,
                                           GeocomFaultKind::kGarbageBefore,
                                           GeocomFaultKind::kBitError,
                                           GeocomFaultKind::kLostFirst,
                                           GeocomFaultKind::kSplit,
                                           GeocomFaultKind::kGlued,
                                           GeocomFaultKind::kTwice,
                                           GeocomFaultKind::kCloses};

// The telescope is elsewhere at each reading, so any answer but the newest is a wrong one.
TEST_F(Geocom, NoFaultOfTheLineEverMakesAWrongValue) {
  for (const GeocomFaultKind kind : kLineFaults) {
    Start();
    ASSERT_TRUE(Connect());
    // Setting up a connection takes ten calls: it must have a chance to succeed.
    const double ratio = kind == GeocomFaultKind::kCloses ? 0.07 : 0.3;
    emulator_->faults().AddLasting(GeocomFault{kind, -1, 0, 5s, 0}, ratio, 7);
    int good = 0;
    for (int i = 0; i < 300; ++i) {
      if (!station_->IsConnected() && !Connect()) continue;
      const CircleReading truth{0.02 * i, 1.0 + 0.002 * i};
      emulator_->With([&](EmulatedInstrument& instrument) {
        instrument.PointTo(truth);
        return 0;
      });
      const auto observation = station_->MeasureAngles();
      if (!observation) continue;
      ++good;
      ASSERT_NEAR(observation->circles.horizontal_rad, truth.horizontal_rad, 1e-12) << i;
      ASSERT_NEAR(observation->circles.zenith_rad, truth.zenith_rad, 1e-12) << i;
    }
    EXPECT_GT(emulator_->faults().taken(), 25) << static_cast<int>(kind);
    EXPECT_GT(good, 180) << static_cast<int>(kind);
  }
}

TEST_F(Geocom, LateAnswersAreThrownAwayAndCounted) {
  ASSERT_TRUE(Connect());
  PointAt(0);
  // So late that it comes 2 ms after the question was asked again, and 3 ms before its answer.
  Fault(GeocomFaultKind::kLate, geocom::kGetAngleAndTilt, 0, config_.answer_timeout - 3ms);
  const auto observation = station_->MeasureAngles();
  ASSERT_TRUE(observation);
  const StationCounters counters = station_->Health().counters;
  EXPECT_EQ(counters.timeouts, 1u);
  EXPECT_EQ(counters.stale, 1u);
}

// Why the checksum is asked for: digits that change are numbers again.
TEST_F(Geocom, WithoutAChecksumAFlippedBitCanPassAsAValue) {
  config_.checksum = ChecksumUse::kOff;
  Start({}, config_);
  ASSERT_TRUE(Connect());
  EXPECT_FALSE(station_->Health().has_checksum);
  PointAt(0);
  emulator_->faults().AddLasting(
      GeocomFault{GeocomFaultKind::kBitError, geocom::kGetAngleAndTilt, 0, 0ns, 0}, 0.5, 3);
  int wrong = 0;
  for (int i = 0; i < 200; ++i) {
    if (!station_->IsConnected()) {
      ASSERT_TRUE(Connect());
    }
    const auto observation = station_->MeasureAngles();
    if (!observation) continue;
    const double truth = SightOf(Prism(0)).circles.horizontal_rad;
    if (std::abs(observation->circles.horizontal_rad - truth) > 1e-12) ++wrong;
  }
  EXPECT_GT(wrong, 0);
}

TEST_F(Geocom, EveryRefusalKeepsItsCode) {
  ASSERT_TRUE(Connect());
  const CircleReading target = SightOf(Prism(0)).circles;
  const std::pair<int, StationFailure> codes[] = {{2, kBadParameter},
                                                  {8, kAborted},
                                                  {13, kBusy},
                                                  {16, kLowPower},
                                                  {22, kTilted},
                                                  {27, kNoLicence},
                                                  {1800, kMotor},
                                                  {8710, kNoTarget},
                                                  {8711, kSeveralTargets},
                                                  {8712, kBadEnvironment},
                                                  {8716, kInaccurate}};
  for (const auto& [code, why] : codes) {
    Fault(GeocomFaultKind::kReturnCode, geocom::kMakePositioning, 0, 0ns, code);
    const auto turned = station_->TurnTo(target, Aim::kPrism);
    ASSERT_FALSE(turned) << code;
    EXPECT_EQ(turned.error(), (StationFault{why, code}));
    EXPECT_EQ(station_->Health().last_fault, turned.error());
  }
  EXPECT_EQ(emulator_->carried_out(geocom::kMakePositioning), 0) << "and nothing was told twice";
}

TEST_F(Geocom, ABusyInstrumentIsAskedAgainForAWhile) {
  ASSERT_TRUE(Connect());
  for (int i = 0; i < 3; ++i) Fault(GeocomFaultKind::kComCode, -1, 0, 0ns, 3107);
  EXPECT_TRUE(station_->ReadPower());
  for (int i = 0; i < 1000; ++i) Fault(GeocomFaultKind::kComCode, -1, 0, 0ns, 3107);
  const auto begun = clock_.Steady();
  const auto power = station_->ReadPower();
  ASSERT_FALSE(power);
  EXPECT_EQ(power.error(), (StationFault{kBusy, 3107}));
  EXPECT_LE(clock_.Steady() - begun, config_.answer_timeout + 1s);
}

// --- Motions are told once --------------------------------------------------------------------

TEST_F(Geocom, AMotionIsNeverToldTwiceWhateverHappensToItsAnswer) {
  struct Case {
    GeocomFaultKind kind;
    bool is_carried_out;
  };
  for (const Case& one : {Case{GeocomFaultKind::kLostReply, true},
                          Case{GeocomFaultKind::kLate, true},
                          Case{GeocomFaultKind::kBitError, true},
                          Case{GeocomFaultKind::kLostFirst, true},
                          Case{GeocomFaultKind::kLostRequest, false}}) {
    for (const Aim aim : {Aim::kDirection, Aim::kPrism}) {
      Start();
      ASSERT_TRUE(Connect());
      const CircleReading target = SightOf(Prism(0)).circles;
      Fault(one.kind, geocom::kMakePositioning, 0, config_.motion_timeout + 1s);
      const auto turned = station_->TurnTo(target, aim);
      EXPECT_EQ(emulator_->carried_out(geocom::kMakePositioning), one.is_carried_out ? 1 : 0);
      if (aim == Aim::kDirection && one.is_carried_out) {
        EXPECT_TRUE(turned) << "it stands where it was told to go";
      } else {
        ASSERT_FALSE(turned);
        EXPECT_EQ(turned.error().why, one.is_carried_out ? kOutcomeUnknown : kNotExecuted);
      }
      // What was found out allows for a new command.
      EXPECT_TRUE(station_->TurnTo(target, aim));
      EXPECT_TRUE(station_->Measure()->slope_m);
    }
  }
}

TEST_F(Geocom, AMotionThatOutlastsItsLimitIsWaitedForNotRepeated) {
  config_.motion_timeout = 5s;
  GeocomEmulatorOptions options;
  options.turn_rad_per_s = 0.25;  // some eight seconds for half a circle less a bit
  Start(options, config_);
  ASSERT_TRUE(Connect());
  const auto begun = clock_.Steady();
  EXPECT_TRUE(station_->TurnTo({2.0, 1.5}, Aim::kDirection));
  EXPECT_GT(clock_.Steady() - begun, 8s);
  EXPECT_EQ(emulator_->carried_out(geocom::kMakePositioning), 1);
  ExpectNear(Telescope(), {2.0, 1.5}, 1e-12);
}

TEST_F(Geocom, ALinkLostDuringAMotionIsSettledBeforeTheNextCommand) {
  ASSERT_TRUE(Connect());
  Fault(GeocomFaultKind::kCloses, geocom::kMakePositioning);
  const auto turned = station_->TurnTo({2.0, 1.5}, Aim::kDirection);
  ASSERT_FALSE(turned);
  EXPECT_EQ(turned.error().why, kLinkLost);
  ASSERT_TRUE(Connect());
  const int looked = emulator_->carried_out(geocom::kGetAngles);
  EXPECT_TRUE(station_->Measure());
  EXPECT_GE(emulator_->carried_out(geocom::kGetAngles), looked + 2) << "stands still?";
  const int after = emulator_->carried_out(geocom::kGetAngles);
  EXPECT_TRUE(station_->Measure());
  EXPECT_EQ(emulator_->carried_out(geocom::kGetAngles), after) << "is asked once only";
}

TEST_F(Geocom, AChangeOfFaceWhoseAnswerIsLostIsSeenInTheCircles) {
  ASSERT_TRUE(Connect());
  PointAt(0);
  Fault(GeocomFaultKind::kLostReply, geocom::kChangeFace);
  EXPECT_TRUE(station_->ChangeFace(Aim::kDirection));
  EXPECT_EQ(FaceOf(Telescope()), Face::kTwo);
  Fault(GeocomFaultKind::kLostRequest, geocom::kChangeFace);
  EXPECT_EQ(station_->ChangeFace(Aim::kDirection).error().why, kNotExecuted);
  EXPECT_EQ(FaceOf(Telescope()), Face::kTwo);
}

TEST_F(Geocom, TheStartOfADistanceIsNeverToldTwice) {
  for (const auto kind : {GeocomFaultKind::kLostReply, GeocomFaultKind::kLostRequest}) {
    Start();
    ASSERT_TRUE(Connect());
    PointAt(0);
    ASSERT_TRUE(station_->Measure());
    const int before = emulator_->carried_out(geocom::kDoMeasure);
    PointAt(3);
    Fault(kind, geocom::kDoMeasure, 1);  // the first clears
    const auto lost = station_->Measure();
    ASSERT_FALSE(lost);
    EXPECT_EQ(lost.error().why, kTimeout);
    EXPECT_EQ(emulator_->carried_out(geocom::kDoMeasure) - before,
              kind == GeocomFaultKind::kLostReply ? 2 : 1);
    const auto next = station_->Measure();
    ASSERT_TRUE(next);
    EXPECT_NEAR(next->slope_m.value(), SightOf(Prism(3)).slope_m, 1e-9);
  }
}

// Whether the old distance is forgotten must be known before a new one is started.
TEST_F(Geocom, NothingIsMeasuredUntilTheOldDistanceIsCleared) {
  ASSERT_TRUE(Connect());
  PointAt(0);
  const int before = emulator_->carried_out(geocom::kDoMeasure);
  Fault(GeocomFaultKind::kLostRequest, geocom::kDoMeasure);
  Fault(GeocomFaultKind::kLostRequest, geocom::kDoMeasure);
  EXPECT_EQ(station_->Measure().error().why, kTimeout);
  EXPECT_EQ(emulator_->carried_out(geocom::kDoMeasure), before);
  EXPECT_TRUE(station_->Measure());
}

TEST_F(Geocom, AnAnsweredDistanceMayBeAskedForAgain) {
  ASSERT_TRUE(Connect());
  PointAt(0);
  Fault(GeocomFaultKind::kBitError, geocom::kGetFullMeasure);
  const auto observation = station_->Measure();
  ASSERT_TRUE(observation);
  EXPECT_NEAR(observation->slope_m.value(), SightOf(Prism(0)).slope_m, 1e-9);
  EXPECT_EQ(station_->Health().counters.garbled, 1u);
}

TEST_F(Geocom, AnAbortStopsTheTelescopeOnItsWay) {
  ASSERT_TRUE(Connect());
  emulator_->With([](EmulatedInstrument& instrument) {
    instrument.PointTo({0.0, 1.5});
    return 0;
  });
  sleeper_.act_at = clock_.Steady() + 1s;
  sleeper_.act = [this] { station_->RequestAbort(); };
  const auto turned = station_->TurnTo({3.0, 1.5}, Aim::kDirection);
  ASSERT_FALSE(turned);
  EXPECT_EQ(turned.error().why, kAborted);
  EXPECT_GT(Telescope().horizontal_rad, 0.5);
  EXPECT_LT(Telescope().horizontal_rad, 1.2);
  station_->RequestAbort();  // nothing under way
  EXPECT_TRUE(station_->TurnTo({3.0, 1.5}, Aim::kDirection));
}

// --- Targets ----------------------------------------------------------------------------------

TEST_F(Geocom, SaysWhyThereIsNoPrism) {
  ASSERT_TRUE(Connect());
  const CircleReading target = SightOf(Prism(0)).circles;
  Hide(0);
  EXPECT_EQ(station_->TurnTo(target, Aim::kPrism).error(), (StationFault{kNoTarget, 8710}));
  // Wide enough for the two that remain ahead; the nearer one is taken.
  ASSERT_TRUE(station_->Search({0.4, 0.4}));
  ExpectNear(Telescope(), SightOf(Prism(2)).circles, 1e-12);
  emulator_->With([](EmulatedInstrument& instrument) {
    instrument.prisms.push_back(test::StandingPrism("vest", 1001.3, 2058.0, 49.0));
    return 0;
  });
  EXPECT_EQ(station_->FineAdjust({0.02, 0.02}).error(), (StationFault{kSeveralTargets, 8711}));
}

TEST_F(Geocom, ASwappedPrismShowsInTheNumbersOnly) {
  ASSERT_TRUE(Connect());
  const auto wanted = SightOf(Prism(0));
  Fault(GeocomFaultKind::kWrongPrism, geocom::kMakePositioning);
  ASSERT_TRUE(station_->TurnTo(wanted.circles, Aim::kPrism));
  const auto observation = station_->Measure();
  ASSERT_TRUE(observation);
  EXPECT_EQ(observation->quality, ObservationQuality::kFull);
  ExpectNear(observation->circles, SightOf(Prism(2)).circles, 1e-12);
}

TEST_F(Geocom, ALockedPrismIsFollowedAndItsLossIsTold) {
  ASSERT_TRUE(Connect());
  const Timestamp start = clock_.Now();
  bool is_hidden = false;
  emulator_->With([&](EmulatedInstrument& instrument) {
    instrument.prisms[0].p_in_site = [&is_hidden,
                                      start](Timestamp at) -> std::optional<Eigen::Vector3d> {
      if (is_hidden) return std::nullopt;
      return Eigen::Vector3d(997.0, 2060.0 + 0.01 * SecondsBetween(start, at), 52.0);
    };
    return 0;
  });
  EXPECT_EQ(*station_->ReadLock(), LockState::kNone);
  PointAt(0);
  ASSERT_TRUE(station_->LockIn());
  EXPECT_EQ(*station_->ReadLock(), LockState::kLocked);
  clock_.Advance(100s);
  const auto observation = station_->Measure();
  ASSERT_TRUE(observation);
  const auto truth = SightOf({997.0, 2060.0 + 0.01 * SecondsBetween(start, clock_.Now()), 52.0});
  ExpectNear(observation->circles, truth.circles, 1e-6);
  EXPECT_NEAR(observation->slope_m.value(), truth.slope_m, 1e-3);
  is_hidden = true;
  EXPECT_EQ(*station_->ReadLock(), LockState::kPredicting);
  EXPECT_FALSE(station_->Measure()->slope_m);
  ASSERT_TRUE(station_->ReleaseLock());
  EXPECT_EQ(*station_->ReadLock(), LockState::kNone);
  // The answer of a lock may be lost as well.
  is_hidden = false;
  PointAt(0);
  Fault(GeocomFaultKind::kLostReply, geocom::kLockIn);
  EXPECT_TRUE(station_->LockIn());
  ASSERT_TRUE(station_->ReleaseLock());
  Fault(GeocomFaultKind::kLostRequest, geocom::kLockIn);
  EXPECT_EQ(station_->LockIn().error().why, kNotExecuted);
}

// --- Models -----------------------------------------------------------------------------------

TEST_F(Geocom, AnOldInstrumentIsMeasuredWithItsOwnCalls) {
  GeocomEmulatorOptions options;
  options.is_old = true;
  Start(options);
  ASSERT_TRUE(Connect());
  ASSERT_TRUE(station_->TurnTo(SightOf(Prism(0)).circles, Aim::kPrism));
  for (int i = 0; i < 2; ++i) {
    const auto observation = station_->Measure();
    ASSERT_TRUE(observation);
    EXPECT_NEAR(observation->slope_m.value(), SightOf(Prism(0)).slope_m, 1e-9);
    EXPECT_FALSE(observation->tilt_cross_rad);
    EXPECT_FALSE(observation->ppm) << "it does not tell";
  }
  EXPECT_EQ(emulator_->carried_out(geocom::kGetSimpleMeasure), 2);
  EXPECT_EQ(station_->SetAtmosphere(5.0).error().why, kNotSupported);
  PointAt(0);
  EXPECT_TRUE(station_->LockIn());
}

TEST_F(Geocom, WithoutALicenceItMeasuresAndDoesNotTurn) {
  GeocomEmulatorOptions options;
  options.is_licensed = false;
  Start(options);
  ASSERT_TRUE(Connect());
  EXPECT_EQ(station_->TurnTo({1.0, 1.5}, Aim::kDirection).error(), (StationFault{kNoLicence, 27}));
  PointAt(0);
  EXPECT_TRUE(station_->Measure()->slope_m);
}

TEST_F(Geocom, AgreesOnAChecksumWithWhateverIsThere) {
  struct Case {
    EmulatedChecksum can;
    bool has;
  };
  for (const Case& one : {Case{EmulatedChecksum::kKnown, true},
                          Case{EmulatedChecksum::kRefused, false},
                          Case{EmulatedChecksum::kPlain, false},
                          Case{EmulatedChecksum::kMute, false}}) {
    GeocomEmulatorOptions options;
    options.checksum = one.can;
    Start(options);
    ASSERT_TRUE(Connect()) << static_cast<int>(one.can);
    EXPECT_EQ(station_->Health().has_checksum, one.has) << static_cast<int>(one.can);
    EXPECT_TRUE(station_->MeasureAngles());
    if (one.has) continue;
    TotalStationConfig strict;
    strict.checksum = ChecksumUse::kOn;
    Start(options, strict);
    EXPECT_EQ(Connect().error().why, kNotSupported);
  }
}

// One lost question must not cost the checksum for the rest of the day.
TEST_F(Geocom, ALostProbeDoesNotGiveTheChecksumUp) {
  for (const auto kind : {GeocomFaultKind::kLostRequest,
                          GeocomFaultKind::kLostReply,
                          GeocomFaultKind::kBitError,
                          GeocomFaultKind::kLate}) {
    Start();
    Fault(kind, geocom::kNullProc, 0, config_.answer_timeout + 1ms);
    ASSERT_TRUE(Connect());
    EXPECT_TRUE(station_->Health().has_checksum) << static_cast<int>(kind);
  }
}

TEST_F(Geocom, WakesASleepingInstrument) {
  emulator_->FallAsleep();
  ASSERT_TRUE(Connect());
  EXPECT_TRUE(station_->Health().has_checksum);
  Start();
  Fault(GeocomFaultKind::kComCode, geocom::kNullProc, 0, 0ns, 3108);
  ASSERT_TRUE(Connect());
  EXPECT_EQ(emulator_->carried_out(geocom::kSwitchOn), 1);
}

// --- The life of the connection ---------------------------------------------------------------

TEST_F(Geocom, GoesThroughItsLife) {
  const auto state = [this] { return station_->Health().state; };
  EXPECT_EQ(state(), StationState::kClosed);
  EXPECT_EQ(station_->Measure().error().why, kNotConnected);
  EXPECT_EQ(station_->TurnTo({1, 1}, Aim::kDirection).error().why, kNotConnected);
  ASSERT_TRUE(Connect());
  EXPECT_EQ(state(), StationState::kReady);

  emulator_->faults().AddLasting(GeocomFault{GeocomFaultKind::kLostReply});
  EXPECT_FALSE(station_->ReadPower());
  EXPECT_EQ(state(), StationState::kSilent);
  emulator_->faults().Clear();
  EXPECT_TRUE(station_->ReadPower());
  EXPECT_EQ(state(), StationState::kReady);

  emulator_->faults().AddLasting(GeocomFault{GeocomFaultKind::kLostReply});
  EXPECT_EQ(station_->ReadPower().error().why, kTimeout);
  EXPECT_EQ(station_->ReadPower().error().why, kTimeout);
  EXPECT_EQ(state(), StationState::kClosed) << "after the third";
  EXPECT_FALSE(station_->IsConnected());
  EXPECT_EQ(station_->Health().counters.timeouts, 1 + 3u + 1u);
  emulator_->faults().Clear();
  ASSERT_TRUE(Connect());
  EXPECT_EQ(state(), StationState::kReady);
  EXPECT_EQ(station_->Health().counters.reconnects, 1u);

  Fault(GeocomFaultKind::kCloses);
  EXPECT_EQ(station_->ReadPower().error().why, kLinkLost);
  EXPECT_EQ(state(), StationState::kClosed);
  ASSERT_TRUE(Connect());
  station_->Close();
  EXPECT_EQ(state(), StationState::kClosed);
}

TEST_F(Geocom, TriesAnAddressThatDoesNotAnswerWithGrowingPauses) {
  link_->FailOpening(LinkFailure::kMissing);
  const auto begun = clock_.Steady();
  int calls = 0;
  while (clock_.Steady() - begun < 60s) {
    const auto connected = Connect(1s);
    ASSERT_FALSE(connected);
    EXPECT_THAT(connected.error().why, AnyOf(Eq(kUnreachable), Eq(kNotConnected)));
    ASSERT_LT(++calls, 200) << "spins";
  }
  // 0, 0.5, 1.5, 3.5, 7.5, 15.5, then every 8 s.
  EXPECT_NEAR(link_->openings(), 11, 1);
  EXPECT_EQ(station_->Health().last_fault->why, kUnreachable);
  link_->FailOpening(std::nullopt);
  EXPECT_TRUE(Connect());
  link_->FailOpening(LinkFailure::kDenied);
  station_->Close();
  EXPECT_EQ(Connect().error().why, kRefused);
}

TEST_F(Geocom, RestoresItsSettingsAfterAReconnection) {
  ASSERT_TRUE(Connect());
  ASSERT_TRUE(station_->SetPrismConstant(0.0113));
  ASSERT_TRUE(station_->SetAtmosphere(7.5));
  Fault(GeocomFaultKind::kCloses);
  ASSERT_FALSE(station_->ReadPower());
  emulator_->With([](EmulatedInstrument& instrument) {
    instrument.prism_constant_m = instrument.ppm = 0.0;  // somebody has reset it
    instrument.compensator_is_on = false;
    return 0;
  });
  ASSERT_TRUE(Connect());
  PointAt(0);
  const auto observation = station_->Measure();
  ASSERT_TRUE(observation);
  EXPECT_EQ(observation->prism_constant_m, 0.0113);
  EXPECT_EQ(observation->ppm, 7.5);
  EXPECT_EQ(observation->quality, ObservationQuality::kFull);
}

TEST_F(Geocom, AnotherInstrumentOnTheBracketHasAnotherIdentity) {
  const auto before = Connect();
  ASSERT_TRUE(before);
  Fault(GeocomFaultKind::kCloses);
  ASSERT_FALSE(station_->ReadPower());
  emulator_->Change([](GeocomEmulatorOptions& options) { options.serial_number = 77; });
  const auto after = Connect();
  ASSERT_TRUE(after);
  EXPECT_NE(*before, *after);
}

// An answer that was under way when the connection broke comes on the new one.
TEST_F(Geocom, AnAnswerToTheConnectionBeforeIsStale) {
  ASSERT_TRUE(Connect());
  emulator_->Change([](GeocomEmulatorOptions& options) { options.turn_rad_per_s = 0.1; });
  config_.motion_timeout = 30s;
  sleeper_.act_at = clock_.Steady() + 1s;
  sleeper_.act = [this] { link_->Close(); };
  const auto turned = station_->TurnTo({1.5, 1.5}, Aim::kDirection);
  ASSERT_FALSE(turned);
  EXPECT_EQ(turned.error().why, kLinkLost);
  const auto too_early = Connect();
  ASSERT_FALSE(too_early);
  EXPECT_EQ(too_early.error().why, kBusy) << "it still turns";
  const auto until = clock_.Steady() + 1min;
  while (!Connect(1s) && clock_.Steady() < until) continue;
  EXPECT_TRUE(station_->TurnTo({1.5, 1.5}, Aim::kDirection));
  EXPECT_GT(station_->Health().counters.stale + station_->Health().counters.noise, 0u);
  ExpectNear(Telescope(), {1.5, 1.5}, 1e-12);
}

// --- The emulator's optics --------------------------------------------------------------------

// Errors of the axes change sign with the face: what both faces say together is free of them.
TEST_F(Geocom, TheMeanOfBothFacesIsFreeOfTheAxisErrors) {
  ASSERT_TRUE(Connect());
  emulator_->With([](EmulatedInstrument& instrument) {
    instrument.errors.collimation_rad = 4e-5;
    instrument.errors.trunnion_rad = 3e-5;
    instrument.errors.index_rad = -5e-5;
    return 0;
  });
  const auto truth = SightOf(Prism(0)).circles;
  PointAt(0);
  const auto one = station_->MeasureAngles();
  ASSERT_TRUE(station_->ChangeFace(Aim::kPrism));
  const auto two = station_->MeasureAngles();
  ASSERT_TRUE(one && two);
  const double c = 4e-5 / std::sin(truth.zenith_rad) + 3e-5 / std::tan(truth.zenith_rad);
  EXPECT_NEAR(one->circles.horizontal_rad - truth.horizontal_rad, c, 1e-12);
  EXPECT_NEAR(one->circles.zenith_rad - truth.zenith_rad, -5e-5, 1e-12);
  const double half = (one->circles.horizontal_rad + two->circles.horizontal_rad - kPi) / 2;
  EXPECT_NEAR(std::remainder(half - truth.horizontal_rad, kPi), 0.0, 1e-12);
  EXPECT_NEAR(
      (one->circles.zenith_rad + 2 * kPi - two->circles.zenith_rad) / 2, truth.zenith_rad, 1e-12);
}

TEST_F(Geocom, NoiseHasTheSpreadThatWasOrdered) {
  ASSERT_TRUE(Connect());
  emulator_->With([](EmulatedInstrument& instrument) {
    instrument.errors.angle_sigma_rad = 5e-6;
    instrument.errors.slope_sigma_m = 0.0008;
    instrument.errors.slope_sigma_ppm = 10.0;
    return 0;
  });
  const auto truth = SightOf(Prism(0));
  PointAt(0);
  constexpr int kCount = 2000;
  double zenith = 0, circle = 0, slope = 0;
  for (int i = 0; i < kCount; ++i) {
    const auto o = station_->Measure();
    ASSERT_TRUE(o);
    zenith += std::pow(o->circles.zenith_rad - truth.circles.zenith_rad, 2);
    circle += std::pow((o->circles.horizontal_rad - truth.circles.horizontal_rad) *
                           std::sin(truth.circles.zenith_rad),
                       2);
    slope += std::pow(o->slope_m.value() - truth.slope_m, 2);
    EXPECT_EQ(o->angle_sigma_rad, 5e-6);
  }
  // 5 % is three sigma of a spread from 2000 draws.
  EXPECT_NEAR(std::sqrt(zenith / kCount), 5e-6, 0.05 * 5e-6);
  EXPECT_NEAR(std::sqrt(circle / kCount), 5e-6, 0.05 * 5e-6);
  const double sigma_m = std::hypot(0.0008, 10e-6 * truth.slope_m);
  EXPECT_NEAR(std::sqrt(slope / kCount), sigma_m, 0.05 * sigma_m);
}

TEST_F(Geocom, AirEarthAndADriftingPillarBendWhatIsRead) {
  ASSERT_TRUE(Connect());
  const Timestamp start = clock_.Now();
  emulator_->With([&](EmulatedInstrument& instrument) {
    instrument.prisms[0] = test::StandingPrism("far", 1000.0, 2500.0, 50.0);
    instrument.errors.earth_radius_m = 6.371e6;
    instrument.errors.refraction_k = 0.13;
    instrument.errors.air_ppm = 20.0;
    instrument.errors.lateral_bend_rad_per_m = 2e-8;
    return 0;
  });
  PointAt(0);
  const auto level = station_->Measure();
  ASSERT_TRUE(level);
  // Over 500 m a level sight stands (1 - k) d / 2R = 34 urad above where the prism seems to be.
  EXPECT_NEAR(level->circles.zenith_rad - kPi / 2, 0.87 * 500.0 / (2 * 6.371e6), 1e-9);
  EXPECT_NEAR(level->slope_m.value(), 500.0 * (1 - 20e-6), 1e-6);
  EXPECT_NEAR(std::remainder(level->circles.horizontal_rad + 0.25, 2 * kPi), 1e-5, 1e-10);

  emulator_->With([&](EmulatedInstrument& instrument) {
    instrument.errors = test::FaultlessInstrument().errors;
    instrument.pillar.since = start;
    instrument.pillar.drift_m_per_s = {1e-5, 0.0, 0.0};
    instrument.pillar.drift_rad_per_s = 1e-7;
    return 0;
  });
  clock_.Advance(start + 1000s - clock_.Now());
  PointAt(0);
  const auto drifted = station_->MeasureAngles();
  ASSERT_TRUE(drifted);
  // 10 mm to the east and 100 urad clockwise: both turn what is read to the left.
  EXPECT_NEAR(
      std::remainder(drifted->circles.horizontal_rad + 0.25, 2 * kPi), -0.01 / 500 - 1e-4, 1e-8);
}

// --- Configuration ----------------------------------------------------------------------------

TEST(TotalStationConfig, EveryFaultNamesItsKey) {
  EXPECT_TRUE(CheckTotalStationConfig({}).empty());
  TotalStationConfig config;
  config.address = "station.local";
  config.tcp_port = 0;
  config.answer_timeout = 0ns;
  config.measure_timeout = 10ms;
  config.motion_timeout = 10ms;
  config.longest_back_off = 20ms;
  config.arrived_within_rad = std::nan("");
  config.longest_distance_m = 0.0;
  const auto faults = CheckTotalStationConfig(config);
  for (const char* key : {"address: \"station.local\"",
                          "tcp_port: 0: wanted 1 .. 65535",
                          "answer_timeout_ms",
                          "measure_timeout_ms",
                          "motion_timeout_ms",
                          "longest_back_off_ms: is shorter",
                          "arrived_within_rad",
                          "longest_distance_m"}) {
    EXPECT_THAT(faults, testing::Contains(testing::HasSubstr(key))) << key;
  }
  TotalStationConfig serial;
  serial.driver = TotalStationDriver::kGeocomSerial;
  serial.port.baud = 1234;
  EXPECT_THAT(CheckTotalStationConfig(serial),
              testing::ElementsAre(testing::HasSubstr("total_station.port: empty"),
                                   testing::HasSubstr("total_station.baud: 1234")));
  EXPECT_EQ(TotalStationDriverFromWord("geocom_tcp"), TotalStationDriver::kGeocomTcp);
  EXPECT_EQ(WordOf(TotalStationDriver::kGeocomSerial), "geocom_serial");
  EXPECT_FALSE(TotalStationDriverFromWord("geocom"));
}

}  // namespace
}  // namespace tbm
