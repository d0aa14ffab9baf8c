#pragma once

#include <sys/prctl.h>

namespace tbm::test {

// While one lives, instructions count for its region; see count_instructions.c.
class Counted {
 public:
  explicit Counted(unsigned long region) : region_(region) { prctl(kMark, region_, 1ul, 0ul, 0ul); }
  ~Counted() { prctl(kMark, region_, 0ul, 0ul, 0ul); }
  Counted(const Counted&) = delete;
  Counted& operator=(const Counted&) = delete;

 private:
  static constexpr unsigned long kMark = 0x54424D;
  unsigned long region_;
};

}  // namespace tbm::test
