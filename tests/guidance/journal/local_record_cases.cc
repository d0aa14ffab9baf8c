// What a step of the guidance rests on, beside the topics.
#include <cstring>
#include <random>

#include <gtest/gtest.h>

#include "guidance/journal/local_record.h"
namespace tbm {
namespace {

const StepRecord kStep{{1'700'000'000'123'456'789}, 42};
FileRecord AFile() { return {"axis", "site/axis.xml", std::string("a\0b\xFF", 4) + "tail"}; }

TEST(LocalRecord, ComesBackAsItWas) {
  EXPECT_EQ(StepFrom(Encoded(kStep)), kStep);
  EXPECT_EQ(FileFrom(Encoded(AFile())), AFile());
  EXPECT_EQ(FileFrom(Encoded(FileRecord{"rig", "", ""})), (FileRecord{"rig", "", ""}));
}

// CDR aligns a sequence's length to four bytes and counts a string's closing zero.
TEST(LocalRecord, HasTheBytesThatItsSchemaPromises) {
  const Bytes bytes = Encoded(FileRecord{"rig", "r", "xy"});
  const unsigned char expected[] = {0, 1, 0, 0,   4, 0, 0, 0, 'r', 'i', 'g', 0,   2,
                                    0, 0, 0, 'r', 0, 0, 0, 2, 0,   0,   0,   'x', 'y'};
  ASSERT_EQ(bytes.size(), sizeof expected);
  EXPECT_EQ(std::memcmp(bytes.data(), expected, sizeof expected), 0);
  EXPECT_NE(FileSchema().text.find("sequence<octet> content"), std::string::npos);
  EXPECT_EQ(StepSchema().encoding, "omgidl");
}

TEST(LocalRecord, CutAndGluedBytesAreNoRecord) {
  const Bytes step = Encoded(kStep);
  const Bytes file = Encoded(AFile());
  for (std::size_t size = 0; size < step.size(); ++size) {
    EXPECT_FALSE(StepFrom(BytesView(step).first(size)));
  }
  for (std::size_t size = 0; size < file.size(); ++size) {
    EXPECT_FALSE(FileFrom(BytesView(file).first(size)));
  }
  Bytes glued = step;
  glued.insert(glued.end(), step.begin(), step.end());
  EXPECT_FALSE(StepFrom(glued));
  EXPECT_FALSE(StepFrom(file));
  EXPECT_FALSE(FileFrom(step));
  EXPECT_FALSE(StepFrom(Encoded(StepRecord{{0}, 1})));
  EXPECT_FALSE(StepFrom(Encoded(StepRecord{{5}, 0})));
}

TEST(LocalRecord, FlippedBytesAreRefusedOrSayWhatTheySay) {
  const Bytes file = Encoded(AFile());
  for (std::size_t bit = 0; bit < 8 * file.size(); ++bit) {
    Bytes flipped = file;
    flipped[bit / 8] ^= static_cast<std::byte>(1u << (bit % 8));
    const auto record = FileFrom(flipped);
    if (record) {
      EXPECT_EQ(FileFrom(Encoded(*record)), record);
    }
  }
  std::minstd_rand random(20261123);
  for (int draw = 0; draw < 2000; ++draw) {
    Bytes bytes(random() % 60);
    for (std::byte& byte : bytes) byte = static_cast<std::byte>(random() % 4);
    StepFrom(bytes);
    FileFrom(bytes);
  }
}

}  // namespace
}  // namespace tbm
