#include "devices/replay/csv.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <set>
#include <sstream>

#include <fmt/format.h>

#include "pose/base/parse_number.h"

namespace tbm {
namespace {

std::string JoinNames(std::span<const std::string_view> names) {
  std::string joined;
  for (const std::string_view name : names)
    joined += (joined.empty() ? "" : ",") + std::string(name);
  return joined;
}

}  // namespace

std::string FileFault::Text() const {
  std::string text = file;
  if (line > 0) text += fmt::format(":{}", line);
  if (!column.empty()) text += ": column " + column;
  return text + ": " + what;
}

std::string Quoted(std::string_view text) {
  constexpr std::size_t kLongest = 40;
  std::string quoted = "'";
  for (const char c : text.substr(0, kLongest)) {
    const auto byte = static_cast<unsigned char>(c);
    quoted += byte < 0x20 || byte == 0x7f ? '?' : c;
  }
  return quoted + (text.size() > kLongest ? "..'" : "'");
}

Result<CsvTable, FileFault> CsvTable::Parse(std::string text,
                                            const std::string& file,
                                            std::span<const std::string_view> required) {
  CsvTable table;
  table.file_ = file;
  table.text_.assign(text.begin(), text.end());
  std::string_view rest(table.text_.data(), table.text_.size());
  if (rest.starts_with("\xEF\xBB\xBF")) rest.remove_prefix(3);
  table.last_line_is_open_ = !rest.empty() && rest.back() != '\n';
  while (rest.ends_with("\n") || rest.ends_with("\r")) rest.remove_suffix(1);
  if (rest.empty()) {
    return Failure{FileFault{
        file, 0, "", fmt::format("is empty; the first line must be {}", JoinNames(required))}};
  }
  int number = 0;
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    std::string_view line = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    if (line.ends_with('\r')) line.remove_suffix(1);
    ++number;
    if (auto fault = table.SplitLine(line, number)) return Failure{std::move(*fault)};
    if (number == 1) {
      if (auto fault = table.CheckHeader(required)) return Failure{std::move(*fault)};
    }
  }
  return table;
}

// Appends the fields of one line; the header's become columns_ afterwards.
std::optional<FileFault> CsvTable::SplitLine(std::string_view line, int number) {
  const std::size_t first = fields_.size();
  std::size_t at = 0;
  while (true) {
    if (at < line.size() && line[at] == '"') {
      std::string field;
      for (++at; at < line.size(); ++at) {
        if (line[at] != '"') {
          field += line[at];
        } else if (at + 1 < line.size() && line[at + 1] == '"') {
          field += line[at++];
        } else {
          break;
        }
      }
      if (at >= line.size() || (at + 1 < line.size() && line[at + 1] != ',')) {
        return FileFault{
            file_, number, "", "a quoted field must end with '\"' before the next comma"};
      }
      ++at;
      fields_.push_back(unquoted_.emplace_back(std::move(field)));
    } else {
      const std::size_t end = std::min(line.find(',', at), line.size());
      fields_.push_back(line.substr(at, end - at));
      at = end;
    }
    if (at >= line.size()) break;
    ++at;
  }
  const std::size_t count = fields_.size() - first;
  if (number > 1) {
    if (count != columns_.size()) {
      return FileFault{file_,
                       number,
                       "",
                       fmt::format("has {} fields; the header has {}", count, columns_.size())};
    }
    line_of_row_.push_back(number);
  }
  return std::nullopt;
}

std::optional<FileFault> CsvTable::CheckHeader(std::span<const std::string_view> required) {
  columns_.assign(fields_.begin(), fields_.end());
  fields_.clear();
  for (const std::string_view name : required) {
    const auto count = std::count(columns_.begin(), columns_.end(), name);
    if (count == 1) continue;
    if (count > 1)
      return FileFault{file_, 1, std::string(name), "stands twice in the header; keep one"};
    std::string what = fmt::format("is missing; the header must hold {}", JoinNames(required));
    if (columns_.size() == 1 && columns_[0].find(';') != std::string::npos) {
      what += "; fields must be separated by ',' and numbers written with '.', not ';' and ','";
    }
    return FileFault{file_, 1, std::string(name), what};
  }
  return std::nullopt;
}

std::optional<std::size_t> CsvTable::Column(std::string_view name) const {
  const auto found = std::find(columns_.begin(), columns_.end(), name);
  if (found == columns_.end()) return std::nullopt;
  return static_cast<std::size_t>(found - columns_.begin());
}

void CsvTable::DropLastRow() {
  TBM_CHECK(!line_of_row_.empty());
  line_of_row_.pop_back();
  fields_.resize(fields_.size() - columns_.size());
}

FileFault CsvTable::FaultAt(std::size_t row, std::size_t column, std::string what) const {
  return {file_, line(row), columns_[column], std::move(what)};
}

Result<double, FileFault> CsvTable::Real(std::size_t row, std::size_t column) const {
  const std::string_view field = Field(row, column);
  if (const auto number = ParseReal(field)) return *number;
  return Failure{FaultAt(
      row, column, Quoted(field) + " is not a number; write digits with '.' as decimal mark")};
}

Result<double, FileFault> CsvTable::Finite(std::size_t row, std::size_t column) const {
  auto number = Real(row, column);
  if (number && !std::isfinite(*number)) {
    return Failure{FaultAt(row, column, Quoted(Field(row, column)) + " is not a finite number")};
  }
  return number;
}

Result<std::int64_t, FileFault> CsvTable::Integer(std::size_t row, std::size_t column) const {
  const std::string_view field = Field(row, column);
  if (const auto number = ParseInteger(field)) return *number;
  const bool is_time = columns_[column].ends_with("_ns");
  return Failure{
      FaultAt(row,
              column,
              Quoted(field) + " is not an integer" +
                  (is_time ? "; write nanoseconds UTC such as 1790000000000000000" : ""))};
}

Result<std::string, FileFault> ReadTextFile(const std::string& path, std::size_t most_bytes) {
  std::ifstream stream(path, std::ios::binary);
  if (!stream) return Failure{FileFault{path, 0, "", "cannot be opened"}};
  std::string text;
  std::vector<char> piece(1 << 16);
  while (stream.read(piece.data(), static_cast<std::streamsize>(piece.size())),
         stream.gcount() > 0) {
    text.append(piece.data(), static_cast<std::size_t>(stream.gcount()));
    if (text.size() > most_bytes) {
      return Failure{FileFault{path, 0, "", fmt::format("is larger than {} bytes", most_bytes)}};
    }
  }
  if (stream.bad()) return Failure{FileFault{path, 0, "", "cannot be read"}};
  return text;
}

}  // namespace tbm
