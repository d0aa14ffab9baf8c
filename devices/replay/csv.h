#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pose/base/result.h"

namespace tbm {

// What is wrong in a file and where, for the one who has to mend it.
struct FileFault {
  std::string file;
  int line = 0;        // 1 is the first; 0 when the file as a whole is meant
  std::string column;  // or key; empty when none is meant
  std::string what;    // what is wrong, and what would be right

  // "tilt.csv:12: column beta_deg: 'abc' is not a number; .."
  std::string Text() const;
};
using FileFaults = std::vector<FileFault>;

// Text out of a file in a message: without control characters, at most 40 characters.
std::string Quoted(std::string_view text);

// A CSV table as FORMATS defines it: comma, header row, LF. Strict where a mistake would change
// numbers, lenient where spreadsheet programs add something harmless: a byte order mark, CR before
// LF, fields in "quotes", empty lines at the end, more columns than were asked for.
class CsvTable {
 public:
  // `required` columns must stand in the header, in any order. Errors: the first fault found.
  static Result<CsvTable, FileFault> Parse(std::string text,
                                           const std::string& file,
                                           std::span<const std::string_view> required);
  CsvTable(CsvTable&&) noexcept = default;
  CsvTable& operator=(CsvTable&&) noexcept = default;

  std::size_t row_count() const { return line_of_row_.size(); }
  int line(std::size_t row) const { return line_of_row_[row]; }
  const std::vector<std::string>& columns() const { return columns_; }
  std::optional<std::size_t> Column(std::string_view name) const;
  std::string_view Field(std::size_t row, std::size_t column) const {
    return fields_[row * columns_.size() + column];
  }
  // The file does not end with LF: its last line may be cut short.
  bool last_line_is_open() const { return last_line_is_open_; }
  void DropLastRow();

  // Errors name file, line and column and say what would be right.
  Result<double, FileFault> Real(std::size_t row, std::size_t column) const;    // nan, inf allowed
  Result<double, FileFault> Finite(std::size_t row, std::size_t column) const;  // not here
  Result<std::int64_t, FileFault> Integer(std::size_t row, std::size_t column) const;
  FileFault FaultAt(std::size_t row, std::size_t column, std::string what) const;

 private:
  CsvTable() = default;
  std::optional<FileFault> SplitLine(std::string_view line, int number);
  std::optional<FileFault> CheckHeader(std::span<const std::string_view> required);

  std::string file_;
  std::vector<char> text_;            // keeps its place in memory when the table moves
  std::deque<std::string> unquoted_;  // fields whose text does not stand in text_ as it is
  std::vector<std::string> columns_;
  std::vector<std::string_view> fields_;
  std::vector<int> line_of_row_;
  bool last_line_is_open_ = false;
};

// A text file whole. Errors: cannot be opened, cannot be read, larger than `most_bytes`.
Result<std::string, FileFault> ReadTextFile(const std::string& path,
                                            std::size_t most_bytes = std::size_t{1} << 30);

}  // namespace tbm
