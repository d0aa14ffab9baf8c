// tbm record: the program itself, and a machine that talks to it.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "guidance/app/exit_code.h"
#include "guidance/app/journal_files.h"
#include "guidance/journal/mcap_reader.h"
#include "idl/cpp/codec.h"
#include "idl/cpp/publisher.h"
#include "tests/idl/guidance_samples.h"
#include "tests/idl/samples.h"
#include "tests/support/process.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using namespace std::chrono_literals;
using test::TempFolder;

constexpr int kDomain = 174;

// The numbers of each topic's samples in the journal of a folder, in its order.
std::map<std::string, std::vector<std::uint64_t>> NumbersIn(const std::string& folder) {
  std::map<std::string, std::vector<std::uint64_t>> numbers;
  for (const JournalFile& file : JournalFilesIn(folder)) {
    const std::string bytes = test::ReadText(file.path);
    (void)ReadMcap(
        std::as_bytes(std::span(bytes)),
        [&](const McapChannel& channel, const McapMessage& message) {
          std::uint64_t number = 0;
          dds::RelativePose pose;
          dds::Guidance guidance;
          dds::Command command;
          if (dds::DecodeCdr(message.data, &pose) == dds::BoundaryFault::kNone) {
            number = pose.sample_number;
            EXPECT_EQ(message.publish_time, pose.published_at);
            pose.sample_number = dds::test::FullRelativePose().sample_number;
            EXPECT_TRUE(dds::test::Same(pose, dds::test::FullRelativePose()));
          } else if (dds::DecodeCdr(message.data, &guidance) == dds::BoundaryFault::kNone) {
            number = guidance.sample_number;
          } else if (dds::DecodeCdr(message.data, &command) == dds::BoundaryFault::kNone) {
            number = std::stoull(command.request_id.c_str());
          }
          numbers[channel.topic].push_back(number);
        });
  }
  return numbers;
}

// A machine that talks about a pose, the guidance and a command, each with the same number.
class Talker {
 public:
  Talker()
      : participant_(Config()),
        poses_(participant_),
        guidance_(participant_),
        commands_(participant_),
        alarms_(participant_) {
    EXPECT_EQ(alarms_.Write(dds::test::FullAlarmStatus()), dds::WriteOutcome::kWritten);
  }

  std::uint64_t Talk() {
    ++number_;
    dds::RelativePose pose = dds::test::FullRelativePose();
    pose.sample_number = number_;
    EXPECT_EQ(poses_.Write(pose), dds::WriteOutcome::kWritten);
    dds::Guidance guidance = dds::test::FullGuidance();
    guidance.sample_number = number_;
    EXPECT_EQ(guidance_.Write(guidance), dds::WriteOutcome::kWritten);
    dds::Command command = dds::test::FullCommand();
    command.request_id = std::string_view(std::to_string(number_));
    EXPECT_EQ(commands_.Write(command), dds::WriteOutcome::kWritten);
    std::this_thread::sleep_for(10ms);
    return number_;
  }

 private:
  static dds::ParticipantConfig Config() {
    dds::ParticipantConfig config;
    config.domain_id = kDomain;
    return config;
  }

  dds::Participant participant_;
  dds::Publisher<dds::RelativePose> poses_;
  dds::Publisher<dds::Guidance> guidance_;
  dds::Publisher<dds::Command> commands_;
  dds::Publisher<dds::AlarmStatus> alarms_;
  std::uint64_t number_ = 0;
};

TEST(Record, EverySampleOfEveryTopicReachesTheJournal) {
  const TempFolder folder;
  Talker talker;
  test::Process record(
      {TBM_PROGRAM, "record", "--out", folder / "journal", "--domain", std::to_string(kDomain)});
  const std::vector<std::string> topics = {
      "tbm/v1/relative_pose", "tbm/v1/guidance", "tbm/v1/command"};
  const auto stands_in_journal = [&](std::uint64_t least) {
    auto numbers = NumbersIn(folder / "journal");
    return std::all_of(topics.begin(), topics.end(), [&](const std::string& topic) {
      return !numbers[topic].empty() && numbers[topic].back() >= least;
    });
  };
  const auto patience = std::chrono::steady_clock::now() + 40s;
  const auto is_patient = [&] { return std::chrono::steady_clock::now() < patience; };
  // From when on each is heard, is discovery's affair.
  while (is_patient() && !stands_in_journal(1)) talker.Talk();
  std::uint64_t last = 0;
  for (int i = 0; i < 40; ++i) last = talker.Talk();
  while (is_patient() && !stands_in_journal(last)) std::this_thread::sleep_for(20ms);
  record.Signal(SIGINT);
  EXPECT_EQ(record.Wait(), 0);
  EXPECT_TRUE(record.HasLine("tbm/v1/guidance "));

  const auto files = JournalFilesIn(folder / "journal");
  ASSERT_EQ(files.size(), 1u);
  const std::string bytes = test::ReadText(files[0].path);
  const auto content = ReadMcap(std::as_bytes(std::span(bytes)), {});
  ASSERT_TRUE(content);
  EXPECT_TRUE(content->has_footer);
  auto numbers = NumbersIn(folder / "journal");
  for (const std::string& topic : topics) {
    const std::vector<std::uint64_t>& seen = numbers[topic];
    ASSERT_GT(seen.size(), 40u) << topic;
    EXPECT_EQ(seen.back(), last) << topic;
    for (std::size_t i = 1; i < seen.size(); ++i) EXPECT_EQ(seen[i], seen[i - 1] + 1) << topic;
  }
  EXPECT_EQ(numbers["tbm/v1/alarm"].size(), 1u) << "what stood before we came";
}

TEST(Record, SaysThatNothingWasHeard) {
  const TempFolder folder;
  test::Process record({TBM_PROGRAM,
                        "record",
                        "--out",
                        folder / "journal",
                        "--domain",
                        std::to_string(kDomain + 1),
                        "--seconds",
                        "0.5"});
  EXPECT_EQ(record.Wait(), static_cast<int>(ExitCode::kDds));
  EXPECT_TRUE(record.HasLine("tbm: nothing heard on domain 175"));
}

}  // namespace
}  // namespace tbm
