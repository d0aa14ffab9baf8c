#include "devices/imu/stim_datagram.h"

#include <algorithm>

#include "pose/base/check.h"

namespace tbm {
namespace {

constexpr std::uint8_t kCr = 0x0D;
constexpr std::uint8_t kLf = 0x0A;
constexpr std::size_t kClusterLength = 10;

constexpr StimLayout Layout300(int id, bool accel, bool tilt, bool temperature, StimExtra extra) {
  return {static_cast<std::uint8_t>(id), accel, tilt, temperature, extra, false, true, true};
}

constexpr std::array<StimLayout, 25> kLayouts300 = {{
    Layout300(0x90, false, false, false, StimExtra::kNone),
    Layout300(0x91, true, false, false, StimExtra::kNone),
    Layout300(0x92, false, true, false, StimExtra::kNone),
    Layout300(0x93, true, true, false, StimExtra::kNone),
    Layout300(0x94, false, false, true, StimExtra::kNone),
    Layout300(0xA5, true, false, true, StimExtra::kNone),
    Layout300(0xA6, false, true, true, StimExtra::kNone),
    Layout300(0xA7, true, true, true, StimExtra::kNone),
    Layout300(0x97, true, true, true, StimExtra::kNone),  // revisions up to C
    Layout300(0x98, false, false, false, StimExtra::kAux),
    Layout300(0x99, true, false, false, StimExtra::kAux),
    Layout300(0x9A, false, true, false, StimExtra::kAux),
    Layout300(0x9B, true, true, false, StimExtra::kAux),
    Layout300(0x9C, false, false, true, StimExtra::kAux),
    Layout300(0xAD, true, false, true, StimExtra::kAux),
    Layout300(0xAE, false, true, true, StimExtra::kAux),
    Layout300(0xAF, true, true, true, StimExtra::kAux),
    Layout300(0xF0, false, false, false, StimExtra::kPps),
    Layout300(0xF1, true, false, false, StimExtra::kPps),
    Layout300(0xF2, false, true, false, StimExtra::kPps),
    Layout300(0xF3, true, true, false, StimExtra::kPps),
    Layout300(0xF4, false, false, true, StimExtra::kPps),
    Layout300(0xF5, true, false, true, StimExtra::kPps),
    Layout300(0xF6, false, true, true, StimExtra::kPps),
    Layout300(0xF7, true, true, true, StimExtra::kPps),
}};

constexpr StimLayout Layout210(
    int id, bool temperature, bool reserved, bool counter, bool latency) {
  return {static_cast<std::uint8_t>(id),
          false,
          false,
          temperature,
          StimExtra::kNone,
          reserved,
          counter,
          latency};
}

constexpr std::array<StimLayout, 9> kLayouts210 = {{
    Layout210(0x90, false, false, false, false),
    Layout210(0x92, false, true, false, false),
    Layout210(0xA0, true, false, false, false),
    Layout210(0xA2, false, false, true, false),
    Layout210(0xA4, false, false, false, true),
    Layout210(0xA5, false, false, true, true),
    Layout210(0x99, true, false, true, false),
    Layout210(0xA6, true, false, false, true),
    Layout210(0xA8, true, false, true, true),
}};

constexpr std::array<std::uint32_t, 256> MakeCrc32Table() {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    std::uint32_t crc = i << 24u;
    for (int bit = 0; bit < 8; ++bit) {
      crc = (crc & 0x80000000u) != 0 ? (crc << 1u) ^ 0x04C11DB7u : crc << 1u;
    }
    table[i] = crc;
  }
  return table;
}
constexpr std::array<std::uint32_t, 256> kCrc32Table = MakeCrc32Table();

// Reads one after the other; the caller has checked that there is enough.
class Reader {
 public:
  explicit Reader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  std::uint32_t Unsigned(std::size_t width) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < width; ++i) value = (value << 8u) | bytes_[at_++];
    return value;
  }
  std::int32_t Signed(std::size_t width) {
    const auto value = static_cast<std::int32_t>(Unsigned(width));
    const std::int32_t half = 1 << (8 * width - 1);
    return value >= half ? value - 2 * half : value;
  }
  StimCluster Cluster(std::size_t width, bool has_status) {
    StimCluster cluster;
    for (std::int32_t& count : cluster.counts) count = Signed(width);
    if (has_status) cluster.status = static_cast<std::uint8_t>(Unsigned(1));
    return cluster;
  }

 private:
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
};

StimDatagram Parse(StimFamily family,
                   const StimLayout& layout,
                   std::span<const std::uint8_t> bytes) {
  Reader reader(bytes);
  StimDatagram datagram;
  datagram.id = static_cast<std::uint8_t>(reader.Unsigned(1));
  datagram.gyro = reader.Cluster(3, true);
  if (layout.has_accel) datagram.accel = reader.Cluster(3, true);
  if (layout.has_tilt) datagram.tilt = reader.Cluster(3, true);
  if (layout.has_temperature) {
    const bool has_status = family == StimFamily::kStim300;
    datagram.gyro_temperature = reader.Cluster(2, has_status);
    if (layout.has_accel) datagram.accel_temperature = reader.Cluster(2, has_status);
    if (layout.has_tilt) datagram.tilt_temperature = reader.Cluster(2, has_status);
  }
  if (layout.extra != StimExtra::kNone) {
    datagram.extra.emplace();
    datagram.extra->counts = reader.Unsigned(3);
    datagram.extra->status = static_cast<std::uint8_t>(reader.Unsigned(1));
  }
  if (layout.has_reserved) reader.Unsigned(3);
  if (layout.has_counter) datagram.counter = static_cast<std::uint8_t>(reader.Unsigned(1));
  if (layout.has_latency) datagram.latency_us = static_cast<std::uint16_t>(reader.Unsigned(2));
  return datagram;
}

// The bits of all clusters that measure motion.
std::uint8_t StatusOfAny(const StimDatagram& datagram) {
  unsigned status = datagram.gyro.status;
  if (datagram.accel) status |= datagram.accel->status;
  if (datagram.tilt) status |= datagram.tilt->status;
  return static_cast<std::uint8_t>(status);
}

}  // namespace

std::span<const StimLayout> StimLayouts(StimFamily family) {
  if (family == StimFamily::kStim300) return kLayouts300;
  return kLayouts210;
}

const StimLayout* FindStimLayout(StimFamily family, std::uint8_t id) {
  const auto layouts = StimLayouts(family);
  const auto found = std::ranges::find(layouts, id, &StimLayout::id);
  return found == layouts.end() ? nullptr : &*found;
}

std::size_t StimLength(StimFamily family, const StimLayout& layout) {
  const std::size_t clusters = 1u + (layout.has_accel ? 1u : 0u) + (layout.has_tilt ? 1u : 0u);
  std::size_t length = 1 + clusters * kClusterLength;
  if (layout.has_temperature) length += clusters * (family == StimFamily::kStim300 ? 7 : 6);
  if (layout.extra != StimExtra::kNone) length += 4;
  if (layout.has_reserved) length += 3;
  if (layout.has_counter) length += 1;
  if (layout.has_latency) length += 2;
  return length + (family == StimFamily::kStim300 ? 4 : 1);
}

std::uint32_t StimCrc32(std::span<const std::uint8_t> bytes) {
  std::uint32_t crc = 0xFFFFFFFFu;
  const auto add = [&](std::uint32_t byte) {
    crc = (crc << 8u) ^ kCrc32Table[(crc >> 24u) ^ byte];
  };
  for (const std::uint8_t byte : bytes) add(byte);
  for (std::size_t size = bytes.size(); size % 4 != 0; ++size) add(0);
  return crc;
}

std::uint8_t StimCrc8(std::span<const std::uint8_t> bytes) {
  unsigned crc = 0xFF;
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) {
      crc = ((crc & 0x80u) != 0 ? (crc << 1u) ^ 0x07u : crc << 1u) & 0xFFu;
    }
  }
  return static_cast<std::uint8_t>(crc);
}

std::optional<StimDatagram> StimDecoder::Push(std::uint8_t byte) {
  TBM_CHECK(size_ < held_.size());
  held_[size_++] = byte;
  return Next();
}

std::optional<StimDatagram> StimDecoder::Next() {
  while (size_ > 0) {
    if (in_sync_ && held_[0] == kCr) {
      if (size_ == 1) return std::nullopt;
      if (held_[1] == kLf) {
        Drop(2);
        counts_.terminator_bytes += 2;
        continue;
      }
    }
    const StimLayout* layout = FindStimLayout(family_, held_[0]);
    const Look look = layout == nullptr ? Look::kBad : LookAt(*layout);
    if (look == Look::kTooShort) return std::nullopt;
    if (look == Look::kGood) return Take(*layout);
    if (layout != nullptr && in_sync_) ++counts_.wrong_crcs;
    Skip();
  }
  return std::nullopt;
}

StimDecoder::Look StimDecoder::LookAt(const StimLayout& layout) const {
  const std::size_t length = StimLength(family_, layout);
  if (size_ < length) return Look::kTooShort;
  if (!HasRightCrc(length)) return Look::kBad;
  if (family_ == StimFamily::kStim300 || (in_sync_ && layout.id == last_id_)) return Look::kGood;
  if (size_ == length) return Look::kTooShort;
  return held_[length] == layout.id || held_[length] == kCr ? Look::kGood : Look::kBad;
}

bool StimDecoder::HasRightCrc(std::size_t length) const {
  const std::span<const std::uint8_t> bytes(held_.data(), length);
  if (family_ == StimFamily::kStim210) return StimCrc8(bytes.first(length - 1)) == bytes.back();
  Reader sent(bytes.last(4));
  return StimCrc32(bytes.first(length - 4)) == sent.Unsigned(4);
}

std::optional<StimDatagram> StimDecoder::Take(const StimLayout& layout) {
  const std::size_t length = StimLength(family_, layout);
  StimDatagram datagram = Parse(family_, layout, std::span(held_.data(), length));
  datagram.follows = in_sync_;
  in_sync_ = true;
  last_id_ = layout.id;
  Drop(length);
  Count(datagram);
  return datagram;
}

void StimDecoder::Count(const StimDatagram& datagram) {
  ++counts_.datagrams;
  const std::uint8_t status = StatusOfAny(datagram);
  if ((status & stim_status::kStartUp) != 0) ++counts_.starting_up;
  if ((status & stim_status::kOverload) != 0) ++counts_.overloads;
  if (!datagram.counter) return;
  if (last_counter_) {
    // 1 to 256 on; what is no whole number of steps is rounded.
    const unsigned on = ((*datagram.counter - *last_counter_ - 1u) & 0xFFu) + 1u;
    const unsigned steps = std::max(1u, (on + counter_step_ / 2) / counter_step_);
    counts_.lost += steps - 1;
  }
  last_counter_ = datagram.counter;
}

void StimDecoder::Skip() {
  Drop(1);
  ++counts_.skipped_bytes;
  in_sync_ = false;
}

void StimDecoder::Drop(std::size_t count) {
  std::copy(held_.begin() + static_cast<std::ptrdiff_t>(count),
            held_.begin() + static_cast<std::ptrdiff_t>(size_),
            held_.begin());
  size_ -= count;
}

void StimDecoder::Reset() {
  size_ = 0;
  in_sync_ = false;
  last_counter_.reset();
}

}  // namespace tbm
