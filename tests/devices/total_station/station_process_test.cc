// The station's process with its driver against the emulated instrument, in one thread and on a
// clock of the test's own; see station_bench.h.

#include "devices/app/station_process.h"

#include <atomic>
#include <thread>

#include "devices/app/station_state_file.h"
#include "tests/devices/total_station/station_bench.h"

namespace tbm {
namespace {

using namespace std::chrono_literals;
using dds::AlarmPhase;
using dds::CommandOutcome;
using test::ReadText;
using test::WriteText;
using testing::HasSubstr;

class StationRuns : public test::StationBench {};

TEST_F(StationRuns, SetsUpMeasuresPublishesAndComesBackSuspect) {
  Start();
  ASSERT_TRUE(BecomesGood()) << sink_.AllEvents();
  Run(4min);
  EXPECT_GE(Good(), 20);
  EXPECT_LT(WorstGood_m(), 0.003) << "prism constant and air are what the config says";
  const dds::StationSetUp* in_use = sink_.SetUp("in_use");
  ASSERT_NE(in_use, nullptr);
  EXPECT_EQ(in_use->state, dds::SetUpState::kGood);
  EXPECT_EQ(in_use->set_up_number, 1u);
  EXPECT_EQ(in_use->references.size(), 4u);
  EXPECT_TRUE(in_use->references[0].used);
  EXPECT_LT(std::abs(in_use->references[0].across_m), 0.002);
  EXPECT_EQ(sink_.health.back().state, dds::DeviceState::kStreaming);
  // Once a second, also while nothing changes.
  EXPECT_GT(sink_.set_ups.size(), 60u);
  for (std::size_t i = 1; i < sink_.observations.size(); ++i) {
    EXPECT_EQ(sink_.observations[i].sample_number, i + 1) << "a gap would be a lost sample";
  }
  for (const char* code : {"station_moved",
                           "station_set_up_missing",
                           "station_set_up_suspect",
                           "reference_disagrees",
                           "station_silent",
                           "prism_not_found",
                           "wrong_prism",
                           "swapped_prism",
                           "station_tilted",
                           "low_power"}) {
    ASSERT_NE(sink_.Alarm(code), nullptr) << code;
    EXPECT_EQ(sink_.Alarm(code)->phase, AlarmPhase::kNormal) << code;
    EXPECT_FALSE(sink_.Alarm(code)->response.empty());
  }
  const Timestamp last_good = in_use->last_good_check_at;
  const std::size_t before = sink_.observations.size();
  StartProcess();
  Step();
  EXPECT_EQ(sink_.SetUp("in_use")->state, dds::SetUpState::kSuspect);
  EXPECT_EQ(sink_.SetUp("in_use")->reason.view(), "restarted");
  EXPECT_EQ(sink_.SetUp("in_use")->last_good_check_at, last_good);
  ASSERT_TRUE(BecomesGood()) << sink_.AllEvents();
  EXPECT_EQ(Good("", before), 0) << "first the references";
  EXPECT_EQ(sink_.SetUp("in_use")->set_up_number, 1u);
}

TEST_F(StationRuns, AnInstrumentThatKeepsItsOwnPrismConstantIsCorrected) {
  GeocomEmulatorOptions options;
  options.ignores_prism_constant = true;
  Start(options);
  ASSERT_TRUE(BecomesGood());
  Run(2min);
  EXPECT_GE(Good(), 10);
  EXPECT_LT(WorstGood_m(), 0.003);
}

TEST_F(StationRuns, AnOldInstrumentIsUsedOnlyWhenItIsKnownWhatItAdds) {
  GeocomEmulatorOptions options;
  options.is_old = true;
  Start(options);
  Run(3min);
  EXPECT_FALSE(IsGood()) << "its ppm are unknown";
  config_.distance.assumed_ppm = 0.0;
  Start(options);
  ASSERT_TRUE(BecomesGood()) << sink_.AllEvents();
  Run(2min);
  EXPECT_LT(WorstGood_m(), 0.003);
}

// One call in five goes wrong, whatever it is.
TEST_F(StationRuns, NoFaultOfTheLineMakesAWrongObservationGood) {
  using enum GeocomFaultKind;
  for (const GeocomFaultKind kind : {kLate,
                                     kLostReply,
                                     kLostRequest,
                                     kMissingValues,
                                     kGarbageBefore,
                                     kBitError,
                                     kLostFirst,
                                     kSplit,
                                     kGlued,
                                     kTwice,
                                     kCloses,
                                     kWrongPrism}) {
    std::filesystem::remove(config_.state_file);
    sink_ = {};
    Start();
    const double ratio = kind == kCloses ? 0.05 : 0.2;
    emulator_->faults().AddLasting({kind, -1, 0, 5s, 0}, ratio, 5);
    EXPECT_TRUE(BecomesGood(30min)) << static_cast<int>(kind) << sink_.AllEvents();
    Run(12min);
    EXPECT_GT(Good(), 5) << static_cast<int>(kind) << sink_.AllEvents();
    EXPECT_LT(WorstGood_m(), 0.005) << static_cast<int>(kind);
    EXPECT_GT(emulator_->faults().taken(), 20);
  }
}

TEST_F(StationRuns, AKnockIsAlarmedAcknowledgedAndMended) {
  instrument_.pillar.knocks.push_back({clock_.Now() + 5min, {0.004, 0.001, 0.0}, 5 * kArcsec});
  Start();
  const auto knocked_at = clock_.Steady() + 5min;
  ASSERT_TRUE(BecomesGood());
  ASSERT_TRUE(RunUntil([&] { return sink_.IsRaised("station_moved"); }, 20min));
  EXPECT_GT(clock_.Steady(), knocked_at);
  EXPECT_LT(clock_.Steady(), knocked_at + config_.keeper.check_period + 2min);
  EXPECT_EQ(sink_.SetUp("in_use")->state, dds::SetUpState::kSuspect);
  EXPECT_EQ(sink_.SetUp("in_use")->reason.view(), "station_moved");
  EXPECT_THAT(std::string(sink_.Alarm("station_moved")->cause.view()),
              HasSubstr("has moved or turned: E +"));
  EXPECT_TRUE(sink_.HasEvent("station_moved"));
  EXPECT_EQ(Ask("acknowledge", "nobody_knows"), CommandOutcome::kRefused);
  EXPECT_EQ(Ask("acknowledge", "station_moved"), CommandOutcome::kDone);
  EXPECT_EQ(sink_.Alarm("station_moved")->phase, AlarmPhase::kAcknowledged);
  EXPECT_EQ(sink_.Alarm("station_moved")->acknowledged_by.view(), "surveyor");
  EXPECT_EQ(Ask("check_references"), CommandOutcome::kFailed);
  const std::size_t before = sink_.observations.size();
  EXPECT_EQ(Ask("set_up"), CommandOutcome::kDone);
  Run(2min);
  EXPECT_EQ(sink_.Alarm("station_moved")->phase, AlarmPhase::kNormal);
  EXPECT_GT(Good("", before), 5);
  EXPECT_LT(WorstGood_m(before), 0.003);
}

TEST_F(StationRuns, AlarmsSayWhatIsWrong) {
  Start();
  ASSERT_TRUE(BecomesGood());
  hidden_ = "right";
  ASSERT_TRUE(RunUntil([&] { return sink_.IsRaised("prism_not_found"); }, 4min));
  EXPECT_THAT(std::string(sink_.Alarm("prism_not_found")->cause.view()),
              HasSubstr("right (no_target)"));
  hidden_.clear();
  ASSERT_TRUE(RunUntil([&] { return !sink_.IsRaised("prism_not_found"); }, 4min));
  emulator_->Change([](GeocomEmulatorOptions& options) { options.battery_percent = 9; });
  EXPECT_TRUE(RunUntil([&] { return sink_.IsRaised("low_power"); }, 4min));
  const std::size_t before = sink_.observations.size();
  emulator_->With([](EmulatedInstrument& instrument) {
    instrument.pillar.lean_east_rad = 0.003;
    return 0;
  });
  EXPECT_TRUE(RunUntil([&] { return sink_.IsRaised("station_tilted"); }, 4min));
  EXPECT_LE(Good("", before), 1);
  emulator_->With([](EmulatedInstrument& instrument) {
    instrument.pillar.lean_east_rad = 0.0;
    return 0;
  });
  EXPECT_TRUE(RunUntil([&] { return !sink_.IsRaised("station_tilted"); }, 4min));
}

TEST_F(StationRuns, AnAlarmIsShelvedForAWhile) {
  Start();
  ASSERT_TRUE(BecomesGood());
  EXPECT_EQ(Ask("shelve", "prism_not_found 5"), CommandOutcome::kRefused);
  EXPECT_THAT(std::string(Answer()->text.view()), HasSubstr("say why"));
  EXPECT_EQ(Ask("shelve", "station_silent 31", "radio"), CommandOutcome::kRefused);
  EXPECT_EQ(Ask("unshelve", "prism_not_found"), CommandOutcome::kRefused);
  EXPECT_EQ(Ask("shelve", "prism_not_found 10", "segment crane"), CommandOutcome::kDone);
  EXPECT_EQ(Ask("shelve", "low_power 480", "no spare"), CommandOutcome::kDone);
  const Timestamp until = sink_.Alarm("prism_not_found")->shelved_until;
  EXPECT_NEAR(SecondsBetween(clock_.Now(), until), 600.0, 60.0);
  EXPECT_EQ(sink_.Alarm("prism_not_found")->shelved_by.view(), "surveyor");
  EXPECT_EQ(sink_.Alarm("prism_not_found")->shelved_because.view(), "segment crane");
  hidden_ = "right";
  ASSERT_TRUE(RunUntil([&] { return sink_.IsRaised("prism_not_found"); }, 4min));
  EXPECT_EQ(sink_.Alarm("prism_not_found")->shelved_until, until);
  const auto is_over = [&] { return sink_.Alarm("prism_not_found")->shelved_until == dds::kNever; };
  ASSERT_TRUE(RunUntil(is_over, 11min));
  EXPECT_LT(SecondsBetween(until, clock_.Now()), 30.0);
  EXPECT_TRUE(sink_.IsRaised("prism_not_found"));
  EXPECT_TRUE(sink_.Alarm("prism_not_found")->shelved_by.empty());
  EXPECT_EQ(Ask("unshelve", "low_power"), CommandOutcome::kDone);
  EXPECT_EQ(sink_.Alarm("low_power")->shelved_until, dds::kNever);
  // A restart brings every alarm back.
  EXPECT_EQ(Ask("shelve", "low_power 480", "no spare"), CommandOutcome::kDone);
  StartProcess();
  Run(2s);
  EXPECT_EQ(sink_.Alarm("low_power")->shelved_until, dds::kNever);
}

TEST_F(StationRuns, ASilentInstrumentIsAlarmedAndCheckedWhenItIsBack) {
  Start();
  ASSERT_TRUE(BecomesGood());
  emulator_->faults().AddLasting({GeocomFaultKind::kLostRequest, -1, 0, 0s, 0});
  ASSERT_TRUE(RunUntil([&] { return sink_.IsRaised("station_silent"); }, 3min));
  Run(3min);
  EXPECT_NE(sink_.health.back().state, dds::DeviceState::kStreaming);
  emulator_->faults().Clear();
  ASSERT_TRUE(RunUntil([&] { return !sink_.IsRaised("station_silent"); }, 3min));
  ASSERT_TRUE(BecomesGood()) << sink_.AllEvents();
  const auto* in_use = sink_.SetUp("in_use");
  EXPECT_GT(in_use->last_good_check_at, in_use->set_up_at);
}

TEST_F(StationRuns, AnotherInstrumentOnTheBracketHasNoSetUp) {
  Start();
  ASSERT_TRUE(BecomesGood());
  StartProcess();
  emulator_->Change([](GeocomEmulatorOptions& options) { options.serial_number = 4; });
  station_->Close();
  ASSERT_TRUE(
      RunUntil([&] { return sink_.SetUp("in_use")->state == dds::SetUpState::kNone; }, 2min));
  EXPECT_EQ(sink_.SetUp("in_use")->reason.view(), "other_instrument");
  ASSERT_TRUE(BecomesGood()) << "it sets itself up anew";
  EXPECT_EQ(sink_.SetUp("in_use")->set_up_number, 2u);
}

TEST_F(StationRuns, CommandsAreRefusedWithTheReason) {
  Start();
  ASSERT_TRUE(BecomesGood());
  EXPECT_EQ(Ask("dance"), CommandOutcome::kRefused);
  EXPECT_EQ(Ask("take_over_move"), CommandOutcome::kRefused);
  EXPECT_EQ(Ask("give_up_move"), CommandOutcome::kRefused);
  EXPECT_EQ(Ask("undo_move"), CommandOutcome::kRefused);
  EXPECT_EQ(Ask("resume"), CommandOutcome::kRefused);
  EXPECT_EQ(Ask("acknowledge", "station_moved"), CommandOutcome::kRefused);
  for (const char* argument : {"1,2", "1,2,3,R9", "a,2,3,4", "1,2,3,400", "1e9,2,3,4", ",,,"}) {
    EXPECT_EQ(Ask("propose_move", argument), CommandOutcome::kRefused) << argument;
    EXPECT_THAT(std::string(Answer()->text.view()), HasSubstr("wanted E,N,U"));
  }
  dds::Command late;
  late.machine_id = "TBM-1";
  late.request_id = "late";
  late.addressee = "total_station";
  late.verb = "pause";
  late.expires_at = clock_.Now() - 1s;
  process_->Hear(late);
  late.addressee = "guidance";
  late.request_id = "not ours";
  process_->Hear(late);
  Run(2s);
  EXPECT_EQ(sink_.replies.back().request_id.view(), "late");
  EXPECT_EQ(sink_.replies.back().outcome, CommandOutcome::kRefused);
  // The same request twice is carried out once.
  const std::size_t replies = sink_.replies.size();
  process_->Hear(late);
  late.addressee = "total_station";
  late.request_id = "late";
  process_->Hear(late);
  Run(2s);
  EXPECT_EQ(sink_.replies.size(), replies);
}

// Its threads, on the real clock: one measures, one beats, others speak to it.
TEST_F(StationRuns, WorksBeatsAndListensAtOnce) {
  class Counting final : public StationSink {
   public:
    void Publish(const dds::StationObservation& m) override {
      good += m.status == dds::ObservationStatus::kGood && m.kind == dds::ObservedKind::kPrism;
    }
    void Publish(const dds::StationSetUp&) override {}
    void Publish(const dds::DeviceHealth&) override { ++beats; }
    void Publish(const dds::Event&) override { ++events; }
    void Publish(const dds::AlarmStatus&) override {}
    void Publish(const dds::CommandReply&) override { ++replies; }
    std::atomic<int> good = 0, beats = 0, events = 0, replies = 0;
  } sink;
  const SystemClock clock;
  SystemSleeper sleeper;
  GeocomEmulatorOptions options;
  options.think_time = options.distance_time = options.recognition_time = 1ms;
  options.turn_rad_per_s = 1e4;
  GeocomEmulator emulator(options, instrument_, clock);
  GeocomTotalStation station(config_.instrument,
                             std::make_unique<EmulatorLink>(emulator, clock, sleeper),
                             1,
                             clock,
                             sleeper);
  config_.keeper.cycle_period = 0s;
  StationProcess process(config_, machine_, station, clock, sleeper, sink);
  std::stop_source stop;
  std::atomic<int> alive = 0;
  std::jthread running([&] { process.Run(stop.get_token(), [&] { ++alive; }); });
  const auto until = clock.Steady() + 60s;
  for (int i = 0; clock.Steady() < until; ++i) {
    if (sink.good > 5 && sink.beats > 1 && sink.replies > 3 && alive > 1) break;
    dds::Command command;
    command.machine_id = "TBM-1";
    command.request_id = std::string_view(std::to_string(i));
    command.addressee = "total_station";
    command.verb = "acknowledge";
    command.argument = "low_power";
    command.expires_at = clock.Now() + 10s;
    process.Hear(command);
    process.Report({dds::AlarmKind::kSilent, true, "topic", "key", "text"});
    std::this_thread::sleep_for(20ms);
  }
  EXPECT_GT(sink.good, 5);
  EXPECT_GT(sink.replies, 3);
  EXPECT_GT(sink.beats, 1);
  EXPECT_GT(sink.events, 3);
  EXPECT_GT(alive, 1);
  stop.request_stop();
}

class StationMoves : public StationRuns {
 protected:
  void Prepare() {
    Start();
    ASSERT_TRUE(BecomesGood());
    ASSERT_EQ(Ask("pause"), CommandOutcome::kDone) << sink_.AllEvents();
    before_ = ReadText(config_.state_file);
    emulator_->With([](EmulatedInstrument& instrument) {
      instrument.pillar.p_in_site = {1000.5, 2009.0, 50.3};
      instrument.pillar.circle_zero_bearing_rad = 2.0;
      // Aimed at the first reference by hand.
      instrument.PointTo(instrument.IdealReading({997.0, 1960.02, 51.5}, Timestamp{}, Face::kOne));
      return 0;
    });
  }
  std::string before_;
};

TEST_F(StationMoves, IsATransactionThatCanBeUndone) {
  Prepare();
  ASSERT_EQ(Ask("propose_move", "1000.4, 2009.1, 50.2, R1"), CommandOutcome::kDone)
      << Answer()->text.view();
  const auto* proposed = sink_.SetUp("proposed");
  ASSERT_NE(proposed, nullptr);
  EXPECT_EQ(proposed->state, dds::SetUpState::kGood);
  EXPECT_EQ(proposed->closure_points, 3);
  EXPECT_LT(proposed->closure_worst_m, 0.003);
  EXPECT_NEAR(proposed->closure_tolerance_m, 0.005, 1e-12);
  EXPECT_EQ(sink_.SetUp("in_use")->set_up_number, 1u);
  EXPECT_EQ(sink_.SetUp("in_use")->reason.view(), "station_moving");
  // Killed here, the old one comes back, suspect.
  ASSERT_TRUE(LoadKeptStation(config_.state_file));
  EXPECT_EQ((*LoadKeptStation(config_.state_file))->in_use->number, 1u);

  ASSERT_EQ(Ask("take_over_move"), CommandOutcome::kDone);
  EXPECT_EQ((*LoadKeptStation(config_.state_file))->in_use->number, 2u);
  const std::size_t from = sink_.observations.size();
  Run(3min);
  EXPECT_EQ(sink_.SetUp("in_use")->set_up_number, 2u);
  EXPECT_EQ(sink_.SetUp("in_use")->state, dds::SetUpState::kGood);
  EXPECT_EQ(sink_.SetUp("previous")->set_up_number, 1u);
  EXPECT_EQ(sink_.SetUp("proposed")->state, dds::SetUpState::kNone);
  EXPECT_GT(Good("", from), 10);
  EXPECT_LT(WorstGood_m(from), 0.003);

  ASSERT_EQ(Ask("undo_move"), CommandOutcome::kDone);
  EXPECT_EQ((*LoadKeptStation(config_.state_file))->in_use->number, 1u);
  EXPECT_EQ(sink_.SetUp("in_use")->set_up_number, 1u);
  EXPECT_EQ(sink_.SetUp("in_use")->state, dds::SetUpState::kSuspect);
  ASSERT_EQ(Ask("undo_move"), CommandOutcome::kDone) << "and forth again";
  EXPECT_TRUE(BecomesGood()) << sink_.AllEvents();
  EXPECT_EQ(sink_.SetUp("in_use")->set_up_number, 2u);
}

TEST_F(StationMoves, DoesNotCloseWhenTheMachineWentOn) {
  Prepare();
  shield_.translation.y() += 0.012;
  ASSERT_EQ(Ask("propose_move", "1000.4,2009.1,50.2,114.6"), CommandOutcome::kDone);
  EXPECT_THAT(std::string(Answer()->text.view()), HasSubstr("too large, give the move up"));
  EXPECT_EQ(sink_.SetUp("proposed")->reason.view(), "closure_too_large");
  EXPECT_EQ(Ask("take_over_move"), CommandOutcome::kRefused);
  EXPECT_THAT(std::string(Answer()->text.view()), HasSubstr("allowed are 5.0 mm"));
  EXPECT_EQ(ReadText(config_.state_file), before_);
  EXPECT_EQ(Ask("give_up_move"), CommandOutcome::kDone);
}

TEST_F(StationMoves, IsNotTakenOverWhenItCannotBeKept) {
  Prepare();
  ASSERT_EQ(Ask("propose_move", "1000.4,2009.1,50.2,R1"), CommandOutcome::kDone);
  // A folder in the way of the file that is written first.
  std::filesystem::create_directories(config_.state_file + ".part/full");
  EXPECT_EQ(Ask("take_over_move"), CommandOutcome::kFailed);
  EXPECT_THAT(std::string(Answer()->text.view()), HasSubstr("nothing has changed"));
  EXPECT_EQ(sink_.SetUp("in_use")->set_up_number, 1u);
  EXPECT_EQ(ReadText(config_.state_file), before_);
  std::filesystem::remove_all(config_.state_file + ".part");
  EXPECT_EQ(Ask("take_over_move"), CommandOutcome::kDone) << "the proposal still stands";
}

// Whatever a power cut leaves: what was written beside the file does not count, the file itself is
// the old one or the new one, and a damaged one is refused and kept aside.
TEST_F(StationMoves, KilledAtAnyByteItIsTheOldOrTheNewOrAClearRefusal) {
  Prepare();
  ASSERT_EQ(Ask("propose_move", "1000.4,2009.1,50.2,R1"), CommandOutcome::kDone);
  ASSERT_EQ(Ask("take_over_move"), CommandOutcome::kDone);
  const std::string after = ReadText(config_.state_file);
  ASSERT_NE(after, before_);
  EXPECT_EQ(ParseKeptStation(after, "f")->in_use->number, 2u);
  for (std::size_t size = 0; size < after.size(); ++size) {
    if (size % 97 == 0) {
      WriteText(config_.state_file, before_);
      WriteText(config_.state_file + ".part", after.substr(0, size));
      const auto kept = LoadKeptStation(config_.state_file);
      ASSERT_TRUE(kept && *kept);
      ASSERT_EQ((*kept)->in_use->number, 1u);
    }
    const auto cut = ParseKeptStation(after.substr(0, size), "station.state");
    ASSERT_FALSE(cut) << size;
    EXPECT_THAT(cut.error(), HasSubstr("station.state:0: cut short or changed"));
  }
  WriteText(config_.state_file, after.substr(0, after.size() / 2));
  StartProcess();
  EXPECT_TRUE(sink_.HasEvent("state_damaged")) << sink_.AllEvents();
  EXPECT_EQ(process_->keeper().health(), SetUpHealth::kNone);
  EXPECT_TRUE(std::filesystem::exists(config_.state_file + ".damaged"));
}

}  // namespace
}  // namespace tbm
