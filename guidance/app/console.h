#pragma once

#include <chrono>
#include <cstddef>
#include <ostream>
#include <string>
#include <string_view>

#include "devices/replay/csv.h"

namespace tbm {

// Where a command talks to its user. `out` carries results and may be a pipe; `err` carries
// messages and, on a terminal, progress.
struct Console {
  std::ostream& out;
  std::ostream& err;
  bool err_is_terminal = false;
  bool out_is_terminal = false;
};

// "tbm: rig.yaml:7: .." on the error stream.
void Complain(const Console& console, std::string_view what);
void Complain(const Console& console, const FileFaults& faults);

// A bar that redraws itself at most ten times a second and is taken away at the end; nothing at all
// unless the error stream is a terminal.
class Progress {
 public:
  Progress(const Console& console, std::string_view what, std::size_t total);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void Show(std::size_t done);

 private:
  const Console& console_;
  std::string what_;
  std::size_t total_;
  std::chrono::steady_clock::time_point started_at_;
  std::chrono::steady_clock::time_point shown_at_;
};

}  // namespace tbm
