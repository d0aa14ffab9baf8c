#include "guidance/app/journal_reading.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstring>
#include <filesystem>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

namespace tbm {
namespace {

constexpr std::int64_t kMostBytes = std::int64_t{1} << 34;

// Appends all of an open file to `bytes`; an errno value, 0 when done.
int ReadAll(int descriptor, Bytes& bytes) {
  constexpr std::size_t kPiece = 1 << 20;
  std::size_t size = 0;
  while (true) {
    bytes.resize(size + kPiece);
    const ssize_t count = ::read(descriptor, bytes.data() + size, kPiece);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return errno;
    size += static_cast<std::size_t>(count);
    if (count == 0) break;
  }
  bytes.resize(size);
  return 0;
}

}  // namespace

Result<Bytes, std::string> ReadJournalBytes(const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) {
    return Failure{fmt::format("{}: cannot be opened: {}", path, std::strerror(errno))};
  }
  struct stat facts = {};
  Bytes bytes;
  int error = ::fstat(descriptor, &facts) == 0 ? 0 : errno;
  if (error == 0 && S_ISDIR(facts.st_mode)) error = EISDIR;
  if (error == 0 && facts.st_size > kMostBytes) error = EFBIG;
  if (error == 0) {
    bytes.reserve(static_cast<std::size_t>(facts.st_size) + (1 << 20));
    error = ReadAll(descriptor, bytes);
  }
  ::close(descriptor);
  if (error != 0) {
    return Failure{fmt::format("{}: cannot be read: {}", path, std::strerror(error))};
  }
  return bytes;
}

std::string NoJournalText(const std::string& path, BytesView bytes) {
  const bool is_beginning = bytes.size() < mcap::kMagic.size() &&
                            std::memcmp(bytes.data(), mcap::kMagic.data(), bytes.size()) == 0;
  if (bytes.empty() || is_beginning) {
    return path + ": is empty: its writer ended before the first chunk was on the disk";
  }
  return path + ": is no journal: an MCAP file begins with the bytes 89 'MCAP0' 0d 0a";
}

std::string_view DamageText(McapDamageKind kind) {
  switch (kind) {
    case McapDamageKind::kCut:
      return "a record that reaches beyond the end of the file";
    case McapDamageKind::kMalformed:
      return "a record that is none";
    case McapDamageKind::kWrongCrc:
      return "a chunk whose bytes have changed";
    case McapDamageKind::kCompressed:
      return "a compressed chunk, which is not read here";
    case McapDamageKind::kNoChannel:
      return "a message of a channel that was never declared";
    case McapDamageKind::kForeign:
      return "a record that our journals do not have";
  }
  return "";
}

bool IsOnlyCut(const McapContent& content) {
  return content.damages.empty() ||
         (content.damages.size() == 1 && content.damages[0].kind == McapDamageKind::kCut);
}

namespace {

// Takes `count` digits from the front; -1 when they are none.
int TakeDigits(std::string_view& text, std::size_t count) {
  int number = 0;
  if (text.size() < count) return -1;
  for (std::size_t i = 0; i < count; ++i) {
    if (text[i] < '0' || text[i] > '9') return -1;
    number = 10 * number + (text[i] - '0');
  }
  text.remove_prefix(count);
  return number;
}

bool Take(std::string_view& text, char c) {
  if (!text.starts_with(c)) return false;
  text.remove_prefix(1);
  return true;
}

std::optional<Timestamp> WholeNanoseconds(std::string_view text) {
  Timestamp time;
  const char* const end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data(), end, time.ns);
  if (parsed.ec != std::errc() || parsed.ptr != end) return {};
  return time;
}

}  // namespace

std::optional<Timestamp> UtcFromText(std::string_view text) {
  if (const auto time = WholeNanoseconds(text)) return time;
  const int year = TakeDigits(text, 4);
  const bool has_month = Take(text, '-');
  const int month = TakeDigits(text, 2);
  const bool has_day = Take(text, '-');
  const int day = TakeDigits(text, 2);
  const bool has_time = Take(text, 'T');
  const int hour = TakeDigits(text, 2);
  const bool has_minute = Take(text, ':');
  const int minute = TakeDigits(text, 2);
  const bool has_second = Take(text, ':');
  const int second = TakeDigits(text, 2);
  std::int64_t ns = 0;
  if (Take(text, '.')) {
    const std::size_t decimals = std::min<std::size_t>(9, text.find_first_not_of("0123456789"));
    ns = decimals == 0 ? -1 : TakeDigits(text, decimals);
    for (std::size_t i = decimals; i < 9; ++i) ns *= 10;
  }
  const bool has_all = has_month && has_day && has_time && has_minute && has_second && text == "Z";
  // Nanoseconds of 1970 to 2262 fit into the integer.
  if (!has_all || year < 1970 || year > 2261 || month < 1 || day < 1 || hour < 0 || hour > 23 ||
      minute < 0 || minute > 59 || second < 0 || second > 59 || ns < 0) {
    return {};
  }
  const std::chrono::year_month_day date(std::chrono::year(year),
                                         std::chrono::month(static_cast<unsigned>(month)),
                                         std::chrono::day(static_cast<unsigned>(day)));
  if (!date.ok()) return {};
  const Duration since = std::chrono::sys_days(date).time_since_epoch() + std::chrono::hours(hour) +
                         std::chrono::minutes(minute) + std::chrono::seconds(second);
  return Timestamp{since.count() + ns};
}

std::string UtcText(Timestamp time) {
  const auto instant = std::chrono::sys_time<Duration>(Duration(time.ns));
  const auto day = std::chrono::floor<std::chrono::days>(instant);
  const std::chrono::year_month_day date(day);
  const std::chrono::hh_mm_ss clock(std::chrono::floor<std::chrono::milliseconds>(instant - day));
  return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:03}Z",
                     static_cast<int>(date.year()),
                     static_cast<unsigned>(date.month()),
                     static_cast<unsigned>(date.day()),
                     clock.hours().count(),
                     clock.minutes().count(),
                     clock.seconds().count(),
                     clock.subseconds().count());
}

}  // namespace tbm
