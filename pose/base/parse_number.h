#pragma once

#include <charconv>
#include <cstdint>
#include <optional>
#include <string_view>

namespace tbm {

// Numbers out of files: the whole text must be the number (one leading '+' is fine, blanks are
// not),
// `.` is the decimal mark whatever the locale says. Empty when it is not a number or does not fit.
// "nan" and "inf" are numbers here; whether they are welcome is the caller's question.
template <class Number>
std::optional<Number> ParseNumber(std::string_view text) {
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  Number number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return number;
}

inline std::optional<double> ParseReal(std::string_view text) { return ParseNumber<double>(text); }
inline std::optional<std::int64_t> ParseInteger(std::string_view text) {
  return ParseNumber<std::int64_t>(text);
}

}  // namespace tbm
