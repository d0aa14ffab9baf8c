#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "pose/base/time.h"

namespace tbm {

// A CSV table whose columns are those that its rows name, in the order in which they appear. It is
// told every row twice: first to find the columns, then to write them. What a row does not name is
// an empty cell, and so is what is nothing: NaN, a time that never was, an index of nothing.
class JournalTable {
 public:
  // One cell. Two with the same name in one row: the second gets "_2" behind its name.
  void Text(std::string_view prefix, std::string_view name, std::string_view text);
  void Number(std::string_view prefix, std::string_view name, double number);
  void Whole(std::string_view prefix, std::string_view name, std::int64_t number);
  void Count(std::string_view prefix, std::string_view name, std::uint64_t number);
  void EndRow();

  // From here on rows are written.
  void BeginWriting();
  // Lines that are complete: the header first. They are the caller's afterwards.
  std::string TakeLines();
  // Lines that wait to be taken.
  std::size_t waiting_bytes() const { return lines_.size(); }

  std::size_t column_count() const { return names_.size(); }
  // Names come out of messages: beyond kMostColumns cells are left out.
  static constexpr std::size_t kMostColumns = 4096;
  bool has_left_out_cells() const { return has_left_out_cells_; }

 private:
  // Empty where nothing is to be written.
  std::string* Cell(std::string_view prefix, std::string_view name);
  // kMostColumns when there is none to be had.
  std::size_t ColumnOf(std::string_view prefix, std::string_view name);
  bool IsFree(std::size_t column) const { return row_of_column_[column] != row_; }

  std::vector<std::string> names_;
  std::unordered_map<std::string, std::size_t> column_of_name_;
  std::vector<std::uint64_t> row_of_column_;  // the last row that named it
  std::vector<std::size_t> order_;            // columns in the order of the last row
  std::size_t place_ = 0;                     // in order_
  std::uint64_t row_ = 1;
  bool is_writing_ = false;
  bool has_left_out_cells_ = false;
  std::vector<std::string> cells_;
  std::string lines_;
};

// Cells of one row whose names begin alike.
class JournalRow {
 public:
  explicit JournalRow(JournalTable& table, std::string prefix = {})
      : table_(table), prefix_(std::move(prefix)) {}

  void Text(std::string_view name, std::string_view text) { table_.Text(prefix_, name, text); }
  void Number(std::string_view name, double number) { table_.Number(prefix_, name, number); }
  void Count(std::string_view name, std::uint64_t number) { table_.Count(prefix_, name, number); }
  void Whole(std::string_view name, std::int64_t number) { table_.Whole(prefix_, name, number); }
  void Flag(std::string_view name, bool flag) { table_.Whole(prefix_, name, flag ? 1 : 0); }
  // What is nothing when it is -1: an index, a time.
  void Index(std::string_view name, std::int64_t number) {
    number == -1 ? table_.Text(prefix_, name, {}) : table_.Whole(prefix_, name, number);
  }
  void Time(std::string_view name, Timestamp time) { Index(name, time.ns); }
  JournalRow Part(std::string_view prefix) const {
    return JournalRow(table_, prefix_ + std::string(prefix));
  }

 private:
  JournalTable& table_;
  std::string prefix_;
};

}  // namespace tbm
