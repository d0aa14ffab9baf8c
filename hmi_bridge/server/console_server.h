#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "hmi_bridge/server/auth_store.h"
#include "hmi_bridge/server/console_source.h"
#include "hmi_bridge/server/server_options.h"
#include "pose/base/clock.h"
#include "pose/base/time.h"

namespace tbm::hmi {

// The operator's console on the network: the built page, openapi.yaml, foxglove.websocket.v1.
// What it is given outlives it. Its two threads never wait for a disk or a password.
class ConsoleServer {
 public:
  ConsoleServer(ServerOptions options,
                ConsoleSource& source,
                RawSource& raw,
                AuthStore& auth,
                const Clock& clock);
  ~ConsoleServer();
  ConsoleServer(const ConsoleServer&) = delete;
  ConsoleServer& operator=(const ConsoleServer&) = delete;

  // All that is in the way, a sentence each; then nothing listens. Once.
  std::vector<std::string> Start();
  // Ends every connection. After it nothing of the sources is called any more.
  void Stop();

  // Of the address in the options of that index; after Start.
  std::uint16_t port(std::size_t index = 0) const;

  // From any thread, at any rate: something that Now() tells is new.
  void Notify();
  // Whether anybody would get a sample of this channel.
  bool HasListener(std::size_t channel) const;
  // From any thread. Without listener the bytes are not even copied.
  void Publish(std::size_t channel, Timestamp at, std::span<const std::byte> cdr);

  std::string Metrics() const;

 private:
  struct Core;
  std::unique_ptr<Core> core_;
};

}  // namespace tbm::hmi
