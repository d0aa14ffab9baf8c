#pragma once

#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "devices/bus/plug_switch.h"
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

  bool IsUp() const { return plug_.IsUp(); }
  int port() const;

  // Closes the port and the client's connection, and opens the port again, the same one. Both
  // return when it is done.
  void Unplug() { plug_.Want(false); }
  void Replug() { plug_.Want(true); }

 private:
  void Run(const std::stop_token& stop);
  void Serve(const std::stop_token& stop);
  std::optional<PtyOutbox::SteadyTime> Talk();
  void Listen();
  void Accept();
  void Receive();
  void DropClient();

  const std::string address_;
  PtyInstrument& instrument_;
  PtyOutbox outbox_;
  int listener_ = -1;
  int client_ = -1;
  PlugSwitch plug_;

  mutable std::mutex mutex_;
  int port_;
  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace tbm
