#pragma once

#include <string>
#include <string_view>

namespace tbm {

// A text as a field of a CSV line: in quotes when it would not be one otherwise.
inline std::string CsvField(std::string_view text) {
  if (text.find_first_of(",\"\r\n") == std::string_view::npos) return std::string(text);
  std::string field = "\"";
  for (const char c : text) {
    field += c;
    if (c == '"') field += c;
  }
  return field + "\"";
}

}  // namespace tbm
