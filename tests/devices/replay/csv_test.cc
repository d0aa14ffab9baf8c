#include "devices/replay/csv.h"

#include <array>
#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tbm {
namespace {

using ::testing::HasSubstr;

constexpr std::array<std::string_view, 2> kColumns = {"stamp_ns", "x_mm"};

Result<CsvTable, FileFault> Parse(std::string text) {
  return CsvTable::Parse(std::move(text), "t.csv", kColumns);
}

TEST(Csv, ReadsNumbersInAnyOrderOfColumns) {
  const auto table = Parse("x_mm,note,stamp_ns\n-1.5e3,hello,1790000000000000001\n+2,,-7\n");
  ASSERT_TRUE(table.has_value());
  ASSERT_EQ(table->row_count(), 2u);
  EXPECT_EQ(*table->Finite(0, *table->Column("x_mm")), -1500.0);
  EXPECT_EQ(*table->Integer(0, *table->Column("stamp_ns")), 1790000000000000001);
  EXPECT_EQ(*table->Finite(1, *table->Column("x_mm")), 2.0);
  EXPECT_EQ(*table->Integer(1, *table->Column("stamp_ns")), -7);
  EXPECT_EQ(table->Field(0, 1), "hello");
  EXPECT_EQ(table->Field(1, 1), "");
  EXPECT_EQ(table->line(1), 3);
  EXPECT_FALSE(table->Column("absent").has_value());
}

TEST(Csv, TakesWhatSpreadsheetsAdd) {
  const auto table =
      Parse("\xEF\xBB\xBFstamp_ns,x_mm,note\r\n1,\"2.5\",\"a, \"\"b\"\"\"\r\n\r\n\n");
  ASSERT_TRUE(table.has_value());
  ASSERT_EQ(table->row_count(), 1u);
  EXPECT_EQ(*table->Finite(0, 1), 2.5);
  EXPECT_EQ(table->Field(0, 2), "a, \"b\"");
}

TEST(Csv, KeepsFieldsWhenTheTableMoves) {
  auto parsed = Parse("stamp_ns,x_mm\n1,2\n\"3\",4\n");
  ASSERT_TRUE(parsed.has_value());
  const CsvTable first = std::move(parsed).value();
  const CsvTable moved = std::move(const_cast<CsvTable&>(first));
  EXPECT_EQ(moved.Field(0, 0), "1");
  EXPECT_EQ(moved.Field(1, 0), "3");
}

TEST(Csv, NamesFileLineAndColumn) {
  const auto table = Parse("stamp_ns,x_mm\n1,2\n2,abc\n");
  ASSERT_TRUE(table.has_value());
  const auto number = table->Finite(1, 1);
  ASSERT_FALSE(number.has_value());
  EXPECT_THAT(number.error().Text(), HasSubstr("t.csv:3: column x_mm: 'abc' is not a number"));
}

TEST(Csv, RefusesWhatIsNotQuiteANumber) {
  for (const std::string field :
       {"", " 1", "1 ", "1,", "0x10", "1.2.3", "1e", "--1", "+-1", "1e999", "١"}) {
    const auto table = Parse("stamp_ns,x_mm\n1,\"" + field + "\"\n");
    ASSERT_TRUE(table.has_value()) << field;
    EXPECT_FALSE(table->Real(0, 1).has_value()) << field;
  }
  for (const std::string field : {"1.0", "1e3", "", "9223372036854775808"}) {
    const auto table = Parse("stamp_ns,x_mm\n" + field + ",1\n");
    ASSERT_TRUE(table.has_value()) << field;
    EXPECT_FALSE(table->Integer(0, 0).has_value()) << field;
  }
}

TEST(Csv, TellsNotFiniteFromNotANumber) {
  const auto table = Parse("stamp_ns,x_mm\n1,nan\n2,-inf\n");
  ASSERT_TRUE(table.has_value());
  EXPECT_TRUE(std::isnan(*table->Real(0, 1)));
  EXPECT_TRUE(std::isinf(*table->Real(1, 1)));
  EXPECT_FALSE(table->Finite(0, 1).has_value());
  EXPECT_THAT(table->Finite(1, 1).error().Text(), HasSubstr("t.csv:3: column x_mm"));
}

TEST(Csv, SaysThatSemicolonsAreWrong) {
  const auto table = Parse("stamp_ns;x_mm\n1;2,5\n");
  ASSERT_FALSE(table.has_value());
  EXPECT_THAT(table.error().what, HasSubstr("separated by ','"));
}

TEST(Csv, KnowsWhetherTheLastLineEnded) {
  EXPECT_FALSE(Parse("stamp_ns,x_mm\n1,2\n")->last_line_is_open());
  EXPECT_TRUE(Parse("stamp_ns,x_mm\n1,2")->last_line_is_open());
}

TEST(Csv, ShortensWhatItQuotes) {
  EXPECT_EQ(Quoted("a\nb\x1b[2J"), "'a?b?[2J'");
  EXPECT_EQ(Quoted(std::string(1000, 'x')).size(), 40u + 4u);
}

}  // namespace
}  // namespace tbm
