#pragma once

#include <array>
#include <cstddef>
#include <cstring>
#include <string_view>

namespace tbm::dds {

// A word or a sentence of at most N bytes, held inside itself: the write path may not touch the
// heap. What is longer is cut at a whole UTF-8 character; what follows a zero byte is dropped,
// because the wire ends a string there.
template <std::size_t N>
class BoundedText {
 public:
  BoundedText() = default;
  BoundedText(std::string_view text) {  // NOLINT(google-explicit-constructor): it is a string
    text = text.substr(0, text.find('\0'));
    std::size_t size = text.size();
    if (size > N) {
      size = N;
      while (size > 0 && (static_cast<unsigned char>(text[size]) & 0xC0u) == 0x80u) --size;
    }
    if (size > 0) std::memcpy(text_.data(), text.data(), size);
  }
  BoundedText(const char* text) : BoundedText(std::string_view(text)) {}  // NOLINT

  static constexpr std::size_t capacity() { return N; }
  std::size_t size() const { return std::strlen(text_.data()); }
  bool empty() const { return text_[0] == '\0'; }
  const char* c_str() const { return text_.data(); }
  std::string_view view() const { return {text_.data(), size()}; }
  operator std::string_view() const { return view(); }  // NOLINT(google-explicit-constructor)

  bool operator==(const BoundedText& other) const { return view() == other.view(); }

 private:
  std::array<char, N + 1> text_{};
};

}  // namespace tbm::dds
