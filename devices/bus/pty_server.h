#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "devices/bus/plug_switch.h"

namespace tbm {

// What an emulated instrument is about to say, and when its last byte is through the wire.
class PtyOutbox {
 public:
  using SteadyTime = std::chrono::steady_clock::time_point;

  void At(SteadyTime due, std::vector<std::uint8_t> bytes) {
    queue_.emplace(due, std::move(bytes));
  }

  // The next message that is due, and when the one after it will be.
  std::optional<std::vector<std::uint8_t>> TakeDue(SteadyTime now);
  std::optional<SteadyTime> NextDue() const;
  void Clear() { queue_.clear(); }

  // The instrument closes the connection. Means nothing on a wire that is no connection.
  void HangUp() { hangs_up_ = true; }
  bool TakeHangUp() { return std::exchange(hangs_up_, false); }

 private:
  std::multimap<SteadyTime, std::vector<std::uint8_t>> queue_;
  bool hangs_up_ = false;
};

// The instrument's end of a wire. Called from the server's thread only.
class PtyInstrument {
 public:
  using SteadyTime = PtyOutbox::SteadyTime;

  virtual ~PtyInstrument() = default;
  // The wire is new: at the start, and after it was pulled.
  virtual void OnPlug() {}
  virtual void OnBytes(std::span<const std::uint8_t> bytes, SteadyTime now, PtyOutbox& outbox) = 0;
  // Called before every wait. When it wants to be called again at the latest; empty for never.
  virtual std::optional<SteadyTime> OnTurn(SteadyTime now, PtyOutbox& outbox) = 0;
};

// Offers an emulated instrument as a serial device on a pseudo-terminal, under a symbolic link of
// a fixed name. A pseudo-terminal has no baud rate: the instrument adds line time to what it says.
// The slave's end stays open here too, so a client that closes the port does not hang the line up.
class PtyServer {
 public:
  // `instrument` must live longer than the server. The link appears before the constructor returns;
  // IsUp is false when the system has no pseudo-terminal left or the link cannot be written.
  PtyServer(std::string link_path, PtyInstrument& instrument);
  ~PtyServer();
  PtyServer(const PtyServer&) = delete;
  PtyServer& operator=(const PtyServer&) = delete;

  bool IsUp() const { return plug_.IsUp(); }
  const std::string& path() const { return link_path_; }

  // Pulls the adapter out: the client's port hangs up and its name vanishes. Replug brings a new
  // terminal under the same name. Both return when it is done.
  void Unplug() { plug_.Want(false); }
  void Replug() { plug_.Want(true); }

 private:
  void Run(const std::stop_token& stop);
  void Serve(const std::stop_token& stop);
  bool PlugIn();
  void PullOut();

  const std::string link_path_;
  PtyInstrument& instrument_;
  PtyOutbox outbox_;
  int master_ = -1;
  int slave_ = -1;
  PlugSwitch plug_;
  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace tbm
