// The driver against the emulated instrument, both in one thread and on a clock that moves only
// while somebody waits: what took half a minute is over at once, and repeats to the bit.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/total_station/geocom_codes.h"
#include "tests/devices/total_station/geocom_bench.h"

namespace tbm {
namespace {

using namespace std::chrono_literals;
using enum StationFailure;
using test::ExpectNear;
using test::SightOf;

constexpr double kPi = std::numbers::pi;

class Geocom : public test::EmulatedGeocom {};

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
  Fault(GeocomFaultKind::kReturnCode, geocom::kSetPrismConstant, 0, 0ns, 3);
  EXPECT_EQ(station_->SetPrismConstant(0.03).error(), (StationFault{kInstrument, 3}));
  emulator_->Change([](GeocomEmulatorOptions& options) { options.ignores_prism_constant = true; });
  EXPECT_EQ(station_->SetPrismConstant(0.03).error().why, kSettingNotTaken);
  PointAt(0);
  EXPECT_EQ(station_->Measure()->prism_constant_m, 0.0) << "what is applied is told";
  emulator_->Change([](GeocomEmulatorOptions& options) { options.ignores_prism_constant = false; });
  EXPECT_TRUE(station_->SetPrismConstant(0.03));
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

// The telescope is elsewhere at each reading, so any answer but the newest is a wrong one.
TEST_F(Geocom, NoFaultOfTheLineEverMakesAWrongValue) {
  for (const GeocomFaultKind kind : test::kLineFaults) {
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

// The whole cycle of a process, on a line where every seventh call goes wrong: whenever turning and
// measuring both say that all is well, the numbers are those of the prism that was meant.
TEST_F(Geocom, NoFaultOfTheLineGivesOnePrismTheNumbersOfAnother) {
  for (const GeocomFaultKind kind : test::kLineFaults) {
    Start();
    ASSERT_TRUE(Connect());
    const double ratio = kind == GeocomFaultKind::kCloses ? 0.05 : 0.15;
    emulator_->faults().AddLasting(GeocomFault{kind, -1, 0, 5s, 0}, ratio, 11);
    int good = 0;
    for (std::size_t i = 0; i < 120; ++i) {
      if (!station_->IsConnected() && !Connect()) continue;
      const auto truth = SightOf(Prism(i % 4));
      if (!station_->TurnTo(truth.circles, Aim::kPrism)) continue;
      const auto observation = station_->Measure();
      if (!observation || !observation->slope_m) continue;
      ++good;
      ExpectNear(observation->circles, truth.circles, 1e-12);
      ASSERT_NEAR(*observation->slope_m, truth.slope_m, 1e-9) << static_cast<int>(kind);
    }
    EXPECT_GT(good, 50) << static_cast<int>(kind);
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

}  // namespace
}  // namespace tbm
