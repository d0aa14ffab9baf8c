#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

namespace tbm::hmi {

// One thread for what takes long or waits for a disk, so that those who serve never do.
class Worker {
 public:
  explicit Worker(std::size_t most_waiting) : most_waiting_(most_waiting) {}
  ~Worker() { Stop(); }

  void Start();
  // What has not begun by then is never done.
  void Stop();
  // False: too much waits already.
  bool Post(std::function<void()> job);

 private:
  void Run();

  const std::size_t most_waiting_;
  std::mutex mutex_;
  std::condition_variable something_;
  std::deque<std::function<void()>> jobs_;
  bool is_stopping_ = false;
  std::thread thread_;
};

}  // namespace tbm::hmi
