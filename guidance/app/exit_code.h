#pragma once

namespace tbm {

// What a script sees. Promised in the README; append only.
enum class ExitCode {
  kDone = 0,      // also when single frames gave no pose
  kBadInput = 2,  // the command line or a file is wrong
  kDevice = 3,
  kDds = 4,
  kInternal = 70,  // our own mistake
};

}  // namespace tbm
