#pragma once

#include <condition_variable>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "devices/bus/pty_server.h"

namespace tbm {

// Offers an emulated instrument on a TCP port of this computer, to one client at a time: a new one
// takes the place of the old.
class TcpServer {
 public:
  // `address` is IPv4. Port 0 lets the system choose; `port` tells. `instrument` must live longer.
  // The port is open when the constructor returns; IsUp is false when it cannot be had.
  TcpServer(std::string address, int port, PtyInstrument& instrument);
  ~TcpServer();
  TcpServer(const TcpServer&) = delete;
  TcpServer& operator=(const TcpServer&) = delete;

  bool IsUp() const;
  int port() const;

  // Closes the port and the client's connection, and opens the port again, the same one. Both
  // return when it is done.
  void Unplug() { Want(false); }
  void Replug() { Want(true); }

 private:
  void Want(bool plugged);
  void Run(const std::stop_token& stop);
  void Serve(const std::stop_token& stop);
  std::optional<PtyOutbox::SteadyTime> Talk();
  void Listen();
  void Accept();
  void Receive();
  void DropClient();
  void Wake();

  const std::string address_;
  PtyInstrument& instrument_;
  PtyOutbox outbox_;
  int listener_ = -1;
  int client_ = -1;
  int wake_ = -1;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  int port_;
  bool wanted_ = true;
  bool settled_ = false;
  bool is_up_ = false;
  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace tbm
