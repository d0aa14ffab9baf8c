#include "guidance/app/journal_files.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <filesystem>
#include <system_error>

#include <fmt/format.h>

namespace tbm {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPattern = "journal_ddddddddTddddddZ_";
constexpr std::string_view kEnding = ".mcap";

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

}  // namespace

std::string JournalFileName(Timestamp first_log_time, std::uint64_t number) {
  const auto instant = std::chrono::sys_time<Duration>(Duration(first_log_time.ns));
  const auto day = std::chrono::floor<std::chrono::days>(instant);
  const std::chrono::year_month_day date(day);
  const std::chrono::hh_mm_ss time(std::chrono::floor<std::chrono::seconds>(instant - day));
  return fmt::format("journal_{:04}{:02}{:02}T{:02}{:02}{:02}Z_{:03}{}",
                     static_cast<int>(date.year()),
                     static_cast<unsigned>(date.month()),
                     static_cast<unsigned>(date.day()),
                     time.hours().count(),
                     time.minutes().count(),
                     time.seconds().count(),
                     number,
                     kEnding);
}

std::optional<std::uint64_t> JournalFileNumber(std::string_view name) {
  if (name.size() < kPattern.size() + kEnding.size() || !name.ends_with(kEnding)) return {};
  for (std::size_t i = 0; i < kPattern.size(); ++i) {
    if (kPattern[i] == 'd' ? !IsDigit(name[i]) : name[i] != kPattern[i]) return {};
  }
  const char* const first = name.data() + kPattern.size();
  const char* const last = name.data() + name.size() - kEnding.size();
  constexpr std::ptrdiff_t kMostDigits = 12;  // there is always a next number
  if (first == last || last - first > kMostDigits || !std::all_of(first, last, IsDigit)) return {};
  std::uint64_t number = 0;
  if (std::from_chars(first, last, number).ec != std::errc()) return {};
  return number;
}

std::vector<JournalFile> JournalFilesIn(const std::string& folder) {
  std::vector<JournalFile> files;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const auto number = JournalFileNumber(it->path().filename().string());
    std::error_code ignored;
    if (!number || !it->is_regular_file(ignored)) continue;
    const auto bytes = it->file_size(ignored);
    files.push_back({it->path().string(), *number, ignored ? 0 : static_cast<std::int64_t>(bytes)});
  }
  // Two files of one number can only come from two folders put together; then the name decides.
  std::sort(files.begin(), files.end(), [](const JournalFile& a, const JournalFile& b) {
    return a.number != b.number ? a.number < b.number : a.path < b.path;
  });
  return files;
}

}  // namespace tbm
