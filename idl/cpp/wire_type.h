#pragma once

#include <array>
#include <functional>

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastrtps/utils/md5.h>

#include "idl/cpp/convert.h"
#include "idl/cpp/topics.h"
#include "pose/base/check.h"

// Inside of idl/cpp: how a generated type gets into and out of bytes.
namespace tbm::dds {

template <class Message>
struct WireOf;
template <>
struct WireOf<FrameFeatures> {
  using Type = v1::FrameFeatures;
};
template <>
struct WireOf<TiltReading> {
  using Type = v1::Inclination;
};
template <>
struct WireOf<RelativePose> {
  using Type = v1::RelativePose;
};
template <>
struct WireOf<DeviceHealth> {
  using Type = v1::DeviceHealth;
};
template <>
struct WireOf<Event> {
  using Type = v1::Event;
};
template <>
struct WireOf<StationObservation> {
  using Type = v1::StationObservation;
};
template <>
struct WireOf<StationSetUp> {
  using Type = v1::StationSetUp;
};
template <>
struct WireOf<ShieldPose> {
  using Type = v1::ShieldPose;
};
template <>
struct WireOf<Guidance> {
  using Type = v1::Guidance;
};
template <>
struct WireOf<AlarmStatus> {
  using Type = v1::AlarmStatus;
};
template <>
struct WireOf<Command> {
  using Type = v1::Command;
};
template <>
struct WireOf<CommandReply> {
  using Type = v1::CommandReply;
};
template <>
struct WireOf<TrolleyState> {
  using Type = v1::TrolleyState;
};
template <>
struct WireOf<RailLinePiece> {
  using Type = v1::RailLinePiece;
};
template <>
struct WireOf<SettlementPiece> {
  using Type = v1::SettlementPiece;
};
template <>
struct WireOf<CalibrationStatus> {
  using Type = v1::CalibrationStatus;
};

// A sample as it came: `value` means something only when the bytes were exactly one value of the
// type.
template <class Wire>
struct WireSample {
  Wire value;
  bool is_well_formed = false;
};

// Bytes to value. False, and an empty value, for whatever is not plain CDR of exactly this type:
// cut short, left over, or another encoding. A writer with another version of the IDL is mostly
// found here.
template <class Wire>
bool Decode(const char* bytes, std::size_t size, WireSample<Wire>& sample) {
  // Version 1 and 2 CDR pad to whole words.
  constexpr std::size_t kMostPadding = 3;
  sample.is_well_formed = false;
  if (size >= 4 && bytes[0] == 0 && (bytes[1] == 0 || bytes[1] == 1)) {
    try {
      eprosima::fastcdr::FastBuffer buffer(const_cast<char*>(bytes), size);
      eprosima::fastcdr::Cdr cdr(
          buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN, eprosima::fastcdr::Cdr::DDS_CDR);
      cdr.read_encapsulation();
      sample.value.deserialize(cdr);
      sample.is_well_formed = cdr.getSerializedDataLength() + kMostPadding >= size;
    } catch (...) {  // fastcdr's and, for absurd lengths, the allocator's
    }
  }
  if (!sample.is_well_formed) sample.value = Wire{};
  return sample.is_well_formed;
}

// The generated TopicDataType lets exceptions out and computes keys in a member that the sending
// and the receiving thread share; this one does neither. Bytes are those of the generated code.
template <class Message>
class WireType final : public eprosima::fastdds::dds::TopicDataType {
 public:
  using Wire = typename WireOf<Message>::Type;
  using Payload = eprosima::fastrtps::rtps::SerializedPayload_t;
  using Handle = eprosima::fastrtps::rtps::InstanceHandle_t;

  WireType() {
    setName(std::string(TopicOf<Message>().type).c_str());
    const std::size_t size = Wire::getMaxCdrSerializedSize();
    m_typeSize = static_cast<std::uint32_t>((size + 3) / 4 * 4 + kEncapsulation);
    m_isGetKeyDefined = true;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
    TBM_CHECK(Wire::getKeyMaxCdrSerializedSize() <= kMaxKeyBytes);
  }

  bool serialize(void* data, Payload* payload) override {
    try {
      eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(payload->data),
                                           payload->max_size);
      eprosima::fastcdr::Cdr cdr(
          buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN, eprosima::fastcdr::Cdr::DDS_CDR);
      payload->encapsulation =
          cdr.endianness() == eprosima::fastcdr::Cdr::BIG_ENDIANNESS ? CDR_BE : CDR_LE;
      cdr.serialize_encapsulation();
      static_cast<WireSample<Wire>*>(data)->value.serialize(cdr);
      payload->length = static_cast<std::uint32_t>(cdr.getSerializedDataLength());
      return true;
    } catch (...) {
      return false;
    }
  }

  // Always true: what is wrong is marked and counted by the subscriber, never lost in silence.
  bool deserialize(Payload* payload, void* data) override {
    Decode(reinterpret_cast<const char*>(payload->data),
           payload->length,
           *static_cast<WireSample<Wire>*>(data));
    return true;
  }

  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] {
      const Wire& value = static_cast<WireSample<Wire>*>(data)->value;
      return static_cast<std::uint32_t>(Wire::getCdrSerializedSize(value) + kEncapsulation);
    };
  }

  void* createData() override { return new WireSample<Wire>; }
  void deleteData(void* data) override { delete static_cast<WireSample<Wire>*>(data); }

  // RTPS 9.6.3.3: big-endian CDR of the key fields, through MD5 when it may exceed 16 bytes.
  bool getKey(void* data, Handle* handle, bool force_md5) override {
    std::array<char, kMaxKeyBytes> bytes{};
    eprosima::fastcdr::FastBuffer buffer(bytes.data(), bytes.size());
    eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::BIG_ENDIANNESS);
    try {
      static_cast<WireSample<Wire>*>(data)->value.serializeKey(cdr);
    } catch (...) {
      return false;
    }
    const auto size = static_cast<unsigned>(cdr.getSerializedDataLength());
    const bool needs_md5 = force_md5 || Wire::getKeyMaxCdrSerializedSize() > 16;
    MD5 md5;
    md5.init();
    md5.update(bytes.data(), size);
    md5.finalize();
    for (unsigned i = 0; i < 16; ++i) {
      handle->value[i] =
          needs_md5 ? md5.digest[i] : static_cast<eprosima::fastrtps::rtps::octet>(bytes[i]);
    }
    return true;
  }

  bool is_bounded() const override { return true; }

 private:
  static constexpr std::size_t kEncapsulation = 4;
  static constexpr std::size_t kMaxKeyBytes = 256;
};

}  // namespace tbm::dds
