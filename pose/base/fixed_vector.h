#pragma once

#include <array>
#include <cstddef>

#include "pose/base/check.h"

namespace tbm {

// A vector with room for N values inside itself: the frame path may not touch the heap. T must be
// default constructible. Adding beyond N is our mistake; callers that can meet more ask full().
template <class T, std::size_t N>
class FixedVector {
 public:
  static constexpr std::size_t capacity() { return N; }
  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  bool full() const { return size_ == N; }
  void clear() { size_ = 0; }

  void push_back(const T& value) {
    TBM_CHECK(size_ < N);
    items_[size_++] = value;
  }
  void resize(std::size_t size) {
    TBM_CHECK(size <= N);
    for (std::size_t i = size_; i < size; ++i) items_[i] = T{};
    size_ = size;
  }
  void erase(std::size_t index) {
    TBM_CHECK(index < size_);
    for (std::size_t i = index + 1; i < size_; ++i) items_[i - 1] = items_[i];
    --size_;
  }

  T& operator[](std::size_t index) {
    TBM_CHECK(index < size_);
    return items_[index];
  }
  const T& operator[](std::size_t index) const {
    TBM_CHECK(index < size_);
    return items_[index];
  }
  T& back() { return (*this)[size_ - 1]; }
  const T& back() const { return (*this)[size_ - 1]; }

  T* data() { return items_.data(); }
  const T* data() const { return items_.data(); }
  T* begin() { return items_.data(); }
  T* end() { return items_.data() + size_; }
  const T* begin() const { return items_.data(); }
  const T* end() const { return items_.data() + size_; }

  bool operator==(const FixedVector& other) const {
    if (size_ != other.size_) return false;
    for (std::size_t i = 0; i < size_; ++i) {
      if (!(items_[i] == other.items_[i])) return false;
    }
    return true;
  }

 private:
  std::array<T, N> items_{};
  std::size_t size_ = 0;
};

}  // namespace tbm
