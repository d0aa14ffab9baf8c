#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <span>

#include <poll.h>

namespace tbm {

// The plug of an emulated instrument, between whoever pulls it and the one thread that serves it:
// the one asks and waits, the other does it and says so.
class PlugSwitch {
 public:
  using SteadyTime = std::chrono::steady_clock::time_point;

  PlugSwitch();
  ~PlugSwitch();
  PlugSwitch(const PlugSwitch&) = delete;
  PlugSwitch& operator=(const PlugSwitch&) = delete;

  // Any thread. Want returns when the server has done it; WaitSettled when it has done its first.
  void Want(bool plugged);
  void WaitSettled();
  bool IsUp() const;
  void Wake();

  // The server's thread.
  bool IsWanted() const;
  // It is as `plugged` asked now, as far as it could be: `is_up`.
  void Settle(bool plugged, bool is_up);
  // Sleeps until one of `entries` has something, or `until`, or until it is woken: then true.
  // entries[0] is left to the switch; a negative descriptor is passed over.
  bool Sleep(std::span<pollfd> entries, std::optional<SteadyTime> until);

 private:
  int wake_ = -1;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  bool wanted_ = true;
  bool settled_ = false;
  bool is_up_ = false;
};

}  // namespace tbm
