#include <csignal>
#include <iostream>
#include <string>
#include <vector>

#include <unistd.h>

#include "guidance/app/tbm_app.h"

namespace {

// A broken invariant ends in abort(); scripts are promised one code for our own mistakes.
void ExitAsInternal(int) { ::_exit(static_cast<int>(tbm::ExitCode::kInternal)); }

}  // namespace

int main(int argument_count, char** arguments) {
  std::signal(SIGABRT, ExitAsInternal);
  std::signal(SIGPIPE, SIG_IGN);  // `tbm watch | head` ends by itself, like any command
  const tbm::Console console{
      std::cout, std::cerr, ::isatty(STDERR_FILENO) == 1, ::isatty(STDOUT_FILENO) == 1};
  return static_cast<int>(tbm::RunTbm({arguments + 1, arguments + argument_count}, console));
}
