// What a day of the whole machine takes on the disk, topic by topic, and what the journal costs
// beside the bare writing of the same bytes: appended and brought to the disk in pieces of 64 kB,
// turn by turn, medians.
//
// The day: camera and guidance at 5 Hz, five LEDs, five guided points, predictions to 20 m, both
// inclinometers at 10 Hz, four prisms every 30 s, four references, 20 alarms and 5 devices that
// each say once a second how they are. Ten minutes of it are written, at their log times.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "devices/replay/synced_file.h"
#include "guidance/app/journal.h"
#include "guidance/app/journal_files.h"
#include "guidance/app/journal_topic.h"
#include "guidance/journal/local_record.h"
#include "guidance/journal/mcap_reader.h"
#include "pose/base/check.h"
#include "tests/idl/guidance_samples.h"
#include "tests/idl/samples.h"
#include "tests/support/temp_folder.h"

namespace {

using namespace std::chrono_literals;
using namespace tbm;

constexpr Timestamp kStart{1'795'442'400'000'000'000};
constexpr int kSeconds = 600;
constexpr double kSecondsOfADay = 86'400.0;
constexpr int kRounds = 5;

template <std::size_t N, class T>
void Repeat(FixedVector<T, N>& items, std::size_t count) {
  while (items.size() < count) items.push_back(items[0]);
}

dds::FrameFeatures Features() {
  dds::FrameFeatures m = dds::test::FullFrameFeatures();
  Repeat(m.spots, 5);
  return m;
}
dds::StationSetUp SetUp() {
  dds::StationSetUp m = dds::test::FullStationSetUp();
  Repeat(m.references, 4);
  return m;
}
dds::Guidance GuidanceOfAll() {
  dds::Guidance m = dds::test::FullGuidance();
  Repeat(m.sources, 4);
  Repeat(m.points, 5);
  Repeat(m.ahead, 20);
  return m;
}

// One second after the other, each message as often as it comes in one.
class Machine {
 public:
  explicit Machine(Journal& journal) : journal_(journal) {
    Every(0.2, Features());
    Every(0.05, dds::test::FullTiltReading());
    Every(0.2, dds::test::FullRelativePose());
    Every(0.1, dds::test::FullShieldPose());
    Every(0.2, GuidanceOfAll());
    Every(7.5, dds::test::FullStationObservation());
    Every(1.0, SetUp());
    Every(0.05, dds::test::FullAlarmStatus());
    Every(0.2, dds::test::FullDeviceHealth());
    Every(60.0, dds::test::FullEvent());
    Every(600.0, dds::test::FullCommand());
    Every(600.0, dds::test::FullCommandReply());
    Every(0.2, {std::string(kStepTopic), "cdr", StepSchema()}, Encoded(StepRecord{kStart, 1}));
  }

  void Speak() {
    constexpr std::int64_t kTick = 50'000'000;
    for (std::int64_t ns = 0; ns < kSeconds * std::int64_t{1'000'000'000}; ns += kTick) {
      for (const Source& source : sources_) {
        if (ns % source.period_ns != 0) continue;
        const Timestamp at = kStart + Duration(ns);
        while (!journal_.Add(source.channel, source.bytes, at, at)) std::this_thread::yield();
      }
    }
  }

 private:
  struct Source {
    std::int64_t period_ns = 0;
    Journal::Channel channel = 0;
    Bytes bytes;
  };

  template <class Message>
  void Every(double period_s, const Message& message) {
    std::vector<std::byte> bytes;
    TBM_CHECK(dds::EncodeCdr(message, &bytes) == dds::BoundaryFault::kNone);
    Every(period_s, JournalChannelOf(dds::TopicOf<Message>()), bytes);
  }
  void Every(double period_s, const JournalChannel& channel, const Bytes& bytes) {
    sources_.push_back(
        {static_cast<std::int64_t>(period_s * 1e9), journal_.AddChannel(channel), bytes});
  }

  Journal& journal_;
  std::vector<Source> sources_;
};

JournalOptions OptionsFor(const std::string& folder) {
  JournalOptions options;
  options.folder = folder;
  options.program = "journal_bench";
  options.free_min_bytes = 0;
  return options;
}

void PrintADay() {
  const test::TempFolder folder;
  Journal journal(OptionsFor(folder / "journal"));
  Machine(journal).Speak();
  journal.Close();
  std::map<std::string, std::pair<std::uint64_t, std::uint64_t>> topics;  // messages, bytes
  std::uint64_t bytes_of_all = 0;
  for (const JournalFile& file : JournalFilesIn(folder / "journal")) {
    const std::string bytes = test::ReadText(file.path);
    bytes_of_all += bytes.size();
    (void)ReadMcap(std::as_bytes(std::span(bytes)),
                   [&](const McapChannel& channel, const McapMessage& message) {
                     // With the record's head and the entry in the index.
                     constexpr std::uint64_t kAround = 31 + 16;
                     auto& [count, size] = topics[channel.topic];
                     ++count;
                     size += message.data.size() + kAround;
                   });
  }
  const double days = kSeconds / kSecondsOfADay;
  fmt::print("{:<28} {:>12} {:>10} {:>10}\n", "topic", "a second", "bytes", "MB a day");
  for (const auto& [topic, sum] : topics) {
    const auto& [count, size] = sum;
    fmt::print("{:<28} {:>12.3f} {:>10} {:>10.1f}\n",
               topic,
               static_cast<double>(count) / kSeconds,
               size / count,
               static_cast<double>(size) / days * 1e-6);
  }
  fmt::print("{:<28} {:>12} {:>10} {:>10.1f}\n",
             "all, with schemas and indexes",
             "",
             "",
             static_cast<double>(bytes_of_all) / days * 1e-6);
}

// Seconds for the journal, and for the bare writing of as many bytes.
double JournalSeconds(std::uint64_t* bytes) {
  const test::TempFolder folder;
  const auto start = std::chrono::steady_clock::now();
  Journal journal(OptionsFor(folder / "journal"));
  Machine(journal).Speak();
  journal.Close();
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
  *bytes = journal.status().bytes_written;
  return taken.count();
}

double BareSeconds(std::uint64_t bytes) {
  const test::TempFolder folder;
  const std::string piece(64 * 1024, 'x');
  const auto start = std::chrono::steady_clock::now();
  SyncedFile file;
  if (file.Create(folder / "bare") != 0) return 0.0;
  for (std::uint64_t done = 0; done < bytes; done += piece.size()) {
    if (file.Append(piece) != 0 || file.Sync() != 0) return 0.0;
  }
  file.Close();
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
  return taken.count();
}

}  // namespace

int main() {
  PrintADay();
  std::vector<double> ratios;
  double journal_s = 0.0;
  std::uint64_t bytes = 0;
  for (int round = 0; round < kRounds; ++round) {
    journal_s = JournalSeconds(&bytes);
    ratios.push_back(journal_s / BareSeconds(bytes));
  }
  std::nth_element(ratios.begin(), ratios.begin() + kRounds / 2, ratios.end());
  std::printf("ten minutes are %.1f MB, written in %.2f s: %.0f times as fast as they come\n",
              1e-6 * static_cast<double>(bytes),
              journal_s,
              kSeconds / journal_s);
  std::printf("bench journal: %.2fx of the time that bare write and fdatasync take for the bytes\n",
              ratios[kRounds / 2]);
  return 0;
}
