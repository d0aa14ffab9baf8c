#pragma once

#include <chrono>
#include <thread>

namespace tbm {

// How a driver waits when it has no line to wait on. A test's fake moves its clock instead.
class Sleeper {
 public:
  virtual ~Sleeper() = default;
  virtual void SleepUntil(std::chrono::steady_clock::time_point wake) = 0;
};

class SystemSleeper final : public Sleeper {
 public:
  void SleepUntil(std::chrono::steady_clock::time_point wake) override {
    std::this_thread::sleep_until(wake);
  }
};

}  // namespace tbm
