#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <optional>
#include <string>

namespace tbm::hmi {

// So many at once, then one in each period, for each key by itself.
class RateLimit {
 public:
  using SteadyTime = std::chrono::steady_clock::time_point;

  RateLimit(int at_once, std::chrono::milliseconds period, std::size_t most_keys = 10'000);

  // Takes one for `key`; else how long to wait for the next.
  std::optional<std::chrono::milliseconds> Take(const std::string& key, SteadyTime now);
  void GiveBack(const std::string& key);

  std::size_t keys() const { return full_at_.size(); }

 private:
  void MakeRoom(SteadyTime now);

  const int at_once_;
  const std::chrono::milliseconds period_;
  const std::size_t most_keys_;
  std::map<std::string, SteadyTime> full_at_;  // when all would be there again; not listed: are
};

// What an address counts as: an IPv6 network of 64 bits is one customer's, mapped IPv4 is IPv4.
std::string RateKey(const std::string& address);

}  // namespace tbm::hmi
