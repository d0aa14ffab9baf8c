#include <cstring>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "guidance/journal/mcap_reader.h"
#include "guidance/journal/mcap_writer.h"

namespace tbm {
namespace {

BytesView View(const std::string& text) { return std::as_bytes(std::span(text)); }
std::string Text(BytesView bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

struct Journal {
  Bytes bytes;
  std::vector<std::size_t> chunk_ends;  // bytes handed out after each chunk
};

void Append(Journal& journal, const Bytes& more) {
  journal.bytes.insert(journal.bytes.end(), more.begin(), more.end());
}

// Two topics, `chunks` chunks of three messages: "pose 1.0", "pose 1.1" and "tilt 1".
Journal Write(int chunks, bool close = true) {
  Journal journal;
  McapWriter writer("journal_test 1");
  Append(journal, writer.Begin());
  const auto poses =
      writer.AddChannel("tbm/v1/pose", "cdr", {"tbm::v1::Pose", "omgidl", "struct Pose {};"});
  const auto tilts =
      writer.AddChannel("tbm/v1/tilt", "cdr", {"tbm::v1::Tilt", "omgidl", "struct Tilt {};"});
  std::uint32_t number = 0;
  for (int chunk = 0; chunk < chunks; ++chunk) {
    for (int i = 0; i < 2; ++i) {
      const std::string text = "pose " + std::to_string(chunk) + "." + std::to_string(i);
      ++number;
      writer.AddMessage(poses, number, {1000 + number}, {900 + number}, View(text));
    }
    writer.AddMessage(
        tilts, 7, {1000 + number}, {900 + number}, View("tilt " + std::to_string(chunk)));
    Append(journal, writer.TakeChunk());
    journal.chunk_ends.push_back(journal.bytes.size());
  }
  if (close) Append(journal, writer.End());
  return journal;
}

struct Seen {
  McapContent content;
  std::vector<std::string> messages;  // "topic: text"
};

Seen Read(BytesView bytes) {
  Seen seen;
  auto content = ReadMcap(bytes, [&](const McapChannel& channel, const McapMessage& message) {
    seen.messages.push_back(channel.topic + ": " + Text(message.data));
  });
  EXPECT_TRUE(content);
  if (content) seen.content = *content;
  return seen;
}

std::vector<std::string> Expected(int chunks) {
  std::vector<std::string> messages;
  for (int chunk = 0; chunk < chunks; ++chunk) {
    messages.push_back("tbm/v1/pose: pose " + std::to_string(chunk) + ".0");
    messages.push_back("tbm/v1/pose: pose " + std::to_string(chunk) + ".1");
    messages.push_back("tbm/v1/tilt: tilt " + std::to_string(chunk));
  }
  return messages;
}

TEST(Mcap, WhatWasWrittenIsRead) {
  const Seen seen = Read(Write(3).bytes);
  EXPECT_EQ(seen.messages, Expected(3));
  EXPECT_TRUE(seen.content.has_footer);
  EXPECT_TRUE(seen.content.damages.empty());
  EXPECT_EQ(seen.content.chunks, 3u);
  EXPECT_EQ(seen.content.messages, 9u);
  ASSERT_EQ(seen.content.channels.size(), 2u);
  const McapChannel& channel = seen.content.channels.at(1);
  EXPECT_EQ(channel.message_encoding, "cdr");
  EXPECT_EQ(channel.schema.name, "tbm::v1::Pose");
  EXPECT_EQ(channel.schema.encoding, "omgidl");
  EXPECT_EQ(channel.schema.text, "struct Pose {};");
}

TEST(Mcap, EveryFieldOfAMessageHasItsPlace) {
  const Journal journal = Write(1);
  std::vector<McapMessage> messages;
  (void)ReadMcap(journal.bytes,
                 [&](const McapChannel&, const McapMessage& m) { messages.push_back(m); });
  ASSERT_EQ(messages.size(), 3u);
  EXPECT_EQ(messages[1].channel, 1);
  EXPECT_EQ(messages[1].sequence, 2u);
  EXPECT_EQ(messages[1].log_time, (Timestamp{1002}));
  EXPECT_EQ(messages[1].publish_time, (Timestamp{902}));
  EXPECT_EQ(messages[2].channel, 2);
  EXPECT_EQ(messages[2].sequence, 7u);
}

// The format's own example of bytes: magic, then the header record with two texts.
TEST(Mcap, BeginsAsTheSpecificationSays) {
  McapWriter writer("ab");
  const Bytes bytes = writer.Begin();
  const std::string expected("\x89MCAP0\r\n\x01\x0a\0\0\0\0\0\0\0\0\0\0\0\x02\0\0\0ab", 27);
  EXPECT_EQ(Text(bytes), expected);
}

TEST(Mcap, CutAnywhereNothingBeforeIsLost) {
  const Journal journal = Write(3);
  for (std::size_t cut = mcap::kMagic.size(); cut < journal.bytes.size(); ++cut) {
    const Seen seen = Read(BytesView(journal.bytes).first(cut));
    int whole = 0;
    for (const std::size_t end : journal.chunk_ends) whole += end <= cut;
    const std::vector<std::string> least = Expected(whole);
    ASSERT_GE(seen.messages.size(), least.size()) << cut;
    // The chunk's own record can be whole before its index is.
    const std::vector<std::string> most = Expected(3);
    ASSERT_LE(seen.messages.size(), 3u * static_cast<unsigned>(std::min(whole + 1, 3))) << cut;
    EXPECT_TRUE(std::equal(seen.messages.begin(), seen.messages.end(), most.begin())) << cut;
    EXPECT_EQ(seen.content.has_footer, cut >= journal.bytes.size() - mcap::kMagic.size()) << cut;
  }
}

TEST(Mcap, WithoutItsEndAllIsReadAndItIsSaid) {
  const Seen seen = Read(Write(2, false).bytes);
  EXPECT_EQ(seen.messages, Expected(2));
  EXPECT_FALSE(seen.content.has_footer);
  EXPECT_TRUE(seen.content.damages.empty());
}

// Any bit of a middle chunk or its index: its own messages may be lost, never another's, never a
// wrong one.
TEST(Mcap, AFlippedBitCostsOneChunkAtMost) {
  const Journal journal = Write(3);
  const std::vector<std::string> all = Expected(3);
  for (std::size_t at = journal.chunk_ends[0]; at < journal.chunk_ends[1]; ++at) {
    for (int bit = 0; bit < 8; ++bit) {
      Bytes bytes = journal.bytes;
      bytes[at] ^= static_cast<std::byte>(1 << bit);
      const Seen seen = Read(bytes);
      ASSERT_TRUE(seen.messages.size() == 9 || seen.messages.size() == 6) << at << " " << bit;
      const bool lost = seen.messages.size() == 6;
      std::vector<std::string> expected = all;
      if (lost) expected.erase(expected.begin() + 3, expected.begin() + 6);
      EXPECT_EQ(seen.messages, expected) << at << " " << bit;
      EXPECT_TRUE(!lost || !seen.content.damages.empty()) << at << " " << bit;
    }
  }
}

// Schemas and channels stand once, without a CRC. The summary of a closed file knows them as well.
TEST(Mcap, ADamagedChannelCostsNothingInAClosedFile) {
  const Journal journal = Write(2);
  const std::size_t chunk_from =
      Text(journal.bytes).find("pose 0.0") - 31 - (8 + 8 + 8 + 4 + 4 + 8) - mcap::kRecordHead;
  ASSERT_EQ(journal.bytes[chunk_from], static_cast<std::byte>(mcap::Op::kChunk));
  for (std::size_t at = mcap::kMagic.size(); at < chunk_from; ++at) {
    for (int bit = 0; bit < 8; ++bit) {
      Bytes bytes = journal.bytes;
      bytes[at] ^= static_cast<std::byte>(1 << bit);
      const Seen seen = Read(bytes);
      EXPECT_EQ(seen.messages, Expected(2)) << at << " " << bit;
      EXPECT_EQ(seen.content.channels.at(1).schema.text, "struct Pose {};") << at << " " << bit;
    }
  }
}

TEST(Mcap, AChannelNeedsNoSchema) {
  McapWriter writer("x");
  Bytes bytes = writer.Begin();
  const auto channel = writer.AddChannel("local/note", "text", {});
  writer.AddMessage(channel, 1, {5}, {4}, View("hello"));
  const Bytes end = writer.End();
  bytes.insert(bytes.end(), end.begin(), end.end());
  const Seen seen = Read(bytes);
  EXPECT_EQ(seen.messages, std::vector<std::string>{"local/note: hello"});
  EXPECT_EQ(seen.content.channels.at(1).schema, McapSchema{});
  EXPECT_TRUE(seen.content.damages.empty());
}

TEST(Mcap, TwoFilesGluedGiveTheFirst) {
  Bytes glued = Write(1).bytes;
  const Bytes second = Write(2).bytes;
  glued.insert(glued.end(), second.begin(), second.end());
  EXPECT_EQ(Read(glued).messages, Expected(1));
}

TEST(Mcap, OtherBytesAreNoJournal) {
  EXPECT_EQ(ReadMcap({}, {}).error(), McapFailure::kNotMcap);
  EXPECT_EQ(ReadMcap(View("stamp_ns,file\n1,2\n"), {}).error(), McapFailure::kNotMcap);
}

TEST(Mcap, AnEmptyJournalIsWhole) {
  McapWriter writer("x");
  Bytes bytes = writer.Begin();
  const Bytes end = writer.End();
  bytes.insert(bytes.end(), end.begin(), end.end());
  const Seen seen = Read(bytes);
  EXPECT_TRUE(seen.content.has_footer);
  EXPECT_TRUE(seen.messages.empty());
}

}  // namespace
}  // namespace tbm
