#include "devices/bus/plug_switch.h"

#include <algorithm>
#include <cstdint>
#include <ctime>

#include <sys/eventfd.h>
#include <unistd.h>

namespace tbm {

PlugSwitch::PlugSwitch() : wake_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {}
PlugSwitch::~PlugSwitch() { close(wake_); }

void PlugSwitch::Want(bool plugged) {
  std::unique_lock lock(mutex_);
  if (wanted_ == plugged) return;
  wanted_ = plugged;
  settled_ = false;
  Wake();
  changed_.wait(lock, [this] { return settled_; });
}

void PlugSwitch::WaitSettled() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return settled_; });
}

bool PlugSwitch::IsUp() const {
  const std::lock_guard lock(mutex_);
  return is_up_;
}

void PlugSwitch::Wake() {
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = write(wake_, &one, sizeof one);
}

bool PlugSwitch::IsWanted() const {
  const std::lock_guard lock(mutex_);
  return wanted_;
}

void PlugSwitch::Settle(bool plugged, bool is_up) {
  {
    const std::lock_guard lock(mutex_);
    is_up_ = is_up;
    // When the wish changed meanwhile, its wake-up is pending and the next turn settles it.
    settled_ = wanted_ == plugged;
  }
  changed_.notify_all();
}

bool PlugSwitch::Sleep(std::span<pollfd> entries, std::optional<SteadyTime> until) {
  timespec wait{};
  if (until) {
    const auto left =
        std::max(*until - std::chrono::steady_clock::now(), SteadyTime::duration::zero());
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(left);
    wait.tv_sec = static_cast<time_t>(seconds.count());
    wait.tv_nsec = static_cast<long>(std::chrono::nanoseconds(left - seconds).count());
  }
  entries[0] = {wake_, POLLIN, 0};
  ppoll(entries.data(), entries.size(), until ? &wait : nullptr, nullptr);
  if ((entries[0].revents & POLLIN) == 0) return false;
  std::uint64_t count = 0;
  [[maybe_unused]] const ssize_t taken = read(wake_, &count, sizeof count);
  return true;
}

}  // namespace tbm
