// `tbm solve RUN --out FILE` alone, for the camera box's processor: the rest of tbm stays on the
// PC.
//
//   solve_on_box solve RUN --out FILE
#include <cstdio>
#include <iostream>
#include <string_view>

#include "guidance/app/solve_command.h"

int main(int argc, char** argv) {
  if (argc != 5 || std::string_view(argv[1]) != "solve" || std::string_view(argv[3]) != "--out") {
    std::fprintf(stderr, "usage: solve_on_box solve RUN --out FILE\n");
    return static_cast<int>(tbm::ExitCode::kBadInput);
  }
  tbm::SolveRequest request;
  request.run = argv[2];
  request.out = argv[4];
  return static_cast<int>(tbm::RunSolve(request, {std::cout, std::cerr}));
}
