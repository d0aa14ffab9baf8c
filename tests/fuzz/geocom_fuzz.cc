// Arbitrary bytes as an instrument's replies and as a client's requests: what is taken for sound
// can be written again and is then the same.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>

#include "devices/total_station/geocom_codes.h"
#include "devices/total_station/geocom_protocol.h"

namespace {

using namespace tbm;

void LookAtFields(const GeocomFields& fields) {
  if (fields.size() > kGeocomMostParameters) std::abort();
  for (const std::string_view field : fields) {
    const auto real = GeocomReal(field);
    if (real && GeocomReal(GeocomNumber(*real)) != real) std::abort();
    (void)GeocomInteger(field);
    const auto byte = GeocomByte(field);
    if (byte && (*byte < 0 || *byte > 255)) std::abort();
    (void)GeocomText(field);
  }
}

std::string Joined(int code, const GeocomFields& fields) {
  std::string joined = std::to_string(code);
  for (const std::string_view field : fields) joined.append(",").append(field);
  return joined;
}

void LookAtReply(std::string_view line) {
  const auto reply = ParseGeocomReply(line, false);
  const auto strict = ParseGeocomReply(line, true);
  if (strict && !(reply && reply->has_checksum)) std::abort();
  if (!reply) return;
  if (reply->transaction < 0 || reply->transaction > kLastTransaction) std::abort();
  LookAtFields(reply->parameters);
  (void)FailureOfGeocomCode(reply->return_code);
  (void)PartsOfGeocomCode(reply->com_code);
  std::string again = EncodeGeocomReply(
      reply->com_code, reply->transaction, Joined(reply->return_code, reply->parameters), true);
  again.resize(again.size() - 2);
  const auto second = ParseGeocomReply(again, true);
  if (!second || second->parameters != reply->parameters ||
      second->return_code != reply->return_code) {
    std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  GeocomLineCutter cutter;
  for (std::size_t i = 0; i < size; ++i) {
    const auto line = cutter.Push(static_cast<char>(data[i]));
    if (cutter.bytes_held() > kGeocomLineLimit) std::abort();
    if (!line) continue;
    LookAtReply(*line);
    if (const auto request = ParseGeocomRequest(*line)) LookAtFields(request->parameters);
  }
  return 0;
}
