// The journal in its folder: what reaches the disk, when a new file begins, which one goes, and
// what happens while the disk is not to be had.
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "guidance/app/journal.h"
#include "guidance/app/journal_files.h"
#include "guidance/journal/mcap_reader.h"
#include "tests/support/loop_disk.h"
#include "tests/support/random.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using test::TempFolder;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr std::int64_t kStart = 1'795'442'700 * kSecond;  // 2026-11-23T14:05:00Z
constexpr auto kPatience = 60s;

BytesView View(const std::string& text) { return std::as_bytes(std::span(text)); }
std::string Text(BytesView bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

struct Line {
  std::string topic;
  std::uint32_t sequence = 0;
  std::string text;
  bool operator==(const Line&) const = default;
};
void PrintTo(const Line& line, std::ostream* out) {
  *out << line.topic << " " << line.sequence << " " << line.text;
}

struct ReadFile {
  McapContent content;
  std::vector<Line> lines;
};

ReadFile Read(const std::string& path) {
  ReadFile file;
  const std::string bytes = test::ReadText(path);
  auto content = ReadMcap(View(bytes), [&](const McapChannel& channel, const McapMessage& message) {
    file.lines.push_back({channel.topic, message.sequence, Text(message.data)});
  });
  EXPECT_TRUE(content) << path;
  if (content) file.content = *content;
  EXPECT_TRUE(file.content.damages.empty()) << path;
  return file;
}

// Of all files of the folder, in their order.
std::vector<Line> ReadAll(const std::string& folder) {
  std::vector<Line> lines;
  for (const JournalFile& file : JournalFilesIn(folder)) {
    for (const Line& line : Read(file.path).lines) lines.push_back(line);
  }
  return lines;
}

std::vector<std::string> Names(const std::string& folder) {
  std::vector<std::string> names;
  for (const JournalFile& file : JournalFilesIn(folder)) {
    names.push_back(fs::path(file.path).filename().string());
  }
  return names;
}

JournalOptions OptionsFor(const std::string& folder) {
  JournalOptions options;
  options.folder = folder;
  options.program = "journal_folder_test 1";
  options.free_min_bytes = 0;
  options.retry_after = 20ms;
  return options;
}

const JournalChannel kNotes{"local/note", "text", {"note", "words", "one line"}};

// True when it came true before patience ended.
template <class Condition>
bool Becomes(Condition condition) {
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(1ms);
  }
  return true;
}

TEST(JournalFolder, WhatIsAddedStandsInTheFile) {
  const TempFolder folder;
  Journal journal(OptionsFor(folder / "a/b"));
  const auto notes = journal.AddChannel(kNotes);
  const auto other = journal.AddChannel({"local/other", "", {}});
  EXPECT_TRUE(journal.Add(notes, View("one"), {kStart}, {kStart - 5}));
  EXPECT_TRUE(journal.Add(other, View(""), {kStart + 1}, {kStart}));
  EXPECT_TRUE(journal.Add(notes, View("two"), {kStart + 2}, {kStart}));
  EXPECT_TRUE(journal.Flush(kPatience));
  EXPECT_EQ(journal.status().state, JournalState::kWriting);
  EXPECT_EQ(journal.status().messages_written, 3u);
  EXPECT_THAT(Names(folder / "a/b"), ElementsAre("journal_20261123T140500Z_001.mcap"));
  const std::string path = journal.status().file;
  EXPECT_FALSE(Read(path).content.has_footer);

  journal.Close();
  const ReadFile file = Read(path);
  EXPECT_TRUE(file.content.has_footer);
  EXPECT_THAT(
      file.lines,
      ElementsAre(
          Line{"local/note", 1, "one"}, Line{"local/other", 1, ""}, Line{"local/note", 2, "two"}));
  EXPECT_EQ(file.content.channels.at(1).message_encoding, "text");
  EXPECT_EQ(file.content.channels.at(1).schema, kNotes.schema);
  const JournalStatus status = journal.status();
  EXPECT_EQ(status.state, JournalState::kIdle);
  EXPECT_EQ(status.messages_dropped, 0u);
  EXPECT_EQ(status.files_begun, 1u);
  EXPECT_EQ(status.bytes_written, fs::file_size(path));
  EXPECT_EQ(status.total_bytes, static_cast<std::int64_t>(fs::file_size(path)));
  EXPECT_FALSE(journal.Add(notes, View("late"), {kStart}, {kStart}));
}

TEST(JournalFolder, AMessageReachesTheDiskByItsAgeAlone) {
  const TempFolder folder;
  JournalOptions options = OptionsFor(folder / "j");
  options.chunk_max_age = 50ms;
  Journal journal(options);
  const auto notes = journal.AddChannel(kNotes);
  journal.Add(notes, View("alone"), {kStart}, {kStart});
  EXPECT_TRUE(Becomes([&] { return journal.status().messages_written == 1; }));
  EXPECT_THAT(ReadAll(folder / "j"), ElementsAre(Line{"local/note", 1, "alone"}));
}

TEST(JournalFolder, ChunksStayBelowTheirSize) {
  const TempFolder folder;
  JournalOptions options = OptionsFor(folder / "j");
  options.chunk_max_bytes = 1000;
  options.chunk_max_age = 1h;
  Journal journal(options);
  const auto notes = journal.AddChannel(kNotes);
  const std::string text(100, 'x');
  for (int i = 0; i < 100; ++i) journal.Add(notes, View(text), {kStart + i}, {kStart});
  journal.Add(notes, View(std::string(5000, 'y')), {kStart + 100}, {kStart});
  journal.Add(notes, View(text), {kStart + 101}, {kStart});
  journal.Close();
  const ReadFile file = Read(journal.status().file);
  EXPECT_EQ(file.lines.size(), 102u);
  // Seven of 131 bytes fit; the long one stands alone.
  EXPECT_GE(file.content.chunks, 100u / 7 + 2);
}

TEST(JournalFolder, EveryStartBeginsAFileOfItsOwn) {
  const TempFolder folder;
  test::WriteText(folder / "journal_20200101T000000Z_041.mcap.part", "not ours");
  test::WriteText(folder / "notes.txt", "not ours");
  test::WriteText(folder / "journal_20200101T000000Z_999999999999999999999.mcap", "not ours");
  for (int start = 0; start < 3; ++start) {
    Journal journal(OptionsFor(folder.path()));
    const auto notes = journal.AddChannel(kNotes);
    // The clock goes back a day with each start: the number still gives the order.
    const std::int64_t at = kStart - start * 86'400 * kSecond;
    journal.Add(notes, View(std::to_string(start)), {at}, {at});
  }
  EXPECT_THAT(Names(folder.path()),
              ElementsAre("journal_20261123T140500Z_001.mcap",
                          "journal_20261122T140500Z_002.mcap",
                          "journal_20261121T140500Z_003.mcap"));
  EXPECT_THAT(
      ReadAll(folder.path()),
      ElementsAre(
          Line{"local/note", 1, "0"}, Line{"local/note", 1, "1"}, Line{"local/note", 1, "2"}));
}

struct Rotation {
  const char* name;
  std::vector<std::int64_t> seconds;  // log times
  std::vector<std::string> expected;  // beginnings of the files' names
};

TEST(JournalFolder, ANewFileBeginsByTime) {
  const std::vector<Rotation> rotations = {
      {"after its length",
       {0, 599, 600, 601},
       {"journal_20261123T140500Z_001", "journal_20261123T141500Z_002"}},
      {"at midnight",
       {0, 35'699, 35'700},
       {"journal_20261123T140500Z_001",
        "journal_20261123T235959Z_002",
        "journal_20261124T000000Z_003"}},
      {"when the clock goes back behind the newest",
       {0, 100, 40, 41},
       {"journal_20261123T140500Z_001", "journal_20261123T140540Z_002"}},
      {"when the clock goes back",
       {100, 101, 40, 41},
       {"journal_20261123T140640Z_001", "journal_20261123T140540Z_002"}},
  };
  for (const Rotation& rotation : rotations) {
    SCOPED_TRACE(rotation.name);
    const TempFolder folder;
    JournalOptions options = OptionsFor(folder.path());
    options.file_max_duration = 10min;
    Journal journal(options);
    const auto notes = journal.AddChannel(kNotes);
    std::vector<Line> expected;
    for (const std::int64_t second : rotation.seconds) {
      const std::string text = std::to_string(second);
      const std::int64_t at = kStart + second * kSecond;
      ASSERT_TRUE(journal.Add(notes, View(text), {at}, {at}));
      ASSERT_TRUE(journal.Flush(kPatience));
      expected.push_back({"local/note", static_cast<std::uint32_t>(expected.size() + 1), text});
    }
    journal.Close();
    std::vector<std::string> names = Names(folder.path());
    for (std::string& name : names) name.resize(name.size() - std::string(".mcap").size());
    EXPECT_EQ(names, rotation.expected);
    EXPECT_EQ(ReadAll(folder.path()), expected);
    for (const JournalFile& file : JournalFilesIn(folder.path())) {
      EXPECT_TRUE(Read(file.path).content.has_footer) << file.path;
    }
  }
}

// In one turn of the thread: a clock that jumps to and fro makes one file more, not one for each
// message; the chunk ends at the jump, so that no file's times go back.
TEST(JournalFolder, AJumpingClockIsNoFlood) {
  const TempFolder folder;
  JournalOptions options = OptionsFor(folder.path());
  options.chunk_max_age = 1h;
  Journal journal(options);
  const auto notes = journal.AddChannel(kNotes);
  for (int i = 0; i < 100; ++i) {
    const std::int64_t at = kStart + (i % 2 == 0 ? 0 : -100 * kSecond);
    journal.Add(notes, View(std::to_string(i)), {at}, {at});
  }
  journal.Close();
  const auto files = JournalFilesIn(folder.path());
  ASSERT_EQ(files.size(), 2u);
  EXPECT_THAT(Read(files[0].path).lines, ElementsAre(Line{"local/note", 1, "0"}));
  EXPECT_EQ(Read(files[1].path).lines.size(), 99u);
}

TEST(JournalFolder, TheOldestFilesGoAndNeverTheOneBeingWritten) {
  const TempFolder folder;
  JournalOptions options = OptionsFor(folder.path());
  options.total_max_bytes = 80'000;
  Journal journal(options);
  const auto notes = journal.AddChannel(kNotes);
  const std::string text(2000, 'x');
  for (int i = 0; i < 100; ++i) {
    ASSERT_TRUE(journal.Add(notes, View(text), {kStart + i * kSecond}, {kStart}));
    ASSERT_TRUE(journal.Flush(kPatience));
    std::int64_t bytes = 0;
    for (const JournalFile& file : JournalFilesIn(folder.path())) bytes += file.bytes;
    EXPECT_LE(bytes, 80'000);
    EXPECT_EQ(bytes, journal.status().total_bytes);
    EXPECT_EQ(JournalFilesIn(folder.path()).back().path, journal.status().file);
  }
  const JournalStatus status = journal.status();
  EXPECT_GT(status.files_deleted, 10u);
  const std::vector<Line> lines = ReadAll(folder.path());
  // What is left is the end, without a gap, and most of the room is used.
  ASSERT_FALSE(lines.empty());
  EXPECT_EQ(lines.back().sequence, 100u);
  EXPECT_EQ(lines.front().sequence, 100 - lines.size() + 1);
  EXPECT_GE(lines.size(), 25u);
  const std::vector<JournalFile> files = JournalFilesIn(folder.path());
  EXPECT_EQ(files.back().number, status.files_begun);
  EXPECT_EQ(files.front().number, status.files_deleted + 1);

  // One message is more than all files may have: it is written all the same.
  options.folder = folder / "small";
  options.total_max_bytes = 100;
  Journal small(options);
  const auto small_notes = small.AddChannel(kNotes);
  for (int i = 0; i < 5; ++i) {
    small.Add(small_notes, View(text), {kStart + i * kSecond}, {kStart});
    EXPECT_TRUE(small.Flush(kPatience));
    EXPECT_EQ(JournalFilesIn(folder / "small").size(), 1u);
  }
}

// No folder to be had: nothing waits, the queue fills and then drops, and when the folder can be
// made all that is in the queue gets there.
TEST(JournalFolder, WhatTheDiskDoesNotTakeWaitsAndThenDrops) {
  const TempFolder folder;
  test::WriteText(folder / "in_the_way", "a file where the folder should be");
  JournalOptions options = OptionsFor(folder / "in_the_way");
  options.queue_max_bytes = 10'000;
  options.chunk_max_bytes = 2000;
  Journal journal(options);
  const auto notes = journal.AddChannel(kNotes);
  const std::string text(1000, 'x');
  journal.Add(notes, View(text), {kStart}, {kStart});
  EXPECT_FALSE(journal.Flush(100ms));
  ASSERT_TRUE(Becomes([&] { return journal.status().state == JournalState::kFailed; }));
  EXPECT_THAT(journal.status().what, testing::HasSubstr("in_the_way"));
  std::uint64_t taken = 1;
  for (int i = 1; i < 100; ++i) {
    taken += journal.Add(notes, View(text), {kStart + i}, {kStart}) ? 1 : 0;
  }
  EXPECT_GE(taken, 9u);
  EXPECT_LE(taken, 20u);
  EXPECT_EQ(journal.status().messages_dropped, 100 - taken);
  EXPECT_EQ(journal.status().messages_written, 0u);

  fs::remove(folder / "in_the_way");
  EXPECT_TRUE(journal.Flush(kPatience));
  EXPECT_EQ(journal.status().state, JournalState::kWriting);
  EXPECT_EQ(journal.status().what, "");
  journal.Add(notes, View("after"), {kStart + 100}, {kStart});
  journal.Close();
  const std::vector<Line> lines = ReadAll(folder / "in_the_way");
  ASSERT_EQ(lines.size(), taken + 1);
  // The gap in the sequence numbers is what was dropped.
  EXPECT_EQ(lines[taken - 1].sequence, taken);
  EXPECT_EQ(lines[taken], (Line{"local/note", 101, "after"}));
}

// The disk comes back and nobody has noticed yet: the end is the last chance, for what failed and
// for what came after it.
TEST(JournalFolder, AtTheEndEverythingIsTriedOnceMore) {
  const TempFolder folder;
  test::WriteText(folder / "in_the_way", "a file where the folder should be");
  JournalOptions options = OptionsFor(folder / "in_the_way");
  options.chunk_max_bytes = 2000;
  options.retry_after = 1h;
  Journal journal(options);
  const auto notes = journal.AddChannel(kNotes);
  const std::string text(3000, 'x');
  journal.Add(notes, View(text), {kStart}, {kStart});
  ASSERT_TRUE(Becomes([&] { return journal.status().state == JournalState::kFailed; }));
  journal.Add(notes, View(text), {kStart}, {kStart});
  fs::remove(folder / "in_the_way");
  journal.Close();
  EXPECT_EQ(ReadAll(folder / "in_the_way").size(), 2u);
  EXPECT_EQ(journal.status().messages_dropped, 0u);
}

TEST(JournalFolder, AFolderThatIsTakenAwayIsMadeAgain) {
  const TempFolder folder;
  Journal journal(OptionsFor(folder / "j"));
  const auto notes = journal.AddChannel(kNotes);
  journal.Add(notes, View("before"), {kStart}, {kStart});
  ASSERT_TRUE(journal.Flush(kPatience));
  fs::remove_all(folder / "j");
  journal.Add(notes, View("after"), {kStart + 1}, {kStart});
  ASSERT_TRUE(journal.Flush(kPatience));
  EXPECT_THAT(ReadAll(folder / "j"), ElementsAre(Line{"local/note", 2, "after"}));
  EXPECT_EQ(journal.status().files_begun, 2u);
}

// The limit on the size of a file stands for a disk without room: writing stops in the middle.
TEST(JournalFolder, AFullDiskCostsNothingThatWasWrittenAndEndsByItself) {
  const TempFolder folder;
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before = {};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  rlimit limit = before;
  limit.rlim_cur = 10'000;
  JournalOptions options = OptionsFor(folder.path());
  options.chunk_max_bytes = 2000;
  Journal journal(options);
  const auto notes = journal.AddChannel(kNotes);
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limit), 0);
  const std::string text(1500, 'x');
  // Each file takes six of these; then one is refused and begins the next file.
  for (int i = 0; i < 14; ++i) {
    ASSERT_TRUE(journal.Add(notes, View(text), {kStart + i}, {kStart}));
    ASSERT_TRUE(journal.Flush(kPatience)) << i;
  }
  // One that fits nowhere: no file is left behind by the attempts.
  const std::string large(20'000, 'y');
  journal.Add(notes, View(large), {kStart + 14}, {kStart});
  ASSERT_TRUE(Becomes([&] { return journal.status().state == JournalState::kDiskFull; }));
  EXPECT_FALSE(journal.Flush(200ms));
  EXPECT_THAT(journal.status().what, testing::HasSubstr("File too large"));
  EXPECT_LE(JournalFilesIn(folder.path()).size(), 4u);
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  EXPECT_TRUE(journal.Flush(kPatience));
  journal.Close();
  const std::vector<Line> lines = ReadAll(folder.path());
  ASSERT_EQ(lines.size(), 15u);
  for (std::size_t i = 0; i < lines.size(); ++i) EXPECT_EQ(lines[i].sequence, i + 1);
  EXPECT_EQ(journal.status().messages_dropped, 0u);
}

TEST(JournalFolder, LeavesRoomOnTheDiskForOthers) {
  const TempFolder folder;
  JournalOptions options = OptionsFor(folder.path());
  options.free_min_bytes = std::int64_t{1} << 60;
  options.chunk_max_age = 1ms;
  Journal journal(options);
  const auto notes = journal.AddChannel(kNotes);
  journal.Add(notes, View("x"), {kStart}, {kStart});
  EXPECT_TRUE(Becomes([&] { return journal.status().state == JournalState::kDiskFull; }));
  EXPECT_THAT(Names(folder.path()), IsEmpty());
  journal.Close();
  EXPECT_EQ(journal.status().messages_dropped, 1u);
}

TEST(JournalFolder, ManyThreadsLoseNothing) {
  const TempFolder folder;
  Journal journal(OptionsFor(folder.path()));
  std::vector<std::thread> threads;
  constexpr int kThreads = 4;
  constexpr int kEach = 2000;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&journal, t] {
      const auto mine = journal.AddChannel({"local/" + std::to_string(t), "", {}});
      for (int i = 0; i < kEach; ++i) {
        while (!journal.Add(mine, View(std::to_string(i)), {kStart + i}, {kStart})) {
          std::this_thread::yield();
        }
        if (i % 500 == 0) (void)journal.status();
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  journal.Close();
  std::map<std::string, int> next;
  for (const Line& line : ReadAll(folder.path())) {
    EXPECT_EQ(line.text, std::to_string(next[line.topic]++));
  }
  EXPECT_EQ(next.size(), static_cast<std::size_t>(kThreads));
  for (const auto& [topic, count] : next) EXPECT_EQ(count, kEach) << topic;
}

// Until it is killed, a message each millisecond and a new file often. `on_disk` is in memory
// shared with the test: how many messages the journal has said to be on the disk.
[[noreturn]] void WriteForEver(const std::string& folder, std::atomic<std::uint64_t>* on_disk) {
  JournalOptions options = OptionsFor(folder);
  options.chunk_max_age = 20ms;
  options.file_max_duration = 500ms;
  Journal journal(options);
  const auto notes = journal.AddChannel(kNotes);
  for (int i = 1;; ++i) {
    if (!journal.Add(notes, View(std::to_string(i)), {kStart + i * 1'000'000}, {kStart})) {
      std::_Exit(1);
    }
    on_disk->store(journal.status().messages_written);
    std::this_thread::sleep_for(1ms);
  }
}

// The mains go while the journal is written: what was said to be on the disk is there, each message
// once and in order.
TEST(JournalPowerCut, WhatWasSaidToBeOnTheDiskIsThere) {
  if (geteuid() != 0) GTEST_SKIP() << "mounting a disk needs root";
  const TempFolder folder;
  const std::string file = folder / "disk";
  ASSERT_TRUE(test::LoopDisk::Make(file, "32M"));
  const test::LoopDisk disk(file, folder / "mounted");
  if (!disk.is_mounted()) GTEST_SKIP() << "no loop device to be had";

  using Shared = std::atomic<std::uint64_t>;
  void* const shared =
      mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(shared, MAP_FAILED);
  auto* const on_disk = new (shared) Shared(0);
  const pid_t writer = fork();
  if (writer == 0) WriteForEver(disk.place() + "/journal", on_disk);

  test::Random random("JournalPowerCut");
  std::array<std::uint64_t, 6> on_disk_at_cut{};
  for (std::size_t cut = 0; cut < on_disk_at_cut.size(); ++cut) {
    std::this_thread::sleep_for(std::chrono::milliseconds(200 + random.Index(500)));
    kill(writer, SIGSTOP);
    on_disk_at_cut[cut] = on_disk->load();
    const std::string copy = folder / ("cut" + std::to_string(cut));
    ASSERT_TRUE(test::Runs("cp '" + file + "' '" + copy + "'"));
    kill(writer, SIGCONT);
  }
  kill(writer, SIGKILL);
  int status = 0;
  waitpid(writer, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status)) << "the writer ended by itself with " << WEXITSTATUS(status);

  for (std::size_t cut = 0; cut < on_disk_at_cut.size(); ++cut) {
    const std::string name = "cut" + std::to_string(cut);
    SCOPED_TRACE(name);
    const test::LoopDisk after(folder / name, folder / (name + "_mounted"));
    ASSERT_TRUE(after.is_mounted());
    std::uint64_t read = 0;
    for (const JournalFile& journal : JournalFilesIn(after.place() + "/journal")) {
      const std::string bytes = test::ReadText(journal.path);
      // The mains went between the name and the first bytes.
      if (bytes.size() < mcap::kMagic.size()) continue;
      const auto content = ReadMcap(View(bytes), [&](const McapChannel&, const McapMessage& m) {
        EXPECT_EQ(Text(m.data), std::to_string(++read));
      });
      ASSERT_TRUE(content);
      EXPECT_LE(content->damages.size(), 1u);
    }
    EXPECT_GE(read, on_disk_at_cut[cut]);
    EXPECT_GT(on_disk_at_cut[cut], 50u);
  }
}

}  // namespace
}  // namespace tbm
