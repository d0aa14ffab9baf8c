#include "guidance/app/chain_check.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "guidance/app/chain_command.h"
#include "guidance/app/chain_input.h"
#include "guidance/app/export_command.h"
#include "guidance/app/journal_topic.h"
#include "guidance/journal/mcap_writer.h"
#include "tests/support/random.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using test::Random;
using test::ReadText;
using test::TempFolder;
using test::WriteText;
using ::testing::HasSubstr;

constexpr Timestamp kBegin{1'790'000'000'000'000'000};

Timestamp At(double seconds) { return {kBegin.ns + std::llround(seconds * 1e9)}; }

// Where the point truly is: seconds since the begin -> site.
using Way = std::function<Eigen::Vector3d(double)>;

const Eigen::Vector3d kForward(0.6, 0.8, 0.0);

// Strokes of 60 mm/min for a while with rests between them, along a straight drive.
Eigen::Vector3d Strokes(double t_s) {
  constexpr double kPush_s = 400.0;
  constexpr double kRest_s = 300.0;
  const double cycles = std::floor(t_s / (kPush_s + kRest_s));
  const double in_cycle_s = t_s - cycles * (kPush_s + kRest_s);
  const double driven_m = 0.001 * (cycles * kPush_s + std::min(in_cycle_s, kPush_s));
  return Eigen::Vector3d(1000.0, 5000.0, 100.0) + driven_m * kForward;
}

Eigen::Vector3d Steady(double t_s) {
  return Eigen::Vector3d(1000.0, 5000.0, 100.0) + 0.001 * t_s * kForward;
}

Eigen::Vector3d Standing(double) { return {1000.0, 5000.0, 100.0}; }

struct Law {
  double bias_sigma_m = 0.003;    // each coordinate, common to the whole record; is published
  double noise_sigma_m = 0.0002;  // from sample to sample
  double shot_sigma_m = 0.0005;
};

GuidedTracks Published(const Way& way, double length_s, const Law& law, Random& random) {
  const Eigen::Vector3d bias = random.Normal3(law.bias_sigma_m);
  GuidedTrack track;
  for (double t = 0.0; t <= length_s; t += 0.2) {
    GuidedSample sample;
    sample.at = At(t);
    sample.is_valid = true;
    sample.p_in_site_m = way(t) + bias + random.Normal3(law.noise_sigma_m);
    sample.covariance_m2 = law.bias_sigma_m * law.bias_sigma_m * Eigen::Matrix3d::Identity();
    track.push_back(sample);
  }
  return {{"cutter_face", track}};
}

std::vector<MachineShot> Shots(
    const Way& way, double from_s, double to_s, double ahead_s, const Law& law, Random& random) {
  std::vector<MachineShot> shots;
  for (double t = from_s; t < to_s; t += 17.3) {
    shots.push_back({At(t + ahead_s), "cutter_face", way(t) + random.Normal3(law.shot_sigma_m)});
  }
  return shots;
}

TEST(ChainCheck, APlaceIsInterpolatedNeverExtrapolatedNeverAcrossWhatIsUnknown) {
  GuidedTrack track;
  for (const auto& [t, x, is_valid] : {std::tuple(0.0, 1.0, true),
                                       {0.2, 2.0, true},
                                       {0.4, 0.0, false},
                                       {0.6, 4.0, true},
                                       {0.8, 5.0, true},
                                       {2.0, 6.0, true}}) {
    GuidedSample sample;
    sample.at = At(t);
    sample.is_valid = is_valid;
    sample.p_in_site_m.x() = x;
    sample.covariance_m2 = x * Eigen::Matrix3d::Identity();
    track.push_back(sample);
  }
  const Duration gap = std::chrono::milliseconds(500);
  EXPECT_NEAR(PlaceAt(track, At(0.05), gap)->p_in_site_m.x(), 1.25, 1e-9);
  EXPECT_EQ(PlaceAt(track, At(0.05), gap)->covariance_m2(0, 0), 2.0) << "the larger one";
  EXPECT_EQ(PlaceAt(track, At(0.2), gap)->p_in_site_m.x(), 2.0);
  EXPECT_EQ(PlaceAt(track, At(2.0), gap)->p_in_site_m.x(), 6.0);
  for (const double t : {0.3, 0.4, 0.5}) {
    ASSERT_FALSE(PlaceAt(track, At(t), gap)) << t;
    EXPECT_EQ(PlaceAt(track, At(t), gap).error(), NoGuidedPlace::kInvalid) << t;
  }
  for (const double t : {-0.001, 1.0, 2.001}) {
    ASSERT_FALSE(PlaceAt(track, At(t), gap)) << t;
    EXPECT_EQ(PlaceAt(track, At(t), gap).error(), NoGuidedPlace::kNoPartner) << t;
  }
  EXPECT_TRUE(PlaceAt(track, At(1.0), std::chrono::seconds(2)));
  EXPECT_FALSE(PlaceAt({}, At(0.0), gap));
}

// Truth is put in, and the error must be what the sigma says: neither larger nor smaller.
TEST(ChainCheck, TheClocksErrorIsFoundToWithinItsSigma) {
  const Law law;
  double sum_squares = 0.0;
  double largest_sigma_s = 0.0;
  constexpr int kCases = 40;
  for (int i = 0; i < kCases; ++i) {
    Random random("TheClocksErrorIsFoundToWithinItsSigma", static_cast<std::uint64_t>(i));
    const double ahead_s = random.Uniform(-40.0, 40.0);
    const GuidedTracks tracks = Published(Strokes, 2200.0, law, random);
    const auto shots = Shots(Strokes, 100.0, 2000.0, ahead_s, law, random);
    ChainOptions options;
    options.log_sigma_m = law.shot_sigma_m;
    options.clock_range_s = 120.0;
    const auto clock = EstimateClock(tracks, shots, options);
    ASSERT_TRUE(clock) << i;
    sum_squares += std::pow((clock->ahead_s - ahead_s) / clock->sigma_s, 2);
    largest_sigma_s = std::max(largest_sigma_s, clock->sigma_s);
  }
  EXPECT_LT(largest_sigma_s, 1.0) << "rests between strokes tell the clock from the bias";
  EXPECT_GT(sum_squares / kCases, 0.5);
  EXPECT_LT(sum_squares / kCases, 1.9);
}

TEST(ChainCheck, AtOneSteadySpeedTheClockIsKnownNoBetterThanTheChainage) {
  const Law law;
  Random random("AtOneSteadySpeedTheClockIsKnownNoBetterThanTheChainage");
  const GuidedTracks tracks = Published(Steady, 1000.0, law, random);
  const auto clock =
      EstimateClock(tracks, Shots(Steady, 100.0, 900.0, 0.0, law, random), ChainOptions{});
  ASSERT_TRUE(clock);
  EXPECT_NEAR(clock->sigma_s, law.bias_sigma_m / 0.001, 0.1);
  EXPECT_FALSE(clock->is_significant);
}

TEST(ChainCheck, AnHourOfTimeZoneIsFound) {
  const Law law;
  Random random("AnHourOfTimeZoneIsFound");
  const GuidedTracks tracks = Published(Strokes, 6000.0, law, random);
  const auto clock =
      EstimateClock(tracks, Shots(Strokes, 500.0, 2000.0, 3600.0, law, random), ChainOptions{});
  ASSERT_TRUE(clock);
  EXPECT_NEAR(clock->ahead_s, 3600.0, 3.0);
  EXPECT_TRUE(clock->is_significant);
}

TEST(ChainCheck, AMachineThatStandsTellsNothingOfTheClock) {
  const Law law;
  Random random("AMachineThatStandsTellsNothingOfTheClock");
  const GuidedTracks tracks = Published(Standing, 600.0, law, random);
  const auto clock =
      EstimateClock(tracks, Shots(Standing, 100.0, 500.0, 5.0, law, random), ChainOptions{});
  ASSERT_FALSE(clock);
  EXPECT_EQ(clock.error(), NoClockEstimate::kMovedTooLittle);
  const auto few =
      EstimateClock(tracks, Shots(Standing, 100.0, 130.0, 5.0, law, random), ChainOptions{});
  ASSERT_FALSE(few);
  EXPECT_EQ(few.error(), NoClockEstimate::kTooFewShots);
}

// A metre lost on the way is no clock's doing.
TEST(ChainCheck, AnotherFaultIsNotTakenForTheClocks) {
  const Law law;
  Random random("AnotherFaultIsNotTakenForTheClocks");
  GuidedTracks tracks = Published(Strokes, 2200.0, law, random);
  for (GuidedSample& sample : tracks.at("cutter_face")) {
    if (sample.at > At(1000.0)) sample.p_in_site_m -= 1.0 * kForward;
  }
  const auto clock =
      EstimateClock(tracks, Shots(Strokes, 100.0, 2000.0, 0.0, law, random), ChainOptions{});
  ASSERT_FALSE(clock);
  EXPECT_EQ(clock.error(), NoClockEstimate::kOtherFault);
}

// Errors drawn from a slanted covariance, anew for each shot.
TEST(ChainCheck, NinetyFiveOfAHundredLieInsideTheEllipsoidWhenTheSigmasAreTrue) {
  Random random("NinetyFiveOfAHundredLieInsideTheEllipsoid");
  Eigen::Matrix3d root;
  root << 0.004, 0.0, 0.0, 0.002, 0.001, 0.0, -0.001, 0.0005, 0.0008;
  GuidedTrack track;
  std::vector<MachineShot> shots;
  constexpr double kShotSigma_m = 0.0007;
  for (int i = 0; i < 4000; ++i) {
    const Eigen::Vector3d truth = Steady(i);
    track.push_back({At(i), true, truth + root * random.Normal3(), root * root.transpose()});
    shots.push_back({At(i), "cutter_face", truth + random.Normal3(kShotSigma_m)});
  }
  ChainOptions options;
  options.log_sigma_m = kShotSigma_m;
  const ChainPairs pairs = PairShots({{"cutter_face", track}}, shots, 0.0, 0.0, options);
  ASSERT_EQ(pairs.observations.size(), 4000u);
  int inside = 0;
  double sum = 0.0;
  for (const ChainObservation& one : pairs.observations) {
    inside += one.IsInside95() ? 1 : 0;
    sum += one.standardised_2;
  }
  EXPECT_NEAR(inside / 4000.0, 0.95, 0.011);
  EXPECT_NEAR(sum / 4000.0, 3.0, 0.12);
}

// A record of the messages themselves: a machine on a slope, tail and cutter face 10 m apart.
class ChainFiles : public ::testing::Test {
 protected:
  static constexpr double kSlope = 0.02;

  static Eigen::Vector3d FaceAt(double t_s) { return Strokes(t_s) + Eigen::Vector3d(0, 0, 0.5); }

  static dds::GuidedPoint Point(const char* name, const Eigen::Vector3d& p, double chainage_m) {
    dds::GuidedPoint point;
    point.name = name;
    point.shield = "front";
    point.validity = dds::Validity::kValid;
    point.position_in_site_m = p;
    point.position_sigma_m = 0.005;
    point.chainage_m = chainage_m;
    point.official_chainage_m = chainage_m;
    point.official_section = 0;
    point.chainage_sigma_m = 0.004;
    point.deviation_right_m = 0.010;
    point.deviation_up_m = -0.020;
    point.deviation_right_sigma_m = 0.002;
    point.deviation_up_sigma_m = 0.001;
    point.right_up_correlation = 0.0;
    return point;
  }

  static dds::Guidance Message(double t_s) {
    dds::Guidance message;
    message.machine_id = "TBM-1";
    message.valid_at = At(t_s);
    message.published_at = At(t_s);
    message.sample_number = static_cast<std::uint64_t>(t_s * 5.0) + 1;
    message.validity = dds::Validity::kValid;
    message.steer_by = "cutter_face";
    const Eigen::Vector3d face = FaceAt(t_s);
    const double chainage_m = (face - FaceAt(0.0)).norm() + 100.0;
    message.points.push_back(Point("cutter_face", face, chainage_m));
    message.points.push_back(Point(
        "tail", face - 10.0 * kForward - Eigen::Vector3d(0, 0, 10.0 * kSlope), chainage_m - 10.0));
    if (t_s > 900.0 && t_s < 950.0) {
      message.points[0] = dds::GuidedPoint();
      message.points[0].name = "cutter_face";
      message.points[0].shield = "front";
      message.points[0].reason = "no_relative_pose";
    }
    return message;
  }

  static void WriteJournal(const std::string& path) {
    McapWriter writer("test");
    const JournalChannel facts = JournalChannelOf(dds::kGuidanceTopic);
    Bytes file = writer.Begin();
    const auto channel = writer.AddChannel(facts.topic, facts.message_encoding, facts.schema);
    const auto append = [&](const Bytes& bytes) {
      file.insert(file.end(), bytes.begin(), bytes.end());
    };
    std::vector<std::byte> encoded;
    std::uint32_t sequence = 0;
    for (double t = 0.0; t <= 1800.0; t += 0.2) {
      ASSERT_EQ(dds::EncodeCdr(Message(t), &encoded), dds::BoundaryFault::kNone);
      writer.AddMessage(channel, ++sequence, At(t), At(t), encoded);
      if (writer.gathered_bytes() > 60'000) append(writer.TakeChunk());
    }
    append(writer.End());
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(file.data()),
               static_cast<std::streamsize>(file.size()));
  }

  // Shots 1 mm to the east of where the face is, by a clock that is ahead.
  std::string WriteShots(double ahead_s) const {
    std::string text = "stamp_ns,point,x_mm,y_mm,z_mm\n";
    for (double t = 20.1; t < 1700.0; t += 20.0) {
      const Eigen::Vector3d p = 1e3 * (FaceAt(t) + Eigen::Vector3d(0.001, 0.0, 0.0));
      text += fmt::format(
          "{},cutter_face,{:.4f},{:.4f},{:.4f}\n", At(t + ahead_s).ns, p.x(), p.y(), p.z());
    }
    text += fmt::format("{},window,1,2,3\n", kBegin.ns);
    const std::string path = folder_ / fmt::format("shots_{}.csv", ahead_s);
    WriteText(path, text);
    return path;
  }

  void SetUp() override { WriteJournal(folder_ / "journal.mcap"); }

  struct Outcome {
    ExitCode code;
    std::string out;
    std::string err;
  };
  static Outcome Check(const CheckRequest& request) {
    std::ostringstream out;
    std::ostringstream err;
    const ExitCode code = RunChainCheck(request, {out, err});
    return {code, out.str(), err.str()};
  }
  CheckRequest Request(double ahead_s) const {
    CheckRequest request;
    request.poses = folder_ / "journal.mcap";
    request.log = WriteShots(ahead_s);
    request.clock_range_s = 60.0;
    return request;
  }

  TempFolder folder_;
};

TEST_F(ChainFiles, AJournalAndItsExportSayTheSame) {
  ExportRequest exported;
  exported.journals = {folder_ / "journal.mcap"};
  exported.out = folder_ / "csv";
  std::ostringstream out;
  std::ostringstream err;
  ASSERT_EQ(RunExport(exported, {out, err}), ExitCode::kDone) << err.str();
  const std::string csv = folder_ / "csv/guidance.csv";
  EXPECT_TRUE(IsGuidanceRecord(csv));
  EXPECT_TRUE(IsGuidanceRecord(folder_ / "journal.mcap"));
  const auto a = ReadGuidanceRecord(folder_ / "journal.mcap");
  const auto b = ReadGuidanceRecord(csv);
  ASSERT_TRUE(a);
  ASSERT_TRUE(b) << b.error();
  EXPECT_EQ(a->machine_id, "TBM-1");
  EXPECT_EQ(b->machine_id, "TBM-1");
  ASSERT_EQ(a->tracks.size(), 2u);
  ASSERT_EQ(b->tracks.size(), 2u);
  for (const auto& [name, track] : a->tracks) {
    const GuidedTrack& other = b->tracks.at(name);
    ASSERT_EQ(track.size(), other.size());
    for (std::size_t i = 0; i < track.size(); i += 7) {
      EXPECT_EQ(track[i].at, other[i].at);
      EXPECT_EQ(track[i].is_valid, other[i].is_valid) << i;
      EXPECT_LT((track[i].p_in_site_m - other[i].p_in_site_m).norm(), 1e-9);
      EXPECT_LT((track[i].covariance_m2 - other[i].covariance_m2).norm(), 1e-12);
    }
  }
}

TEST_F(ChainFiles, TheCovarianceLiesAlongTheDrive) {
  const auto record = ReadGuidanceRecord(folder_ / "journal.mcap");
  ASSERT_TRUE(record);
  const Eigen::Matrix3d& covariance = record->tracks.at("cutter_face").front().covariance_m2;
  const Eigen::Vector3d right(kForward.y(), -kForward.x(), 0.0);
  const Eigen::Vector3d over(-kSlope * kForward.x(), -kSlope * kForward.y(), 1.0);
  EXPECT_NEAR(kForward.dot(covariance * kForward), 16e-6, 1e-8);
  EXPECT_NEAR(right.dot(covariance * right), 4e-6, 1e-8);
  EXPECT_NEAR(over.dot(covariance * over), 1e-6, 1e-9);
}

TEST_F(ChainFiles, SaysHowTheShotsDifferAndLeavesOutWhatNobodyKnew) {
  CheckRequest request = Request(0.0);
  request.report = folder_ / "report";
  const Outcome outcome = Check(request);
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("1 shots at other points are passed over"));
  const auto json = nlohmann::json::parse(ReadText(request.report + "/check.json"));
  EXPECT_EQ(json["observations"], 81);
  EXPECT_EQ(json["without_pose"], 3);
  EXPECT_EQ(json["without_partner"], 0);
  EXPECT_NEAR(json["dx"]["mean_mm"].get<double>(), -1.0, 0.02);
  EXPECT_NEAR(json["dy"]["mean_mm"].get<double>(), 0.0, 0.02);
  EXPECT_NEAR(json["distance"]["rms_mm"].get<double>(), 1.0, 0.02);
  EXPECT_EQ(json["inside_95"], 81);
  EXPECT_EQ(json["clock"]["can_be_told"], true);
  EXPECT_EQ(json["clock"]["applied"], false);
  // 1 mm east is 0.6 mm along and 0.8 mm to the right.
  EXPECT_NEAR(json["mean_standardised_squared"].get<double>(), 0.36 / 16 + 0.64 / 4, 0.01);
  const std::string csv = ReadText(request.report + "/check.csv");
  EXPECT_TRUE(csv.starts_with(
      "stamp_ns,pairing,pose_x_mm,pose_y_mm,pose_z_mm,log_x_mm,log_y_mm,log_z_mm,dx_mm,dy_mm,dz_mm,"
      "distance_mm,point,sigma_mm,distance_over_sigma,standardised_squared,inside_95\n"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 82);
  EXPECT_TRUE(ReadText(request.report + "/check.png").starts_with("\x89PNG"));
}

TEST_F(ChainFiles, AClockThatIsOffIsTakenOutAndThatIsSaid) {
  CheckRequest request = Request(12.0);
  const Outcome taken_out = Check(request);
  ASSERT_EQ(taken_out.code, ExitCode::kDone) << taken_out.err;
  EXPECT_THAT(taken_out.out, HasSubstr("the log's clock is 1"));
  EXPECT_THAT(taken_out.out, HasSubstr("taken out, which took 1 degree of freedom"));
  request.report = folder_ / "report";
  ASSERT_EQ(Check(request).code, ExitCode::kDone);
  const auto json = nlohmann::json::parse(ReadText(request.report + "/check.json"));
  EXPECT_NEAR(json["clock"]["log_ahead_s"].get<double>(), 12.0, 0.2);
  EXPECT_NEAR(json["distance"]["rms_mm"].get<double>(), 1.0, 0.1);
  request.report = folder_ / "trusted";
  request.clock = "trust";
  const Outcome trusted = Check(request);
  EXPECT_THAT(trusted.out, HasSubstr("guidance's, sigma"));
  EXPECT_THAT(trusted.out, HasSubstr("; taken as it is"));
  const auto as_it_is = nlohmann::json::parse(ReadText(request.report + "/check.json"));
  EXPECT_GT(as_it_is["distance"]["max_mm"].get<double>(), 11.0);
  EXPECT_EQ(as_it_is["clock"]["applied"], false);
}

TEST_F(ChainFiles, GsiShotsTakeTheTimeThatIsGiven) {
  const Eigen::Vector3d p = FaceAt(500.0);
  const auto word = [](double metres) { return std::llround(metres * 1e5); };
  WriteText(folder_ / "shots.gsi",
            fmt::format("*110001+0000000000000007 81..58+{:016} 82..58+{:016} 83..58+{:016} \r\n",
                        word(p.x() + 0.002),
                        word(p.y()),
                        word(p.z())));
  CheckRequest request;
  request.poses = folder_ / "journal.mcap";
  request.log = folder_ / "shots.gsi";
  request.point = "cutter_face";
  request.log_point = "7";
  const Outcome without = Check(request);
  EXPECT_EQ(without.code, ExitCode::kBadInput);
  EXPECT_THAT(without.err, HasSubstr("shots.gsi:1: has no time; where the machine stood still"));
  request.at = std::to_string(At(500.0).ns);
  const Outcome outcome = Check(request);
  ASSERT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("-2.000"));
  EXPECT_THAT(outcome.out, HasSubstr("cannot be told: fewer than three shots"));
}

TEST_F(ChainFiles, BadInputIsSaidInOneSentence) {
  CheckRequest request = Request(0.0);
  request.point = "nose";
  EXPECT_THAT(Check(request).err, HasSubstr("has no point 'nose'; it has cutter_face, tail"));
  request.point = "tail";
  EXPECT_THAT(Check(request).err, HasSubstr("has no shot at 'tail'; it has 'cutter_face', "));
  request = Request(0.0);
  request.align_rigid = true;
  EXPECT_THAT(Check(request).err, HasSubstr("both in site"));
  request = Request(0.0);
  request.at = "noon";
  EXPECT_THAT(Check(request).err, HasSubstr("--at 'noon' is no time"));
  request = Request(1e7);
  EXPECT_THAT(Check(request).err, HasSubstr("do both clocks run on UTC?"));
  request.log = "/nowhere.csv";
  EXPECT_EQ(Check(request).code, ExitCode::kBadInput);
  request = Request(0.0);
  request.poses = folder_ / "empty.mcap";
  WriteText(request.poses, "");
  EXPECT_EQ(Check(request).code, ExitCode::kBadInput);

  const std::string head = "valid_at_utc_ns,machine_id,a_validity,a_position_in_site_east_m\n";
  EXPECT_THAT(ParseGuidanceCsv(head + "12,M,valid,x\n", "g.csv").error(), HasSubstr("g.csv:2"));
  EXPECT_THAT(ParseGuidanceCsv(head + "12,M,fine,1\n", "g.csv").error(),
              HasSubstr("'fine' must be valid, degraded or invalid"));
  EXPECT_THAT(ParseGuidanceCsv(head + "1,M,valid,1\n2,N,valid,1\n", "g.csv").error(),
              HasSubstr("holds the machines 'M' and 'N'"));
  EXPECT_THAT(ParseGuidanceCsv("valid_at_utc_ns\n12\n", "g.csv").error(),
              HasSubstr("not what tbm export writes"));
  EXPECT_FALSE(IsGuidanceRecord(Request(0.0).log));
}

TEST_F(ChainFiles, SurvivesCutAndFlippedFiles) {
  const std::string whole = ReadText(folder_ / "journal.mcap").substr(0, 200'000);
  const std::string path = folder_ / "torn.mcap";
  for (std::size_t size = 0; size < whole.size(); size += 19'997) {
    WriteText(path, whole.substr(0, size));
    const auto record = ReadGuidanceRecord(path);
    EXPECT_TRUE(record || !record.error().empty());
  }
  for (std::size_t at = 30; at < whole.size(); at += 9'973) {
    std::string flipped = whole;
    flipped[at] = static_cast<char>(flipped[at] ^ (1 << (at % 8)));
    WriteText(path, flipped);
    const auto record = ReadGuidanceRecord(path);
    EXPECT_TRUE(record || !record.error().empty());
  }
}

}  // namespace
}  // namespace tbm
