#pragma once

#include <atomic>
#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "hmi_bridge/server/auth_store.h"
#include "hmi_bridge/server/console_source.h"
#include "hmi_bridge/server/counters.h"
#include "hmi_bridge/server/foxglove.h"
#include "hmi_bridge/server/router.h"
#include "hmi_bridge/server/secrets.h"
#include "hmi_bridge/server/server_options.h"
#include "hmi_bridge/server/static_files.h"
#include "hmi_bridge/server/worker.h"

namespace tbm::hmi {

// A WebSocket that is open. From any thread.
class OpenSocket {
 public:
  virtual ~OpenSocket() = default;
  // Something is new.
  virtual void Poke() = 0;
  // A sample, whether it is wanted or not.
  virtual void Offer(const std::shared_ptr<const Sample>& sample) = 0;
};

// What the server's connections share. Knows no sockets.
struct ServerShared {
  ServerShared(ServerOptions wanted,
               ConsoleSource& its_source,
               RawSource& its_raw,
               AuthStore& its_auth,
               const Clock& its_clock)
      : options(std::move(wanted)),
        source(its_source),
        raw(its_raw),
        auth(its_auth),
        clock(its_clock),
        router(options, files, source, auth, clock, counters),
        hashing(options.limits.waiting_logins),
        writing(options.limits.connections),
        listeners(raw.Channels().size()) {}

  void Add(OpenSocket* socket, std::weak_ptr<OpenSocket> held);
  void Remove(OpenSocket* socket);
  std::vector<std::shared_ptr<OpenSocket>> Sockets() const;

  const ServerOptions options;
  ConsoleSource& source;
  RawSource& raw;
  AuthStore& auth;
  const Clock& clock;
  const std::string run = RandomToken(12);  // tells tools that the bridge has started anew
  Counters counters;
  StaticFiles files;
  Router router;
  Worker hashing;
  Worker writing;
  std::vector<std::atomic<int>> listeners;  // of each channel

  // Connections by address, and those of all.
  class Place;
  std::shared_ptr<Place> Admit(const std::string& address, bool is_loopback);

 private:
  mutable std::mutex mutex_;
  std::map<OpenSocket*, std::weak_ptr<OpenSocket>> sockets_;
  std::map<std::string, std::size_t> by_address_;
  std::size_t connections_ = 0;
};

// Held by a connection for as long as it lives.
class ServerShared::Place {
 public:
  Place(ServerShared& shared, std::string address)
      : shared_(shared), address_(std::move(address)) {}
  ~Place();
  Place(const Place&) = delete;
  Place& operator=(const Place&) = delete;

 private:
  ServerShared& shared_;
  const std::string address_;
};

}  // namespace tbm::hmi
