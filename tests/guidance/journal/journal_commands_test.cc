// tbm repair, export and record: what they make of good, damaged and foreign journals, and what
// they say about it.
#include <chrono>
#include <filesystem>
#include <functional>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/replay/csv.h"
#include "guidance/app/export_command.h"
#include "guidance/app/journal.h"
#include "guidance/app/journal_files.h"
#include "guidance/app/journal_reading.h"
#include "guidance/app/journal_topic.h"
#include "guidance/app/repair_command.h"
#include "guidance/journal/mcap_repair.h"
#include "guidance/journal/mcap_writer.h"
#include "tests/idl/guidance_samples.h"
#include "tests/idl/samples.h"
#include "tests/support/random.h"
#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using test::ReadText;
using test::TempFolder;
using test::WriteText;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr Timestamp kStart{1'795'442'700 * kSecond};  // 2026-11-23T14:05:00Z

BytesView View(const std::string& text) { return std::as_bytes(std::span(text)); }
std::string Text(BytesView bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// Makes a journal by hand: a chunk wherever it is asked for.
class Maker {
 public:
  Maker() { Append(writer_.Begin()); }

  std::uint16_t Channel(const JournalChannel& channel) {
    return writer_.AddChannel(channel.topic, channel.message_encoding, channel.schema);
  }
  void AddBytes(std::uint16_t channel, Timestamp at, BytesView data) {
    writer_.AddMessage(channel, ++sequence_[channel], at, at, data);
  }
  template <class Message>
  void Add(std::uint16_t channel, Timestamp at, const Message& message) {
    std::vector<std::byte> bytes;
    ASSERT_EQ(dds::EncodeCdr(message, &bytes), dds::BoundaryFault::kNone);
    AddBytes(channel, at, bytes);
  }
  void Skip(std::uint16_t channel) { ++sequence_[channel]; }
  // Offset of the chunk in the file.
  std::size_t Chunk() {
    const std::size_t from = bytes_.size();
    Append(writer_.TakeChunk());
    return from;
  }
  const Bytes& End() {
    Append(writer_.End());
    return bytes_;
  }
  const Bytes& bytes() const { return bytes_; }

 private:
  void Append(const Bytes& more) { bytes_.insert(bytes_.end(), more.begin(), more.end()); }

  McapWriter writer_{"journal_commands_test"};
  Bytes bytes_;
  std::map<std::uint16_t, std::uint32_t> sequence_;
};

struct Outcome {
  ExitCode code = ExitCode::kDone;
  std::string out;
  std::string err;
};

template <class Request>
Outcome Run(ExitCode (*run)(const Request&, const Console&), const Request& request) {
  std::ostringstream out;
  std::ostringstream err;
  Outcome outcome;
  outcome.code = run(request, Console{out, err});
  outcome.out = out.str();
  outcome.err = err.str();
  return outcome;
}

Outcome Repair(const std::string& file, const std::string& out, bool force = false) {
  return Run<RepairRequest>(&RunRepair, {file, out, "test", force});
}

std::vector<std::string> Messages(BytesView bytes) {
  std::vector<std::string> messages;
  const auto content = ReadMcap(bytes, [&](const McapChannel& channel, const McapMessage& message) {
    messages.push_back(fmt::format(
        "{} {} {} {}", channel.topic, message.sequence, message.log_time.ns, Text(message.data)));
  });
  EXPECT_TRUE(content);
  return messages;
}

const JournalChannel kNote{"local/note", "text", {"note", "words", "one line"}};

// Three chunks, a second apart, of two messages each; `at` gets where they begin.
Bytes ThreeChunks(std::vector<std::size_t>* at, bool close = true) {
  Maker maker;
  const auto notes = maker.Channel(kNote);
  const auto others = maker.Channel({"local/other", "text", {}});
  for (int chunk = 0; chunk < 3; ++chunk) {
    const Timestamp time = kStart + Duration(chunk * kSecond);
    maker.AddBytes(notes, time, View("note " + std::to_string(chunk)));
    maker.AddBytes(others, time + Duration(250'000'000), View("other " + std::to_string(chunk)));
    at->push_back(maker.Chunk());
  }
  return close ? maker.End() : maker.bytes();
}

TEST(Repair, MakesAWholeFileAndSaysWhatIsMissingAndWhere) {
  const TempFolder folder;
  std::vector<std::size_t> at;
  Bytes bytes = ThreeChunks(&at);
  bytes[at[1] + 80] ^= std::byte{1};
  WriteText(folder / "bad.mcap", Text(bytes));
  const Outcome outcome = Repair(folder / "bad.mcap", folder / "good.mcap");
  EXPECT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  const std::string good = ReadText(folder / "good.mcap");
  EXPECT_THAT(Messages(View(good)),
              ElementsAre("local/note 1 1795442700000000000 note 0",
                          "local/other 1 1795442700250000000 other 0",
                          "local/note 3 1795442702000000000 note 2",
                          "local/other 3 1795442702250000000 other 2"));
  const auto content = ReadMcap(View(good), {});
  EXPECT_TRUE(content->has_footer);
  EXPECT_TRUE(content->damages.empty());
  EXPECT_EQ(content->chunks, 2u);
  EXPECT_EQ(content->channels.at(1).schema, kNote.schema);
  EXPECT_EQ(content->channels.at(2).schema, McapSchema{});
  EXPECT_THAT(outcome.out, HasSubstr("bad.mcap: 4 messages in 2 chunks, closed as it should be"));
  EXPECT_THAT(outcome.out,
              HasSubstr(fmt::format("at byte {}: a chunk whose bytes have changed; between "
                                    "2026-11-23T14:05:00.250Z and 2026-11-23T14:05:02.000Z",
                                    at[1])));
  EXPECT_THAT(outcome.out, HasSubstr("missing: 1 of local/note"));
  EXPECT_THAT(outcome.out, HasSubstr("missing: 1 of local/other"));
}

TEST(Repair, SaysWhatWasDroppedWhenItWasWritten) {
  const TempFolder folder;
  Maker maker;
  const auto notes = maker.Channel(kNote);
  maker.AddBytes(notes, kStart, View("1"));
  for (int i = 0; i < 5; ++i) maker.Skip(notes);
  maker.AddBytes(notes, kStart, View("7"));
  WriteText(folder / "a.mcap", Text(maker.End()));
  EXPECT_THAT(Repair(folder / "a.mcap", folder / "b.mcap").out,
              HasSubstr("missing: 5 of local/note"));
}

TEST(Repair, ReadsWhatIsBehindADamagedBeginning) {
  std::vector<std::size_t> at;
  const Bytes good = ThreeChunks(&at);
  for (std::size_t byte = 0; byte < mcap::kMagic.size(); ++byte) {
    Bytes bytes = good;
    bytes[byte] = std::byte{0};
    const auto repair = RepairMcap(bytes, "test");
    // Some of the magic is zero already.
    if (bytes == good) continue;
    ASSERT_TRUE(repair) << byte;
    EXPECT_EQ(Messages(repair->bytes), Messages(good));
    ASSERT_EQ(repair->losses.size(), 1u);
    EXPECT_EQ(repair->losses[0].damage.offset, 0u);
  }
  EXPECT_EQ(RepairMcap(View("stamp_ns,file\n1,frames/1.png\n"), "test").error(),
            McapFailure::kNotMcap);
  EXPECT_EQ(RepairMcap({}, "test").error(), McapFailure::kNotMcap);
}

// Cut, flipped, glued: what comes out is whole, and says no message that was not there.
TEST(Repair, WhateverTheBytesTheResultIsWhole) {
  std::vector<std::size_t> at;
  const Bytes good = ThreeChunks(&at);
  const std::vector<std::string> all = Messages(good);
  test::Random random("WhateverTheBytesTheResultIsWhole");
  for (int i = 0; i < 3000; ++i) {
    Bytes bytes = good;
    if (i % 3 == 0) bytes.resize(random.Index(static_cast<int>(bytes.size())));
    for (int flips = i % 4; flips > 0 && !bytes.empty(); --flips) {
      bytes[static_cast<std::size_t>(random.Index(static_cast<int>(bytes.size())))] ^=
          static_cast<std::byte>(1 << random.Index(8));
    }
    if (i % 5 == 0) bytes.insert(bytes.end(), good.begin(), good.end());
    const auto repair = RepairMcap(bytes, "test");
    if (!repair) continue;
    const auto content = ReadMcap(repair->bytes, {});
    ASSERT_TRUE(content);
    EXPECT_TRUE(content->has_footer && content->damages.empty());
    EXPECT_EQ(content->messages, repair->content.messages);
    std::vector<std::string> texts = Messages(repair->bytes);
    for (std::string& text : texts) text = text.substr(text.find(' '));
    for (const std::string& text : texts) {
      EXPECT_TRUE(std::any_of(all.begin(), all.end(), [&](const std::string& one) {
        return one.ends_with(text);
      })) << text;
    }
  }
}

TEST(Repair, RefusesInWords) {
  const TempFolder folder;
  std::vector<std::size_t> at;
  WriteText(folder / "good.mcap", Text(ThreeChunks(&at)));
  WriteText(folder / "there.mcap", "mine");
  WriteText(folder / "empty.mcap", "");
  WriteText(folder / "other.mcap", "stamp_ns,file\n");
  const Outcome there = Repair(folder / "good.mcap", folder / "there.mcap");
  EXPECT_EQ(there.code, ExitCode::kBadInput);
  EXPECT_THAT(there.err, HasSubstr("--force"));
  EXPECT_EQ(ReadText(folder / "there.mcap"), "mine");
  EXPECT_EQ(Repair(folder / "good.mcap", folder / "there.mcap", true).code, ExitCode::kDone);
  EXPECT_NE(ReadText(folder / "there.mcap"), "mine");

  const Outcome none = Repair(folder / "none.mcap", folder / "x.mcap");
  EXPECT_EQ(none.code, ExitCode::kBadInput);
  EXPECT_THAT(none.err, HasSubstr("none.mcap: cannot be opened"));
  const Outcome empty = Repair(folder / "empty.mcap", folder / "x.mcap");
  EXPECT_EQ(empty.code, ExitCode::kBadInput);
  EXPECT_THAT(empty.err, HasSubstr("empty.mcap: is empty"));
  const Outcome other = Repair(folder / "other.mcap", folder / "x.mcap");
  EXPECT_EQ(other.code, ExitCode::kBadInput);
  EXPECT_THAT(other.err, HasSubstr("other.mcap: is no journal"));
  EXPECT_FALSE(fs::exists(folder / "x.mcap"));
}

Outcome Export(ExportRequest request) { return Run<ExportRequest>(&RunExport, request); }

CsvTable Table(const std::string& path) {
  auto table = CsvTable::Parse(ReadText(path), path, {});
  EXPECT_TRUE(table) << table.error().Text();
  return std::move(table).value();
}

std::string Cell(const CsvTable& table, std::size_t row, std::string_view column) {
  const auto found = table.Column(column);
  return found ? std::string(table.Field(row, *found)) : "no column " + std::string(column);
}

JournalChannel EventChannel() { return JournalChannelOf(dds::kEventTopic); }

dds::Event EventNumber(std::uint64_t number, std::string_view text = "x") {
  dds::Event event = dds::test::FullEvent();
  event.sample_number = number;
  event.text = text;
  return event;
}

TEST(Export, ColumnsAreThoseOfAllRowsAndMissingOnesAreEmpty) {
  const TempFolder folder;
  Maker maker;
  const auto channel = maker.Channel(JournalChannelOf(dds::kGuidanceTopic));
  dds::Guidance guidance = dds::test::FullGuidance();
  guidance.ring_number = -1;
  guidance.lead_up_per_m = dds::kNaN;
  maker.Add(channel, kStart, guidance);
  guidance = dds::test::FullGuidance();
  guidance.points[1].name = "my, \"point\"";
  maker.Add(channel, kStart + Duration(5), guidance);
  WriteText(folder / "a.mcap", Text(maker.End()));
  const Outcome outcome = Export({{folder / "a.mcap"}, folder / "out", {}, "", "", false});
  EXPECT_EQ(outcome.code, ExitCode::kDone) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("guidance.csv: 2 rows"));
  const CsvTable table = Table(folder / "out/guidance.csv");
  ASSERT_EQ(table.row_count(), 2u);
  EXPECT_EQ(Cell(table, 0, "log_time_utc_ns"), "1795442700000000000");
  EXPECT_EQ(Cell(table, 1, "log_sequence"), "2");
  EXPECT_EQ(Cell(table, 0, "ring_number"), "");
  EXPECT_EQ(Cell(table, 1, "ring_number"), "417");
  EXPECT_EQ(Cell(table, 0, "lead_up_per_m"), "");
  EXPECT_EQ(Cell(table, 0, "cutter_face_deviation_right_m"), "0.0437");
  EXPECT_EQ(Cell(table, 0, "tail_chainage_m"), "464.4");
  EXPECT_EQ(Cell(table, 1, "tail_chainage_m"), "");
  EXPECT_EQ(Cell(table, 0, "my, \"point\"_chainage_m"), "");
  EXPECT_EQ(Cell(table, 1, "my, \"point\"_chainage_m"), "464.4");
  EXPECT_EQ(Cell(table, 1, "source_camera_freshness"), "coasting");
}

TEST(Export, TextsStayInTheirCells) {
  const TempFolder folder;
  Maker maker;
  const auto channel = maker.Channel(EventChannel());
  const std::vector<std::string> texts = {
      "plain", "a,b", "say \"stop\"", "two\r\nlines", "\"", "Türe auf", ",", "=1+1"};
  for (std::size_t i = 0; i < texts.size(); ++i) {
    maker.Add(channel, kStart, EventNumber(i + 1, texts[i]));
  }
  WriteText(folder / "a.mcap", Text(maker.End()));
  ASSERT_EQ(Export({{folder / "a.mcap"}, folder / "out", {}, "", "", false}).code, ExitCode::kDone);
  const CsvTable table = Table(folder / "out/event.csv");
  ASSERT_EQ(table.row_count(), texts.size());
  for (std::size_t i = 0; i < texts.size(); ++i) {
    EXPECT_EQ(Cell(table, i, "sample_number"), std::to_string(i + 1));
    EXPECT_EQ(Cell(table, i, "text"), texts[i] == "two\r\nlines" ? "two  lines" : texts[i]);
  }
}

// Two points of one name; a name that makes the column of another.
TEST(Export, NoCellOverwritesAnother) {
  const TempFolder folder;
  Maker maker;
  const auto channel = maker.Channel(JournalChannelOf(dds::kGuidanceTopic));
  dds::Guidance guidance = dds::test::FullGuidance();
  guidance.points[1].name = guidance.points[0].name;
  maker.Add(channel, kStart, guidance);
  maker.Add(channel, kStart, guidance);
  WriteText(folder / "a.mcap", Text(maker.End()));
  ASSERT_EQ(Export({{folder / "a.mcap"}, folder / "out", {}, "", "", false}).code, ExitCode::kDone);
  const CsvTable table = Table(folder / "out/guidance.csv");
  for (std::size_t row = 0; row < 2; ++row) {
    EXPECT_EQ(Cell(table, row, "cutter_face_chainage_m"), "434.4");
    EXPECT_EQ(Cell(table, row, "cutter_face_chainage_m_2"), "464.4");
  }
}

TEST(Export, OnlyWhatWasAskedFor) {
  const TempFolder folder;
  JournalOptions options;
  options.folder = folder / "journal";
  options.free_min_bytes = 0;
  options.file_max_duration = 5s;
  {
    Journal journal(options);
    JournalTopic<dds::Event> events(journal);
    JournalTopic<dds::AlarmStatus> alarms(journal);
    for (int i = 0; i < 10; ++i) {
      const Timestamp at = kStart + Duration(i * kSecond);
      ASSERT_TRUE(events.Add(EventNumber(static_cast<std::uint64_t>(i + 1)), at));
      ASSERT_TRUE(alarms.Add(dds::test::FullAlarmStatus(), at));
      ASSERT_TRUE(journal.Flush(60s));
    }
  }
  EXPECT_EQ(JournalFilesIn(folder / "journal").size(), 2u);
  ExportRequest request{{folder / "journal"}, folder / "a", {"event"}, "", "", false};
  EXPECT_EQ(Export(request).code, ExitCode::kDone);
  EXPECT_EQ(Table(folder / "a/event.csv").row_count(), 10u);
  EXPECT_FALSE(fs::exists(folder / "a/alarm.csv"));

  request = {{folder / "journal"},
             folder / "b",
             {"tbm/v1/event", "alarm"},
             "2026-11-23T14:05:03Z",
             "1795442706000000000",
             false};
  EXPECT_EQ(Export(request).code, ExitCode::kDone);
  EXPECT_EQ(Table(folder / "b/event.csv").row_count(), 4u);
  EXPECT_EQ(Cell(Table(folder / "b/event.csv"), 0, "sample_number"), "4");
  EXPECT_EQ(Table(folder / "b/alarm.csv").row_count(), 4u);

  request.topics = {"events"};
  EXPECT_THAT(Export(request).err, HasSubstr("--topic 'events': there are frame_features"));
  request.topics = {"guidance"};
  EXPECT_EQ(Export(request).code, ExitCode::kBadInput);
  EXPECT_THAT(Export(request).err, HasSubstr("nothing to export"));
  request.from = "yesterday";
  EXPECT_THAT(Export(request).err, HasSubstr("'yesterday' is no time"));
}

TEST(Export, NothingIsReplacedUnlessThatIsAllowed) {
  const TempFolder folder;
  Maker maker;
  const auto channel = maker.Channel(EventChannel());
  maker.Add(channel, kStart, EventNumber(1));
  WriteText(folder / "a.mcap", Text(maker.End()));
  WriteText(folder / "event.csv", "mine");
  ExportRequest request{{folder / "a.mcap"}, folder.path(), {}, "", "", false};
  const Outcome refused = Export(request);
  EXPECT_EQ(refused.code, ExitCode::kBadInput);
  EXPECT_THAT(refused.err, HasSubstr("--force"));
  EXPECT_EQ(ReadText(folder / "event.csv"), "mine");
  request.force = true;
  EXPECT_EQ(Export(request).code, ExitCode::kDone);
  EXPECT_EQ(Table(folder / "event.csv").row_count(), 1u);
  for (const auto& entry : fs::directory_iterator(folder.path())) {
    EXPECT_THAT(entry.path().string(), Not(HasSubstr(".part")));
  }
}

struct Foreign {
  const char* name;
  std::function<void(JournalChannel&)> change;
  const char* says;  // empty: exported
};

TEST(Export, WhatIsNotOursIsNamedAndTheRestExported) {
  const std::vector<Foreign> cases = {
      {"topic", [](JournalChannel& c) { c.topic = "camera/raw"; }, "'camera/raw' is not exported"},
      {"encoding", [](JournalChannel& c) { c.message_encoding = "json"; }, "'json' instead of cdr"},
      {"type", [](JournalChannel& c) { c.schema.name = "tbm::v2::Event"; }, "'tbm::v2::Event'"},
      {"version",
       [](JournalChannel& c) { c.schema.text += "struct More { long x; };"; },
       "another version of tbm::v1::Event"},
      {"no schema", [](JournalChannel& c) { c.schema = {}; }, "type '' instead of"},
      {"comment", [](JournalChannel& c) { c.schema.text += "\n  // only words\n"; }, ""},
  };
  for (const Foreign& foreign : cases) {
    SCOPED_TRACE(foreign.name);
    const TempFolder folder;
    Maker maker;
    JournalChannel changed = EventChannel();
    foreign.change(changed);
    const auto odd = maker.Channel(changed);
    const auto good = maker.Channel(JournalChannelOf(dds::kAlarmStatusTopic));
    maker.Add(odd, kStart, EventNumber(1));
    maker.Add(good, kStart, dds::test::FullAlarmStatus());
    WriteText(folder / "a.mcap", Text(maker.End()));
    const Outcome outcome = Export({{folder / "a.mcap"}, folder / "out", {}, "", "", false});
    EXPECT_EQ(outcome.code, ExitCode::kDone);
    EXPECT_EQ(Table(folder / "out/alarm.csv").row_count(), 1u);
    const bool is_exported = std::string(foreign.says).empty();
    EXPECT_EQ(fs::exists(folder / "out/event.csv"), is_exported);
    if (is_exported) {
      EXPECT_THAT(outcome.err, IsEmpty());
    } else {
      EXPECT_THAT(outcome.err, HasSubstr(foreign.says));
    }
  }
}

TEST(Export, DamageIsToldAndTheRestExported) {
  const TempFolder folder;
  Maker maker;
  const auto channel = maker.Channel(EventChannel());
  std::vector<std::size_t> at;
  for (std::uint64_t i = 1; i <= 3; ++i) {
    maker.Add(channel, kStart, EventNumber(i));
    at.push_back(maker.Chunk());
  }
  const std::string good = Text(maker.End());
  std::string flipped = good;
  // The second chunk has no declarations before it: it begins where it was handed out.
  flipped[at[1] + 100] ^= 1;
  WriteText(folder / "flipped.mcap", flipped);
  WriteText(folder / "cut.mcap", good.substr(0, at[2] + 50));
  WriteText(folder / "empty.mcap", "");
  WriteText(folder / "other.mcap", "not a journal");

  Outcome outcome = Export({{folder / "flipped.mcap"}, folder / "1", {}, "", "", false});
  EXPECT_EQ(outcome.code, ExitCode::kBadInput);
  EXPECT_THAT(outcome.err,
              HasSubstr(fmt::format("at byte {}: a chunk whose bytes have changed", at[1])));
  EXPECT_EQ(Table(folder / "1/event.csv").row_count(), 2u);

  // A power cut is no fault of the file: nothing is wrong with what is left.
  outcome = Export({{folder / "empty.mcap", folder / "cut.mcap"}, folder / "2", {}, "", "", false});
  EXPECT_EQ(outcome.code, ExitCode::kDone);
  EXPECT_THAT(outcome.err, HasSubstr("reaches beyond the end"));
  EXPECT_THAT(outcome.err, HasSubstr("empty.mcap: is empty"));
  EXPECT_EQ(Table(folder / "2/event.csv").row_count(), 2u);

  outcome = Export({{folder / "other.mcap", folder / "cut.mcap"}, folder / "4", {}, "", "", false});
  EXPECT_EQ(outcome.code, ExitCode::kBadInput);
  outcome = Export({{folder / "other.mcap", folder / "cut.mcap", folder / "none.mcap"},
                    folder / "3",
                    {},
                    "",
                    "",
                    false});
  EXPECT_EQ(outcome.code, ExitCode::kBadInput);
  EXPECT_THAT(outcome.err, HasSubstr("other.mcap: is no journal"));
  EXPECT_THAT(outcome.err, HasSubstr("none.mcap: cannot be opened"));
  EXPECT_EQ(Table(folder / "3/event.csv").row_count(), 2u);
}

TEST(Export, SamplesThatBreakTheContractAreCountedAndLeftOut) {
  const TempFolder folder;
  Maker maker;
  const auto channel = maker.Channel(EventChannel());
  maker.AddBytes(channel, kStart, View("not CDR"));
  maker.Add(channel, kStart, EventNumber(1));
  std::vector<std::byte> bytes;
  ASSERT_EQ(dds::EncodeCdr(EventNumber(2), &bytes), dds::BoundaryFault::kNone);
  for (std::size_t cut = 0; cut + 4 < bytes.size(); ++cut) {
    maker.AddBytes(channel, kStart, BytesView(bytes).first(cut));
  }
  WriteText(folder / "a.mcap", Text(maker.End()));
  const Outcome outcome = Export({{folder / "a.mcap"}, folder / "out", {}, "", "", false});
  EXPECT_EQ(outcome.code, ExitCode::kBadInput);
  EXPECT_THAT(outcome.err,
              HasSubstr(fmt::format("{} samples of tbm/v1/event are left out: bytes are not of "
                                    "this type",
                                    bytes.size() - 4 + 1)));
  EXPECT_EQ(Table(folder / "out/event.csv").row_count(), 1u);
}

TEST(JournalTimes, TextsAreReadAndWritten) {
  EXPECT_EQ(UtcText({1'795'442'700'250'999'999}), "2026-11-23T14:05:00.250Z");
  for (const std::string text :
       {"2026-11-23T14:05:00.250Z", "1970-01-01T00:00:00.000Z", "2024-02-29T23:59:59.999Z"}) {
    ASSERT_TRUE(UtcFromText(text)) << text;
    EXPECT_EQ(UtcText(*UtcFromText(text)), text);
  }
  EXPECT_EQ(UtcFromText("2026-11-23T14:05:00Z"), kStart);
  EXPECT_EQ(UtcFromText("2026-11-23T14:05:00.000000001Z"), kStart + Duration(1));
  EXPECT_EQ(UtcFromText("1795442700000000000"), kStart);
  for (const std::string text : {"",
                                 "Z",
                                 "2026-11-23",
                                 "2026-11-23T14:05:00",
                                 "2026-13-23T14:05:00Z",
                                 "2026-02-29T14:05:00Z",
                                 "2026-11-23T24:05:00Z",
                                 "2026-11-23T14:05:60Z",
                                 "2026-11-23T14:05:00.Z",
                                 "2026-11-23T14:05:00.1234567890Z",
                                 "2026-11-23 14:05:00Z",
                                 "2026-11-23T14:05:00Z ",
                                 "99999999999999999999",
                                 "1969-12-31T23:59:59Z",
                                 "1.5"}) {
    EXPECT_FALSE(UtcFromText(text)) << text;
  }
}

}  // namespace
}  // namespace tbm
