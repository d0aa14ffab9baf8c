#include "hmi_bridge/server/secrets.h"

#include <array>
#include <cstdint>

#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/rand.h>

#include "pose/base/check.h"

namespace tbm::hmi {
namespace {

constexpr std::string_view kHexDigits = "0123456789abcdef";
constexpr std::size_t kKeyBytes = 32;
constexpr std::size_t kSaltBytes = 16;

const unsigned char* Bytes(std::string_view text) {
  return reinterpret_cast<const unsigned char*>(text.data());
}

std::string Derive(const PasswordHash& hash, std::string_view password) {
  std::string key(kKeyBytes, '\0');
  const std::uint64_t n = std::uint64_t{1} << hash.log2_n;
  const std::uint64_t memory = 256 * n * static_cast<std::uint64_t>(hash.r) + (1 << 20);
  TBM_CHECK(EVP_PBE_scrypt(password.data(),
                           password.size(),
                           Bytes(hash.salt),
                           hash.salt.size(),
                           n,
                           static_cast<std::uint64_t>(hash.r),
                           static_cast<std::uint64_t>(hash.p),
                           memory,
                           reinterpret_cast<unsigned char*>(key.data()),
                           key.size()) == 1);
  return key;
}

}  // namespace

std::string RandomBytes(std::size_t count) {
  std::string bytes(count, '\0');
  TBM_CHECK(RAND_bytes(reinterpret_cast<unsigned char*>(bytes.data()), static_cast<int>(count)) ==
            1);
  return bytes;
}

std::string RandomToken(std::size_t bytes) {
  constexpr std::string_view kLetters =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
  const std::string random = RandomBytes(bytes);
  std::string text;
  std::uint32_t held = 0;
  int bits = 0;
  for (const char byte : random) {
    held = ((held << 8) | static_cast<unsigned char>(byte)) & 0xffffu;
    for (bits += 8; bits >= 6; bits -= 6) text += kLetters[(held >> (bits - 6)) & 63u];
  }
  if (bits > 0) text += kLetters[(held << (6 - bits)) & 63u];
  return text;
}

std::string RandomPassword() {
  constexpr std::string_view kLetters = "abcdefghjkmnpqrstuvwxyz23456789";
  constexpr std::size_t kLength = 20;
  // Bytes beyond the last whole multiple are left out: each letter is as likely as the others.
  constexpr std::size_t kFair = 256 / kLetters.size() * kLetters.size();
  std::string password;
  while (password.size() < kLength) {
    const auto byte = static_cast<unsigned char>(RandomBytes(1)[0]);
    if (byte < kFair) password += kLetters[byte % kLetters.size()];
  }
  return password;
}

std::string Sha256Hex(std::string_view bytes) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  TBM_CHECK(EVP_Digest(bytes.data(), bytes.size(), digest.data(), &size, EVP_sha256(), nullptr) ==
            1);
  return Hex({reinterpret_cast<const char*>(digest.data()), size});
}

std::string Hex(std::string_view bytes) {
  std::string text;
  for (const char c : bytes) {
    const auto byte = static_cast<unsigned char>(c);
    text += kHexDigits[byte >> 4];
    text += kHexDigits[byte & 15];
  }
  return text;
}

std::optional<std::string> FromHex(std::string_view text) {
  if (text.size() % 2 != 0) return std::nullopt;
  std::string bytes;
  for (std::size_t i = 0; i < text.size(); i += 2) {
    const std::size_t high = kHexDigits.find(text[i]);
    const std::size_t low = kHexDigits.find(text[i + 1]);
    if (high == std::string_view::npos || low == std::string_view::npos) return std::nullopt;
    bytes += static_cast<char>(high << 4 | low);
  }
  return bytes;
}

bool SameSecret(std::string_view one, std::string_view other) {
  return one.size() == other.size() && CRYPTO_memcmp(one.data(), other.data(), one.size()) == 0;
}

PasswordHash HashOf(std::string_view password, int log2_n) {
  PasswordHash hash;
  hash.log2_n = log2_n;
  hash.salt = RandomBytes(kSaltBytes);
  hash.key = Derive(hash, password);
  return hash;
}

bool IsPassword(const PasswordHash& hash, std::string_view password) {
  return SameSecret(Derive(hash, password), hash.key);
}

}  // namespace tbm::hmi
