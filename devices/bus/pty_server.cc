#include "devices/bus/pty_server.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <filesystem>
#include <system_error>

#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <sys/eventfd.h>
#include <termios.h>
#include <unistd.h>

namespace tbm {

using std::chrono::steady_clock;

std::optional<std::vector<std::uint8_t>> PtyOutbox::TakeDue(SteadyTime now) {
  if (queue_.empty() || queue_.begin()->first > now) return std::nullopt;
  std::vector<std::uint8_t> bytes = std::move(queue_.begin()->second);
  queue_.erase(queue_.begin());
  return bytes;
}

std::optional<PtyOutbox::SteadyTime> PtyOutbox::NextDue() const {
  if (queue_.empty()) return std::nullopt;
  return queue_.begin()->first;
}

PtyServer::PtyServer(std::string link_path, PtyInstrument& instrument)
    : link_path_(std::move(link_path)), instrument_(instrument) {
  wake_ = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return settled_; });
}

PtyServer::~PtyServer() {
  thread_.request_stop();
  Wake();
  thread_.join();
  close(wake_);
}

bool PtyServer::IsUp() const {
  const std::lock_guard lock(mutex_);
  return is_up_;
}

void PtyServer::Want(bool plugged) {
  std::unique_lock lock(mutex_);
  if (wanted_ == plugged) return;
  wanted_ = plugged;
  settled_ = false;
  Wake();
  changed_.wait(lock, [this] { return settled_; });
}

void PtyServer::Wake() {
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = write(wake_, &one, sizeof one);
}

bool PtyServer::IsWanted() {
  const std::lock_guard lock(mutex_);
  return wanted_;
}

void PtyServer::Run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    const bool plugged = IsWanted();
    if (plugged && master_ < 0) {
      if (!PlugIn()) PullOut();
      instrument_.OnPlug();
    }
    if (!plugged) PullOut();
    {
      const std::lock_guard lock(mutex_);
      is_up_ = master_ >= 0;
      // When the wish changed meanwhile, its wake-up is pending and the next turn settles it.
      settled_ = wanted_ == plugged;
    }
    changed_.notify_all();
    Serve(stop);
  }
  PullOut();
}

// Until somebody wakes it: the plug is to be moved, or the server ends.
void PtyServer::Serve(const std::stop_token& stop) {
  std::array<std::uint8_t, 512> bytes;
  const bool plugged = master_ >= 0;
  while (!stop.stop_requested()) {
    auto now = steady_clock::now();
    std::optional<steady_clock::time_point> wake;
    if (plugged) {
      wake = instrument_.OnTurn(now, outbox_);
      while (const auto message = outbox_.TakeDue(now)) {
        // A full terminal means that nobody reads: as on a real wire the bytes are lost.
        [[maybe_unused]] const ssize_t written = write(master_, message->data(), message->size());
      }
      if (const auto due = outbox_.NextDue()) wake = wake ? std::min(*wake, *due) : due;
    }
    timespec wait{};
    if (wake) {
      const auto left = std::max(*wake - now, steady_clock::duration::zero());
      const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(left);
      wait.tv_sec = static_cast<time_t>(seconds.count());
      wait.tv_nsec = static_cast<long>(std::chrono::nanoseconds(left - seconds).count());
    }
    std::array<pollfd, 2> entries{{{wake_, POLLIN, 0}, {master_, POLLIN, 0}}};
    ppoll(entries.data(), plugged ? 2 : 1, wake ? &wait : nullptr, nullptr);
    if ((entries[0].revents & POLLIN) != 0) {
      std::uint64_t count = 0;
      [[maybe_unused]] const ssize_t taken = read(wake_, &count, sizeof count);
      return;
    }
    if (plugged && (entries[1].revents & POLLIN) != 0) {
      const ssize_t count = read(master_, bytes.data(), bytes.size());
      now = steady_clock::now();
      if (count > 0) {
        instrument_.OnBytes(std::span(bytes.data(), static_cast<std::size_t>(count)), now, outbox_);
      }
    }
  }
}

bool PtyServer::PlugIn() {
  std::array<char, 128> name{};
  termios raw{};
  cfmakeraw(&raw);
  raw.c_cflag |= CREAD | CLOCAL | CS8;
  if (openpty(&master_, &slave_, name.data(), &raw, nullptr) != 0) return false;
  fcntl(master_, F_SETFL, O_NONBLOCK);
  fcntl(master_, F_SETFD, FD_CLOEXEC);
  fcntl(slave_, F_SETFD, FD_CLOEXEC);
  // Only a stale link of an earlier server may be replaced, never a file of somebody else.
  std::error_code error;
  if (std::filesystem::is_symlink(link_path_, error)) std::filesystem::remove(link_path_, error);
  std::filesystem::create_symlink(name.data(), link_path_, error);
  return !error;
}

void PtyServer::PullOut() {
  outbox_.Clear();
  if (master_ < 0) return;
  std::error_code error;
  if (std::filesystem::is_symlink(link_path_, error)) std::filesystem::remove(link_path_, error);
  close(slave_);
  close(master_);
  master_ = slave_ = -1;
}

}  // namespace tbm
