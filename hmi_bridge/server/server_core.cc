#include "hmi_bridge/server/server_core.h"

#include "hmi_bridge/server/rate_limit.h"

namespace tbm::hmi {

void ServerShared::Add(OpenSocket* socket, std::weak_ptr<OpenSocket> held) {
  const std::lock_guard lock(mutex_);
  sockets_.emplace(socket, std::move(held));
}

void ServerShared::Remove(OpenSocket* socket) {
  const std::lock_guard lock(mutex_);
  sockets_.erase(socket);
}

std::vector<std::shared_ptr<OpenSocket>> ServerShared::Sockets() const {
  std::vector<std::shared_ptr<OpenSocket>> open;
  const std::lock_guard lock(mutex_);
  open.reserve(sockets_.size());
  for (const auto& [socket, held] : sockets_) {
    if (auto locked = held.lock()) open.push_back(std::move(locked));
  }
  return open;
}

std::shared_ptr<ServerShared::Place> ServerShared::Admit(const std::string& address,
                                                         bool is_loopback) {
  const std::string key = RateKey(address);
  const std::lock_guard lock(mutex_);
  const auto found = by_address_.find(key);
  const std::size_t of_address = found == by_address_.end() ? 0 : found->second;
  const bool is_full = connections_ >= options.limits.connections ||
                       (!is_loopback && of_address >= options.limits.connections_per_address);
  if (is_full) {
    counters.Refuse(Refusal::kTooManyConnections);
    return nullptr;
  }
  ++connections_;
  ++by_address_[key];
  ++counters.connections;
  return std::make_shared<Place>(*this, key);
}

ServerShared::Place::~Place() {
  const std::lock_guard lock(shared_.mutex_);
  --shared_.connections_;
  --shared_.counters.connections;
  const auto found = shared_.by_address_.find(address_);
  if (--found->second == 0) shared_.by_address_.erase(found);
}

}  // namespace tbm::hmi
