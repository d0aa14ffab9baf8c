// Targets, models, connections and the emulator's own optics; see geocom_total_station_test.cc.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/total_station/geocom_codes.h"
#include "guidance/station/reduce.h"
#include "tests/devices/total_station/geocom_bench.h"

namespace tbm {
namespace {

using namespace std::chrono_literals;
using enum StationFailure;
using test::ExpectNear;
using test::kPillar;
using test::SightOf;
using testing::AnyOf;
using testing::Eq;

constexpr double kPi = std::numbers::pi;

class GeocomLife : public test::EmulatedGeocom {};

TEST_F(GeocomLife, SaysWhyThereIsNoPrism) {
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

TEST_F(GeocomLife, ASwappedPrismShowsInTheNumbersOnly) {
  ASSERT_TRUE(Connect());
  const auto wanted = SightOf(Prism(0));
  Fault(GeocomFaultKind::kWrongPrism, geocom::kMakePositioning);
  ASSERT_TRUE(station_->TurnTo(wanted.circles, Aim::kPrism));
  const auto observation = station_->Measure();
  ASSERT_TRUE(observation);
  EXPECT_EQ(observation->quality, ObservationQuality::kFull);
  ExpectNear(observation->circles, SightOf(Prism(2)).circles, 1e-12);
}

TEST_F(GeocomLife, ALockedPrismIsFollowedAndItsLossIsTold) {
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

TEST_F(GeocomLife, AnOldInstrumentIsMeasuredWithItsOwnCalls) {
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

// Taken, and the answer lost: nobody may go on believing in the constant of before.
TEST_F(GeocomLife, WhatADistanceHasInItIsNotToldWhileNobodyKnows) {
  ASSERT_TRUE(Connect());
  PointAt(0);
  ASSERT_TRUE(station_->SetPrismConstant(0.0));
  ASSERT_TRUE(station_->SetAtmosphere(0.0));
  emulator_->faults().Add({GeocomFaultKind::kLostReply, geocom::kSetPrismConstant}, 2);
  ASSERT_FALSE(station_->SetPrismConstant(0.0175));
  ASSERT_TRUE(station_->ReadPower()) << "three without an answer would close the line";
  emulator_->faults().Add({GeocomFaultKind::kLostReply, geocom::kSetAtmospherePpm}, 2);
  ASSERT_FALSE(station_->SetAtmosphere(12.0));
  auto observation = station_->Measure();
  ASSERT_TRUE(observation);
  EXPECT_FALSE(observation->prism_constant_m);
  EXPECT_FALSE(observation->ppm);
  ASSERT_TRUE(station_->SetPrismConstant(0.0175));
  ASSERT_TRUE(station_->SetAtmosphere(12.0));
  observation = station_->Measure();
  ASSERT_TRUE(observation);
  EXPECT_NEAR(observation->prism_constant_m.value(), 0.0175, 1e-9);
  EXPECT_NEAR(observation->ppm.value(), 12.0, 1e-9);
}

TEST_F(GeocomLife, WithoutALicenceItMeasuresAndDoesNotTurn) {
  GeocomEmulatorOptions options;
  options.is_licensed = false;
  Start(options);
  ASSERT_TRUE(Connect());
  EXPECT_EQ(station_->TurnTo({1.0, 1.5}, Aim::kDirection).error(), (StationFault{kNoLicence, 27}));
  PointAt(0);
  EXPECT_TRUE(station_->Measure()->slope_m);
}

TEST_F(GeocomLife, AgreesOnAChecksumWithWhateverIsThere) {
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
TEST_F(GeocomLife, ALostProbeDoesNotGiveTheChecksumUp) {
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

TEST_F(GeocomLife, WakesASleepingInstrument) {
  emulator_->FallAsleep();
  ASSERT_TRUE(Connect());
  EXPECT_TRUE(station_->Health().has_checksum);
  Start();
  Fault(GeocomFaultKind::kComCode, geocom::kNullProc, 0, 0ns, 3108);
  ASSERT_TRUE(Connect());
  EXPECT_EQ(emulator_->carried_out(geocom::kSwitchOn), 1);
}

TEST_F(GeocomLife, GoesThroughItsLife) {
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

TEST_F(GeocomLife, TriesAnAddressThatDoesNotAnswerWithGrowingPauses) {
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

TEST_F(GeocomLife, RestoresItsSettingsAfterAReconnection) {
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

TEST_F(GeocomLife, AnotherInstrumentOnTheBracketHasAnotherIdentity) {
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
TEST_F(GeocomLife, AnAnswerToTheConnectionBeforeIsStale) {
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

// Errors of the axes change sign with the face: what both faces say together is free of them.
TEST_F(GeocomLife, TheMeanOfBothFacesIsFreeOfTheAxisErrors) {
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

// The instrument's end and guidance/station share no code: together they must give the prism back.
TEST_F(GeocomLife, BothFacesReducedGiveThePrismInSite) {
  ASSERT_TRUE(Connect());
  emulator_->With([](EmulatedInstrument& instrument) {
    instrument.errors.collimation_rad = 4e-5;
    instrument.errors.index_rad = -5e-5;
    instrument.errors.refraction_k = 0.2;
    instrument.errors.earth_radius_m = 6.371e6;
    instrument.errors.air_ppm = 15.0;
    for (EmulatedPrism& prism : instrument.prisms) prism.constant_m = 0.0344;
    instrument.prisms.push_back(test::StandingPrism("far", 1040.0, 2350.0, 57.0));
    instrument.prisms.back().constant_m = 0.0344;
    return 0;
  });
  ASSERT_TRUE(station_->SetPrismConstant(0.0344));
  const auto raw = [](const PolarObservation& o) {
    return RawReading{o.circles.horizontal_rad, o.circles.zenith_rad, o.slope_m, o.face};
  };
  const Station station{kPillar, 0.25};
  SightModel model;
  model.refraction_k = 0.2;
  for (std::size_t prism = 0; prism < 5; ++prism) {
    PointAt(prism);
    const auto one = station_->Measure();
    ASSERT_TRUE(station_->ChangeFace(Aim::kPrism));
    const auto two = station_->Measure();
    ASSERT_TRUE(one && two);
    const auto mean = MeanOfFaces(raw(*one), raw(*two), {{}, 0.0, 15.0}, 1e-3);
    ASSERT_TRUE(mean);
    EXPECT_NEAR(mean->axis_errors.collimation_rad, 4e-5, 1e-9);
    EXPECT_NEAR(mean->axis_errors.index_rad, -5e-5, 1e-9);
    const auto p_in_site = PointSighted(station, mean->mean, model);
    ASSERT_TRUE(p_in_site);
    // Over 350 m uphill the length of a bent sight is 0.04 mm another than the reduction's.
    EXPECT_LT((*p_in_site - Prism(prism)).norm(), prism == 4 ? 5e-5 : 5e-6) << prism;
  }
}

TEST_F(GeocomLife, NoiseHasTheSpreadThatWasOrdered) {
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

TEST_F(GeocomLife, AirEarthAndADriftingPillarBendWhatIsRead) {
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
