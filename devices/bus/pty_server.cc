#include "devices/bus/pty_server.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <filesystem>
#include <system_error>

#include <fcntl.h>
#include <poll.h>
#include <pty.h>
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
  thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
  plug_.WaitSettled();
}

PtyServer::~PtyServer() {
  thread_.request_stop();
  plug_.Wake();
  thread_.join();
}

void PtyServer::Run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    const bool plugged = plug_.IsWanted();
    if (plugged && master_ < 0) {
      if (!PlugIn()) PullOut();
      instrument_.OnPlug();
    }
    if (!plugged) PullOut();
    plug_.Settle(plugged, master_ >= 0);
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
    std::array<pollfd, 2> entries{{{}, {plugged ? master_ : -1, POLLIN, 0}}};
    if (plug_.Sleep(entries, wake)) return;
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
