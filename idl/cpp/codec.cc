#include "idl/cpp/codec.h"

#include <array>
#include <utility>

#include "idl/cpp/wire_type.h"

namespace tbm::dds {
namespace {

constexpr std::pair<std::string_view, std::string_view> kIdlTexts[] = {
#include "tbm_idl/idl_texts.inc"
};

}  // namespace

template <class Message>
BoundaryFault EncodeCdr(const Message& message, std::vector<std::byte>* bytes) {
  using Wire = typename WireOf<Message>::Type;
  bytes->clear();
  WireSample<Wire> sample;
  ToWire(message, sample.value);
  if (const BoundaryFault fault = Check(sample.value); fault != BoundaryFault::kNone) return fault;
  WireType<Message> type;
  eprosima::fastrtps::rtps::SerializedPayload_t payload(type.getSerializedSizeProvider(&sample)());
  if (!type.serialize(&sample, &payload)) return BoundaryFault::kTooLong;
  const std::byte* begin = reinterpret_cast<const std::byte*>(payload.data);
  bytes->assign(begin, begin + payload.length);
  return BoundaryFault::kNone;
}

template <class Message>
BoundaryFault DecodeCdr(std::span<const std::byte> bytes, Message* message) {
  WireSample<typename WireOf<Message>::Type> sample;
  if (!Decode(reinterpret_cast<const char*>(bytes.data()), bytes.size(), sample)) {
    return BoundaryFault::kMalformed;
  }
  if (const BoundaryFault fault = Check(sample.value); fault != BoundaryFault::kNone) return fault;
  FromWire(sample.value, *message);
  return BoundaryFault::kNone;
}

std::string_view IdlTextOf(std::string_view type) {
  for (const auto& [name, text] : kIdlTexts) {
    if (name == type) return text;
  }
  return {};
}

// NOLINTNEXTLINE(bugprone-macro-parentheses): a type
#define TBM_CODEC_OF(Message)                                                         \
  template BoundaryFault EncodeCdr<Message>(const Message&, std::vector<std::byte>*); \
  template BoundaryFault DecodeCdr<Message>(std::span<const std::byte>, Message*)
TBM_CODEC_OF(FrameFeatures);
TBM_CODEC_OF(TiltReading);
TBM_CODEC_OF(RelativePose);
TBM_CODEC_OF(DeviceHealth);
TBM_CODEC_OF(Event);
TBM_CODEC_OF(StationObservation);
TBM_CODEC_OF(StationSetUp);
TBM_CODEC_OF(ShieldPose);
TBM_CODEC_OF(Guidance);
TBM_CODEC_OF(AlarmStatus);
TBM_CODEC_OF(Command);
TBM_CODEC_OF(CommandReply);
TBM_CODEC_OF(TrolleyState);
TBM_CODEC_OF(RailLinePiece);
TBM_CODEC_OF(SettlementPiece);
TBM_CODEC_OF(CalibrationStatus);
#undef TBM_CODEC_OF

}  // namespace tbm::dds
