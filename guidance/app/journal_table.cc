#include "guidance/app/journal_table.h"

#include <cmath>
#include <iterator>
#include <utility>

#include <fmt/format.h>

#include "guidance/app/csv_field.h"

namespace tbm {
namespace {

bool IsJoined(const std::string& whole, std::string_view prefix, std::string_view name) {
  return whole.size() == prefix.size() + name.size() && whole.starts_with(prefix) &&
         whole.ends_with(name);
}

// A line of the table is a line of the file: what would break it becomes a space.
std::string OneLine(std::string_view text) {
  std::string line(text);
  for (char& c : line) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte == 0x7f) c = ' ';
  }
  return line;
}

}  // namespace

std::size_t JournalTable::ColumnOf(std::string_view prefix, std::string_view name) {
  // Nearly always the row has the same cells as the one before.
  if (place_ < order_.size()) {
    const std::size_t column = order_[place_];
    if (IsFree(column) && IsJoined(names_[column], prefix, name)) return column;
  }
  std::string wanted = std::string(prefix) + std::string(name);
  for (int again = 2;; ++again) {
    const auto known = column_of_name_.find(wanted);
    if (known == column_of_name_.end()) {
      if (is_writing_ || names_.size() == kMostColumns) return kMostColumns;
      column_of_name_.emplace(wanted, names_.size());
      names_.push_back(wanted);
      row_of_column_.push_back(0);
      return names_.size() - 1;
    }
    if (IsFree(known->second)) return known->second;
    wanted = fmt::format("{}{}_{}", prefix, name, again);
  }
}

std::string* JournalTable::Cell(std::string_view prefix, std::string_view name) {
  const std::size_t column = ColumnOf(prefix, name);
  if (column == kMostColumns) {
    has_left_out_cells_ = true;
    return nullptr;
  }
  row_of_column_[column] = row_;
  if (place_ < order_.size()) {
    order_[place_] = column;
  } else {
    order_.push_back(column);
  }
  ++place_;
  if (!is_writing_) return nullptr;
  return &cells_[column];
}

void JournalTable::Text(std::string_view prefix, std::string_view name, std::string_view text) {
  if (std::string* cell = Cell(prefix, name)) *cell = CsvField(OneLine(text));
}

void JournalTable::Number(std::string_view prefix, std::string_view name, double number) {
  std::string* cell = Cell(prefix, name);
  if (cell != nullptr && !std::isnan(number))
    fmt::format_to(std::back_inserter(*cell), "{}", number);
}

void JournalTable::Whole(std::string_view prefix, std::string_view name, std::int64_t number) {
  if (std::string* cell = Cell(prefix, name))
    fmt::format_to(std::back_inserter(*cell), "{}", number);
}

void JournalTable::Count(std::string_view prefix, std::string_view name, std::uint64_t number) {
  if (std::string* cell = Cell(prefix, name))
    fmt::format_to(std::back_inserter(*cell), "{}", number);
}

void JournalTable::EndRow() {
  ++row_;
  place_ = 0;
  if (!is_writing_) return;
  for (std::size_t column = 0; column < cells_.size(); ++column) {
    if (column > 0) lines_ += ',';
    lines_ += cells_[column];
    cells_[column].clear();
  }
  lines_ += '\n';
}

void JournalTable::BeginWriting() {
  is_writing_ = true;
  cells_.resize(names_.size());
  for (std::size_t column = 0; column < names_.size(); ++column) {
    if (column > 0) lines_ += ',';
    lines_ += CsvField(OneLine(names_[column]));
  }
  lines_ += '\n';
}

std::string JournalTable::TakeLines() { return std::exchange(lines_, {}); }

}  // namespace tbm
