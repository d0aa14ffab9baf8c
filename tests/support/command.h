#pragma once

#include <sstream>
#include <string>
#include <vector>

#include "guidance/app/console.h"
#include "guidance/app/exit_code.h"

namespace tbm::test {

// A command of `tbm`, run without the program around it.
struct Outcome {
  ExitCode code;
  std::string out;
  std::string err;
};

template <class Request>
Outcome Ran(ExitCode (*command)(const Request&, const Console&), const Request& request) {
  std::ostringstream out;
  std::ostringstream err;
  const ExitCode code = command(request, {out, err});
  return {code, out.str(), err.str()};
}

// A table that has no commas in its fields; the first row is the header.
inline std::vector<std::vector<std::string>> Rows(const std::string& csv) {
  std::vector<std::vector<std::string>> rows;
  std::istringstream lines(csv);
  for (std::string line; std::getline(lines, line);) {
    rows.emplace_back();
    std::istringstream fields(line + ",");
    for (std::string field; std::getline(fields, field, ',');) rows.back().push_back(field);
  }
  return rows;
}

}  // namespace tbm::test
