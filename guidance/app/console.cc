#include "guidance/app/console.h"

#include <algorithm>

#include <fmt/format.h>

namespace tbm {
namespace {

constexpr std::string_view kEraseLine = "\r\x1b[K";

}  // namespace

void Complain(const Console& console, std::string_view what) {
  if (console.err_is_terminal) console.err << kEraseLine;  // a progress bar may stand there
  console.err << "tbm: " << what << "\n";
}

void Complain(const Console& console, const FileFaults& faults) {
  for (const FileFault& fault : faults) Complain(console, fault.Text());
}

Progress::Progress(const Console& console, std::string_view what, std::size_t total)
    : console_(console),
      what_(what),
      total_(std::max<std::size_t>(total, 1)),
      started_at_(std::chrono::steady_clock::now()),
      shown_at_(started_at_ - std::chrono::seconds(1)) {}

Progress::~Progress() {
  if (console_.err_is_terminal) console_.err << kEraseLine << std::flush;
}

void Progress::Show(std::size_t done) {
  if (!console_.err_is_terminal) return;
  const auto now = std::chrono::steady_clock::now();
  if (now - shown_at_ < std::chrono::milliseconds(100)) return;
  shown_at_ = now;
  constexpr std::size_t kWidth = 30;
  const std::size_t filled = std::min(done, total_) * kWidth / total_;
  const double elapsed_s = std::chrono::duration<double>(now - started_at_).count();
  const double left_s = done == 0
                            ? 0.0
                            : elapsed_s * static_cast<double>(total_ - std::min(done, total_)) /
                                  static_cast<double>(done);
  console_.err << fmt::format("{}{} [{}{}] {} of {}, {:.0f} s left",
                              kEraseLine,
                              what_,
                              std::string(filled, '#'),
                              std::string(kWidth - filled, '.'),
                              done,
                              total_,
                              left_s)
               << std::flush;
}

}  // namespace tbm
