#include "hmi_bridge/server/rate_limit.h"

#include <algorithm>
#include <array>

#include <arpa/inet.h>

#include "hmi_bridge/server/secrets.h"

namespace tbm::hmi {

RateLimit::RateLimit(int at_once, std::chrono::milliseconds period, std::size_t most_keys)
    : at_once_(at_once), period_(period), most_keys_(most_keys) {}

std::optional<std::chrono::milliseconds> RateLimit::Take(const std::string& key, SteadyTime now) {
  const auto found = full_at_.find(key);
  const SteadyTime full_at = found == full_at_.end() ? now : std::max(found->second, now);
  // Each one that is taken puts off by a period when all are there again.
  const SteadyTime next = full_at + period_;
  const SteadyTime latest = now + at_once_ * period_;
  if (next > latest) return std::chrono::ceil<std::chrono::milliseconds>(next - latest);
  if (found != full_at_.end()) {
    found->second = next;
    return std::nullopt;
  }
  if (full_at_.size() >= most_keys_) MakeRoom(now);
  full_at_.emplace(key, next);
  return std::nullopt;
}

void RateLimit::GiveBack(const std::string& key) {
  const auto found = full_at_.find(key);
  if (found != full_at_.end()) found->second -= period_;
}

void RateLimit::MakeRoom(SteadyTime now) {
  std::erase_if(full_at_, [now](const auto& entry) { return entry.second <= now; });
  if (full_at_.size() < most_keys_) return;
  // The one who has asked least is forgotten: those who ask most are not let off by a crowd.
  full_at_.erase(
      std::min_element(full_at_.begin(), full_at_.end(), [](const auto& a, const auto& b) {
        return a.second < b.second;
      }));
}

std::string RateKey(const std::string& address) {
  std::array<unsigned char, 16> bytes{};
  if (inet_pton(AF_INET6, address.c_str(), bytes.data()) != 1) return address;
  const bool is_mapped =
      std::all_of(bytes.begin(), bytes.begin() + 10, [](auto b) { return b == 0; }) &&
      bytes[10] == 0xff && bytes[11] == 0xff;
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return is_mapped ? address.substr(address.rfind(':') + 1) : Hex(text.substr(0, 8)) + "/64";
}

}  // namespace tbm::hmi
