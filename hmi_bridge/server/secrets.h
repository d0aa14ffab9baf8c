#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace tbm::hmi {

// What has to be secret, by OpenSSL alone: its random numbers, digests, scrypt and comparison.

std::string RandomBytes(std::size_t count);
// Letters that a URL, a header and a cookie all take as they are (base64url without padding).
std::string RandomToken(std::size_t bytes);
// For a person who reads it from a screen and types it in gloves: nothing that looks like something
// else. 20 characters of 31 are 99 bits.
std::string RandomPassword();

std::string Sha256Hex(std::string_view bytes);
std::string Hex(std::string_view bytes);
std::optional<std::string> FromHex(std::string_view text);

// Takes the same time wherever they differ.
bool SameSecret(std::string_view one, std::string_view other);

// scrypt and what it was made with, so that the cost can grow and old passwords still work.
struct PasswordHash {
  int log2_n = 15;  // 32 MB and about 0.1 s with r = 8
  int r = 8;
  int p = 1;
  std::string salt;  // 16 bytes
  std::string key;   // 32 bytes
};

// What may stand in a file: more than this would be a way to stop the bridge.
inline constexpr int kLeastLog2N = 10;
inline constexpr int kMostLog2N = 18;

PasswordHash HashOf(std::string_view password, int log2_n);
bool IsPassword(const PasswordHash& hash, std::string_view password);

}  // namespace tbm::hmi
