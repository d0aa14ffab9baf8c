// Writes journals for readers that are not ours.
//   journal_samples full FOLDER   one full sample of every topic, and a local channel
//   journal_samples cuts FOLDER   a small journal cut at every byte: what tbm repair makes of each,
//                                 and on the output where each chunk ends, and the file
#include <cstdio>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "guidance/app/journal.h"
#include "guidance/app/journal_topic.h"
#include "guidance/journal/mcap_repair.h"
#include "guidance/journal/mcap_writer.h"
#include "tests/idl/guidance_samples.h"
#include "tests/idl/rail_samples.h"
#include "tests/idl/samples.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

constexpr Timestamp kLogTime{1'795'442'700'000'000'007};

// False when the sample was not taken.
template <class Message>
bool Write(Journal& journal, const Message& message, int number) {
  JournalTopic<Message> topic(journal);
  const bool is_taken = topic.Add(message, kLogTime + Duration(number));
  if (!is_taken) std::fprintf(stderr, "%s is not taken\n", dds::TopicOf<Message>().name.data());
  return is_taken;
}

template <class... Messages>
bool WriteAll(Journal& journal, const Messages&... messages) {
  static_assert(sizeof...(Messages) == dds::kTopics.size(), "a topic has no sample here");
  int number = 0;
  return (Write(journal, messages, number++) && ...);
}

int WriteFull(const std::string& folder) {
  using namespace dds::test;
  JournalOptions options;
  options.folder = folder;
  options.program = "journal_samples";
  options.free_min_bytes = 0;
  Journal journal(options);
  const bool is_taken = WriteAll(journal,
                                 FullFrameFeatures(),
                                 FullTiltReading(),
                                 FullRelativePose(),
                                 FullDeviceHealth(),
                                 FullEvent(),
                                 FullStationObservation(),
                                 FullStationSetUp(),
                                 FullShieldPose(),
                                 FullGuidance(),
                                 FullAlarmStatus(),
                                 FullCommand(),
                                 FullCommandReply(),
                                 FullTrolleyState(),
                                 FullRailLinePiece(),
                                 FullSettlementPiece(),
                                 FullCalibrationStatus());
  const auto local = journal.AddChannel({"local/note", "text", {}});
  constexpr std::string_view kNote = "not of DDS";
  journal.Add(local, std::as_bytes(std::span(kNote)), kLogTime + Duration(100), kLogTime);
  journal.Close();
  fmt::print("{}\n", journal.status().file);
  return is_taken && journal.status().messages_dropped == 0 ? 0 : 1;
}

int WriteCuts(const std::string& folder) {
  McapWriter writer("journal_samples");
  Bytes bytes;
  const auto append = [&bytes](const Bytes& more) {
    bytes.insert(bytes.end(), more.begin(), more.end());
  };
  append(writer.Begin());
  const auto notes = writer.AddChannel("local/note", "text", {"note", "words", "one line"});
  const auto others = writer.AddChannel("local/other", "text", {});
  std::uint32_t number = 0;
  for (int chunk = 0; chunk < 4; ++chunk) {
    for (const auto channel : {notes, notes, others}) {
      const std::string text = fmt::format("message {}", number);
      writer.AddMessage(
          channel, ++number, kLogTime + Duration(number), kLogTime, std::as_bytes(std::span(text)));
    }
    append(writer.TakeChunk());
    fmt::print("{}\n", bytes.size());
  }
  append(writer.End());
  fmt::print("{}\n", bytes.size());
  for (std::size_t cut = mcap::kMagic.size(); cut <= bytes.size(); ++cut) {
    const auto repair = RepairMcap(BytesView(bytes).first(cut), "journal_samples");
    if (!repair) return 1;
    const std::string_view mended(reinterpret_cast<const char*>(repair->bytes.data()),
                                  repair->bytes.size());
    test::WriteText(fmt::format("{}/{:05}.mcap", folder, cut), mended);
  }
  return 0;
}

}  // namespace
}  // namespace tbm

int main(int count, char** words) {
  if (count != 3) return 2;
  const std::string_view what = words[1];
  if (what == "full") return tbm::WriteFull(words[2]);
  return what == "cuts" ? tbm::WriteCuts(words[2]) : 2;
}
