#include "devices/gsi/gsi.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include <fmt/format.h>

namespace tbm {
namespace {

constexpr std::size_t kHeadChars = 7;  // index, info, unit, sign
constexpr double kMPerFoot = 0.3048;

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

// 11 and 41..49 and 71..79 count blocks or remarks in the characters after the index; elsewhere a
// third digit belongs to the index (531, 560).
int IndexOf(std::string_view head) {
  const int two = (head[0] - '0') * 10 + (head[1] - '0');
  const bool has_own_info = two == 11 || (two >= 41 && two <= 49) || (two >= 71 && two <= 79);
  if (has_own_info || !IsDigit(head[2])) return two;
  return two * 10 + (head[2] - '0');
}

bool StartsWord(std::string_view rest) {
  return rest.size() >= kHeadChars && IsDigit(rest[0]) && IsDigit(rest[1]) &&
         (rest[6] == '+' || rest[6] == '-');
}

// How many data characters the word at the start of `rest` has: those of its block, unless only the
// other format ends where a blank or the line's end is.
std::size_t DataChars(std::string_view rest, bool is_gsi16) {
  const auto ends_well = [&](std::size_t count) {
    const std::size_t end = kHeadChars + count;
    if (rest.size() <= end) return rest.size() == end;
    return rest[end] == ' ' && (rest.find_first_not_of(' ', end) == std::string_view::npos ||
                                StartsWord(rest.substr(rest.find_first_not_of(' ', end))));
  };
  const std::size_t own = is_gsi16 ? 16 : 8;
  const std::size_t other = is_gsi16 ? 8 : 16;
  if (ends_well(own)) return own;
  return ends_well(other) ? other : 0;
}

std::string_view TrimmedRight(std::string_view text) {
  while (text.ends_with(' ')) text.remove_suffix(1);
  return text;
}

// The data as an integer without sign; blanks in front count as zeros.
std::optional<std::int64_t> Digits(const GsiWord& word) {
  std::string_view data = word.data;
  while (data.starts_with(' ')) data.remove_prefix(1);
  if (data.empty() || !std::all_of(data.begin(), data.end(), IsDigit)) return std::nullopt;
  std::int64_t value = 0;
  for (const char digit : data) value = value * 10 + (digit - '0');  // 16 digits fit
  return value;
}

double Signed(const GsiWord& word, double size) { return word.is_negative ? -size : size; }

FileFault WordFault(const GsiBlock& block,
                    const std::string& file,
                    const GsiWord& word,
                    bool angle) {
  return {
      file,
      block.line,
      "",
      fmt::format("word {} at character {}: unit {} with data {} is no {}; units 0, 1, 6, 7, 8 are "
                  "lengths and 2, 3, 4, 5 angles",
                  word.index,
                  word.position,
                  Quoted({&word.unit, 1}),
                  Quoted(word.data),
                  angle ? "angle" : "length")};
}

// Collects the first fault, so that a point can be read line by line without a ladder of ifs.
class BlockReader {
 public:
  BlockReader(const GsiBlock& block, const std::string& file) : block_(block), file_(file) {}

  double Length(int index) {
    const GsiWord* word = block_.Find(index);
    if (word == nullptr) return 0.0;
    const auto length_m = GsiLengthM(*word);
    if (!length_m && !fault_) fault_ = WordFault(block_, file_, *word, false);
    return length_m.value_or(0.0);
  }
  double Angle(int index) {
    const GsiWord* word = block_.Find(index);
    const auto angle_rad = GsiAngleRad(*word);
    if (!angle_rad && !fault_) fault_ = WordFault(block_, file_, *word, true);
    return angle_rad.value_or(0.0);
  }
  bool Has(int index) const { return block_.Find(index) != nullptr; }
  const std::optional<FileFault>& fault() const { return fault_; }

 private:
  const GsiBlock& block_;
  const std::string& file_;
  std::optional<FileFault> fault_;
};

}  // namespace

const GsiWord* GsiBlock::Find(int index) const {
  const auto found = std::find_if(
      words.begin(), words.end(), [&](const GsiWord& word) { return word.index == index; });
  return found == words.end() ? nullptr : &*found;
}

bool LooksLikeGsi(std::string_view text) {
  const std::size_t start = text.find_first_not_of("\r\n \t");
  if (start == std::string_view::npos) return false;
  text.remove_prefix(start);
  if (text.starts_with('*')) text.remove_prefix(1);
  return StartsWord(text);
}

Result<std::vector<GsiBlock>, FileFault> ParseGsi(std::string_view text, const std::string& file) {
  std::vector<GsiBlock> blocks;
  int number = 0;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    ++number;
    while (line.ends_with('\r') || line.ends_with(' ')) line.remove_suffix(1);
    if (line.empty()) continue;
    GsiBlock block;
    block.line = number;
    const bool is_gsi16 = line.starts_with('*');
    std::size_t at = is_gsi16 ? 1 : 0;
    while (at < line.size()) {
      const std::string_view rest = line.substr(at);
      // A point name may end in blanks that the line's end took away.
      const std::size_t whole = kHeadChars + (is_gsi16 ? 16 : 8);
      const bool is_padded = StartsWord(rest) && rest.size() < whole && IndexOf(rest) == 11;
      const std::size_t data_chars = is_padded          ? rest.size() - kHeadChars
                                     : StartsWord(rest) ? DataChars(rest, is_gsi16)
                                                        : 0;
      if (data_chars == 0) {
        return Failure{FileFault{
            file,
            number,
            "",
            fmt::format(
                "no GSI word at character {}: {}; wanted are two digits, four characters, a "
                "sign and {} data characters",
                at + 1,
                Quoted(rest.substr(0, 24)),
                is_gsi16 ? 16 : 8)}};
      }
      block.words.push_back({IndexOf(rest),
                             rest[5],
                             rest[6] == '-',
                             TrimmedRight(rest.substr(kHeadChars, data_chars)),
                             static_cast<int>(at) + 1});
      at = std::min(line.find_first_not_of(' ', at + kHeadChars + data_chars), line.size());
    }
    blocks.push_back(std::move(block));
  }
  return blocks;
}

std::optional<double> GsiLengthM(const GsiWord& word) {
  const auto digits = Digits(word);
  if (!digits) return std::nullopt;
  const auto value = static_cast<double>(*digits);
  switch (word.unit) {
    case '0':
      return Signed(word, value / 1e3);
    case '1':
      return Signed(word, value / 1e3 * kMPerFoot);
    case '6':
      return Signed(word, value / 1e4);
    case '7':
      return Signed(word, value / 1e4 * kMPerFoot);
    case '8':
      return Signed(word, value / 1e5);
    default:
      return std::nullopt;
  }
}

std::optional<double> GsiAngleRad(const GsiWord& word) {
  const auto digits = Digits(word);
  if (!digits) return std::nullopt;
  const auto value = static_cast<double>(*digits);
  constexpr double kCircle = 2.0 * std::numbers::pi;
  switch (word.unit) {
    case '2':
      return Signed(word, value / 1e5 / 400.0 * kCircle);
    case '3':
      return Signed(word, value / 1e5 / 360.0 * kCircle);
    case '4': {
      const std::int64_t tenths = *digits % 1000;
      const std::int64_t minutes = *digits / 1000 % 100;
      const std::int64_t degrees = *digits / 100000;
      if (tenths >= 600 || minutes >= 60) return std::nullopt;
      const double in_degrees = static_cast<double>(degrees) + static_cast<double>(minutes) / 60.0 +
                                static_cast<double>(tenths) / 36000.0;
      return Signed(word, in_degrees / 360.0 * kCircle);
    }
    case '5':
      return Signed(word, value / 1e4 / 6400.0 * kCircle);
    default:
      return std::nullopt;
  }
}

Result<std::optional<GsiPoint>, FileFault> PointOf(const GsiBlock& block, const std::string& file) {
  const GsiWord* name = block.Find(11);
  if (name == nullptr) return std::optional<GsiPoint>();
  BlockReader reader(block, file);
  GsiPoint point;
  point.name = WithoutLeadingZeros(name->data);
  if (reader.Has(81) && reader.Has(82) && reader.Has(83)) {
    point.east_m = reader.Length(81);
    point.north_m = reader.Length(82);
    point.height_m = reader.Length(83);
  } else if (reader.Has(21) && reader.Has(22) && reader.Has(31)) {
    const double hz_rad = reader.Angle(21);
    const double zenith_rad = reader.Angle(22);
    const double slope_m = reader.Length(31);
    point.east_m = reader.Length(84) + slope_m * std::sin(zenith_rad) * std::sin(hz_rad);
    point.north_m = reader.Length(85) + slope_m * std::sin(zenith_rad) * std::cos(hz_rad);
    point.height_m =
        reader.Length(86) + slope_m * std::cos(zenith_rad) + reader.Length(88) - reader.Length(87);
    // A sight that failed is stored with distance zero.
    if (slope_m == 0.0 && !reader.fault()) return std::optional<GsiPoint>();
  } else {
    return std::optional<GsiPoint>();
  }
  if (reader.fault()) return Failure{*reader.fault()};
  return std::optional<GsiPoint>(std::move(point));
}

std::string_view WithoutLeadingZeros(std::string_view name) {
  const std::size_t start = name.find_first_not_of('0');
  if (start == std::string_view::npos) return name.empty() ? name : name.substr(name.size() - 1);
  return name.substr(start);
}

}  // namespace tbm
