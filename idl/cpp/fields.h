#pragma once

#include <array>
#include <type_traits>
#include <vector>

#include <Eigen/Core>
#include <fastrtps/utils/fixed_size_string.hpp>

#include "idl/cpp/bounded_text.h"
#include "pose/base/fixed_vector.h"
#include "pose/base/time.h"

// Each message's fields are listed once, `Fields(way, house, wire)`, and read in both directions: a
// field cannot come back from another place than it went to. Names on both sides are the same
// (tests/idl/same_names.py).
namespace tbm::dds {

// House to wire.
struct Outward {
  template <class T, std::enable_if_t<std::is_arithmetic_v<T>, int> = 0>
  void operator()(const T& from, T& to) const {
    to = from;
  }
  void operator()(const Timestamp& from, std::int64_t& to) const { to = from.ns; }
  template <class From, class To, std::enable_if_t<std::is_enum_v<From>, int> = 0>
  void operator()(const From& from, To& to) const {
    to = static_cast<To>(from);
  }
  // Through the constructor from a C string: the one from pointer and length leaves the end open.
  template <std::size_t N>
  void operator()(const BoundedText<N>& from, eprosima::fastrtps::fixed_string<N>& to) const {
    to = from.c_str();
  }
  template <int kRows, int kColumns, int kOptions, std::size_t N>
  void operator()(const Eigen::Matrix<double, kRows, kColumns, kOptions>& from,
                  std::array<double, N>& to) const {
    static_assert(kRows * kColumns == static_cast<int>(N));
    for (int i = 0; i < kRows * kColumns; ++i) {
      to[static_cast<std::size_t>(i)] = from(i / kColumns, i % kColumns);
    }
  }
  template <class Item, std::size_t N, class WireItem>
  void operator()(const FixedVector<Item, N>& from, std::vector<WireItem>& to) const;
};

// Wire to house.
struct Inward {
  template <class T, std::enable_if_t<std::is_arithmetic_v<T>, int> = 0>
  void operator()(T& to, const T& from) const {
    to = from;
  }
  void operator()(Timestamp& to, const std::int64_t& from) const { to.ns = from; }
  template <class To, class From, std::enable_if_t<std::is_enum_v<To>, int> = 0>
  void operator()(To& to, const From& from) const {
    to = static_cast<To>(from);
  }
  template <std::size_t N>
  void operator()(BoundedText<N>& to, const eprosima::fastrtps::fixed_string<N>& from) const {
    to = from.c_str();
  }
  template <int kRows, int kColumns, int kOptions, std::size_t N>
  void operator()(Eigen::Matrix<double, kRows, kColumns, kOptions>& to,
                  const std::array<double, N>& from) const {
    static_assert(kRows * kColumns == static_cast<int>(N));
    for (int i = 0; i < kRows * kColumns; ++i) {
      to(i / kColumns, i % kColumns) = from[static_cast<std::size_t>(i)];
    }
  }
  template <class Item, std::size_t N, class WireItem>
  void operator()(FixedVector<Item, N>& to, const std::vector<WireItem>& from) const;
};

// `Only<T, M>`: M is T or const T.
template <class T, class M>
using Only = std::enable_if_t<std::is_same_v<std::remove_const_t<M>, T>, int>;

template <class Item, std::size_t N, class WireItem>
void Outward::operator()(const FixedVector<Item, N>& from, std::vector<WireItem>& to) const {
  to.resize(from.size());
  for (std::size_t i = 0; i < from.size(); ++i) Fields(*this, from[i], to[i]);
}
template <class Item, std::size_t N, class WireItem>
void Inward::operator()(FixedVector<Item, N>& to, const std::vector<WireItem>& from) const {
  to.resize(from.size());
  for (std::size_t i = 0; i < from.size(); ++i) Fields(*this, to[i], from[i]);
}

}  // namespace tbm::dds
