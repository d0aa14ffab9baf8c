#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pose/base/result.h"

namespace tbm {

// Leica GeoCOM, ASCII form (TPS1100 and TPS1200 GeoCOM reference manuals):
//
//   request  <LF>%R1Q,<rpc>,<transaction>[,<crc>]:<p0>,<p1>..<CR><LF>
//   reply    %R1P,<com code>,<transaction>[,<crc>]:<return code>[,<p0>,<p1>..]<CR><LF>
//
// The leading LF empties the instrument's receive buffer of what noise has left there. Angles are
// radians, lengths metres, a byte is two hex digits in quotes, text stands in quotes. The checksum
// is CRC-16/ARC in decimal over the line without the checksum field and without its end.

// Beyond it the instrument's counter overflows; 0 is what an instrument says when it was sent none.
inline constexpr int kLastTransaction = 32767;
// No reply of the calls used here is longer than a tenth of it.
inline constexpr std::size_t kGeocomLineLimit = 4096;
// Parameters of one line that are looked at; no call has half as many.
inline constexpr std::size_t kGeocomMostParameters = 32;

std::uint16_t Crc16Arc(std::string_view text);

inline int NextTransaction(int transaction) {
  return transaction >= kLastTransaction || transaction < 1 ? 1 : transaction + 1;
}

// Why a line is no sound request or reply.
enum class GeocomLineFault {
  kNotForUs,     // no "%R1P," (or "%R1Q,") in it: noise, a wake-up message, the tail of a line
  kBadForm,      // begins like one and is not: cut, or damaged
  kNoChecksum,   // whole, but without the checksum that was asked for
  kBadChecksum,  // whole, but not what was sent
};

// The fields between commas, as they stand; quotes kept, commas inside quotes do not separate.
// An empty text has no fields.
using GeocomFields = std::vector<std::string_view>;

struct GeocomReply {
  int com_code = 0;     // of the transport: not 0 means that the call was not carried out
  int transaction = 0;  // of the request it answers; 0 when the instrument could not read it
  bool has_checksum = false;
  int return_code = 0;
  GeocomFields parameters;  // point into the line
};

// `line` is without its end. What stands before the last "%R1P," is passed over: noise, or a reply
// that has lost its end. With `wants_checksum` a reply without one is a fault.
Result<GeocomReply, GeocomLineFault> ParseGeocomReply(std::string_view line, bool wants_checksum);

struct GeocomRequest {
  int rpc = 0;
  int transaction = 0;  // 0: none was sent
  bool has_checksum = false;
  GeocomFields parameters;  // point into the line
};

// The instrument's side. A checksum that is there must be right.
Result<GeocomRequest, GeocomLineFault> ParseGeocomRequest(std::string_view line);

// Whole lines with LF in front and CR LF behind. `parameters` are joined by commas already.
std::string EncodeGeocomRequest(int rpc,
                                int transaction,
                                std::string_view parameters,
                                bool with_checksum);
// The instrument's side, without LF in front. `values` begin with the return code.
std::string EncodeGeocomReply(int com_code,
                              int transaction,
                              std::string_view values,
                              bool with_checksum);

// One field as what it should be; empty when it is not. Numbers are finite.
std::optional<double> GeocomReal(std::string_view field);
std::optional<std::int64_t> GeocomInteger(std::string_view field);
std::optional<int> GeocomByte(std::string_view field);          // '1F'
std::optional<std::string> GeocomText(std::string_view field);  // "TS16"

// A number as a request carries it: the shortest text that means exactly this double.
std::string GeocomNumber(double value);

// Cuts a stream into lines at CR or LF. Empty lines vanish. A line longer than kGeocomLineLimit is
// thrown away whole.
class GeocomLineCutter {
 public:
  // The line that `byte` ends, without its end; valid until the next Push or Reset.
  std::optional<std::string_view> Push(char byte);
  void Reset();
  std::size_t bytes_held() const { return is_done_ ? 0 : held_.size(); }
  std::uint64_t lines_too_long() const { return lines_too_long_; }

 private:
  std::string held_;
  bool is_done_ = false;      // held_ was handed out and goes with the next byte
  bool is_too_long_ = false;  // until the next end of a line
  std::uint64_t lines_too_long_ = 0;
};

}  // namespace tbm
