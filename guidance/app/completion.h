#pragma once

#include <string>

namespace CLI {
class App;
}

namespace tbm {

// A completion script for the commands, options and choices that `app` has, for `source`. Generated
// from the same description as the parser and --help, so it cannot lag behind.
std::string BashCompletion(const CLI::App& app);
std::string ZshCompletion(const CLI::App& app);

}  // namespace tbm
