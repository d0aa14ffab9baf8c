#include "guidance/rail_vision/target_mark.h"

#include <charconv>
#include <cmath>
#include <optional>
#include <vector>

namespace tbm {
namespace {

constexpr int kCodes = 50;

std::vector<std::string_view> Parts(std::string_view text, char between) {
  std::vector<std::string_view> parts;
  for (;;) {
    const std::size_t at = text.find(between);
    parts.push_back(text.substr(0, at));
    if (at == std::string_view::npos) return parts;
    text.remove_prefix(at + 1);
  }
}

template <class Number>
std::optional<Number> NumberOf(std::string_view text) {
  Number number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || end != text.data() + text.size()) return {};
  return number;
}

Result<TargetMark, TargetMarkFault> BoardPoint(const std::vector<std::string_view>& parts) {
  constexpr int kLeast = 3;
  constexpr int kMost = 64;
  TargetMark mark;
  mark.kind = TargetKind::kBoard;
  mark.board = std::string(parts[1]);
  const auto sides = Parts(parts[2], 'x');
  const auto point = NumberOf<int>(parts[3]);
  if (mark.board.empty() || sides.size() != 2 || !point) return Failure{TargetMarkFault::kBoard};
  mark.columns = NumberOf<int>(sides[0]).value_or(0);
  mark.rows = NumberOf<int>(sides[1]).value_or(0);
  mark.point = *point;
  for (const int side : {mark.columns, mark.rows}) {
    if (side < kLeast || side > kMost) return Failure{TargetMarkFault::kBoard};
  }
  // Turned by a quarter a square one has its points elsewhere, and looks as before.
  if (mark.columns == mark.rows) return Failure{TargetMarkFault::kBoard};
  if (mark.point < 0 || mark.point >= mark.columns * mark.rows) {
    return Failure{TargetMarkFault::kBoard};
  }
  return mark;
}

}  // namespace

const char* Advice(TargetMarkFault fault) {
  switch (fault) {
    case TargetMarkFault::kForm:
      return "must be led, circle:DIAMETER_MM, coded:NUMBER or board:NAME:COLUMNSxROWS:POINT";
    case TargetMarkFault::kDiameter:
      return "a circle's diameter is a number of mm from 1 to 10000, e.g. circle:50";
    case TargetMarkFault::kCode:
      return "a coded target has a number from 0 to 49 of ArUco's dictionary 4x4_50, e.g. coded:7";
    case TargetMarkFault::kBoard:
      return "a board has a name, 3 to 64 inner corners along each side, and a point counted from "
             "0 "
             "row by row, e.g. board:A:9x6:53";
  }
  return "";
}

Result<TargetMark, TargetMarkFault> ParseTargetMark(std::string_view text) {
  const auto parts = Parts(text, ':');
  TargetMark mark;
  if (parts.size() == 1 && parts[0] == "led") return mark;
  if (parts.size() == 2 && parts[0] == "circle") {
    const auto mm = NumberOf<double>(parts[1]);
    if (!mm || !(*mm >= 1.0 && *mm <= 10'000.0)) return Failure{TargetMarkFault::kDiameter};
    mark.kind = TargetKind::kCircle;
    mark.diameter_m = 1e-3 * *mm;
    return mark;
  }
  if (parts.size() == 2 && parts[0] == "coded") {
    const auto code = NumberOf<int>(parts[1]);
    if (!code || *code < 0 || *code >= kCodes) return Failure{TargetMarkFault::kCode};
    mark.kind = TargetKind::kCoded;
    mark.code = *code;
    return mark;
  }
  if (parts.size() == 4 && parts[0] == "board") return BoardPoint(parts);
  return Failure{TargetMarkFault::kForm};
}

}  // namespace tbm
