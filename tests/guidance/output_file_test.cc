#include "guidance/app/output_file.h"

#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temp_folder.h"

namespace tbm {
namespace {

using test::ReadText;
using test::TempFolder;
using test::WriteText;
using ::testing::HasSubstr;

std::size_t FilesIn(const TempFolder& folder) {
  const std::filesystem::directory_iterator files(folder.path());
  return static_cast<std::size_t>(std::distance(begin(files), end(files)));
}

TEST(OutputFile, AppearsUnderItsNameAndLeavesNothingElse) {
  const TempFolder folder;
  const OutputFile file(folder / "out.csv", false);
  EXPECT_EQ(file.Obstacle(), std::nullopt);
  EXPECT_EQ(file.Write("hello\n"), std::nullopt);
  EXPECT_EQ(ReadText(folder / "out.csv"), "hello\n");
  EXPECT_EQ(FilesIn(folder), 1u);
}

TEST(OutputFile, NeverReplacesUnlessAllowed) {
  const TempFolder folder;
  WriteText(folder / "out.csv", "mine");
  const OutputFile careful(folder / "out.csv", false);
  ASSERT_TRUE(careful.Obstacle().has_value());
  EXPECT_THAT(*careful.Obstacle(), HasSubstr("--force"));
  EXPECT_TRUE(careful.Write("new").has_value())
      << "also when the file came after the first question";
  EXPECT_EQ(ReadText(folder / "out.csv"), "mine");
  const OutputFile forced(folder / "out.csv", true);
  EXPECT_EQ(forced.Obstacle(), std::nullopt);
  EXPECT_EQ(forced.Write("new"), std::nullopt);
  EXPECT_EQ(ReadText(folder / "out.csv"), "new");
  EXPECT_EQ(FilesIn(folder), 1u);
}

TEST(OutputFile, DoesNotReplaceALinkToNowhere) {
  const TempFolder folder;
  std::filesystem::create_symlink(folder / "absent", folder / "out.csv");
  EXPECT_TRUE(OutputFile(folder / "out.csv", false).Obstacle().has_value());
}

TEST(OutputFile, SaysWhyBeforeLongWork) {
  const TempFolder folder;
  EXPECT_THAT(*OutputFile(folder / "absent/out.csv", false).Obstacle(),
              HasSubstr("does not exist"));
  EXPECT_THAT(*OutputFile(folder.path(), true).Obstacle(), HasSubstr("is a folder"));
  EXPECT_THAT(*OutputFile("", true).Obstacle(), HasSubstr("needs a file name"));
}

}  // namespace
}  // namespace tbm
