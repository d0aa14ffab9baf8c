#include "devices/total_station/geocom_protocol.h"

#include <cmath>

#include <fmt/format.h>

#include "pose/base/parse_number.h"

namespace tbm {
namespace {

constexpr std::string_view kReplyHead = "%R1P,";
constexpr std::string_view kRequestHead = "%R1Q,";

// A number without sign, as the manuals write codes; at most nine digits, so that it fits.
std::optional<int> Unsigned(std::string_view text) {
  if (text.empty() || text.size() > 9) return std::nullopt;
  int value = 0;
  for (const char c : text) {
    if (c < '0' || c > '9') return std::nullopt;
    value = value * 10 + (c - '0');
  }
  return value;
}

// Empty when quotes do not close or there are more fields than any call has.
std::optional<GeocomFields> SplitFields(std::string_view text) {
  GeocomFields fields;
  if (text.empty()) return fields;
  std::size_t begin = 0;
  char quote = 0;
  for (std::size_t at = 0; at <= text.size(); ++at) {
    const bool is_end = at == text.size();
    if (!is_end && (text[at] == '"' || text[at] == '\'')) {
      if (quote == 0) {
        quote = text[at];
      } else if (quote == text[at]) {
        quote = 0;
      }
    }
    if (is_end && quote != 0) return std::nullopt;
    if (!is_end && (text[at] != ',' || quote != 0)) continue;
    if (fields.size() == kGeocomMostParameters) return std::nullopt;
    fields.push_back(text.substr(begin, at - begin));
    begin = at + 1;
  }
  return fields;
}

// "%R1x,<a>[,<b>[,<crc>]]:<rest>" taken apart.
struct LineParts {
  int first = 0;
  std::optional<int> transaction;
  bool has_checksum = false;
  std::string_view rest;
};

Result<LineParts, GeocomLineFault> TakeApart(std::string_view line, std::string_view head) {
  const std::size_t start = line.rfind(head);
  if (start == std::string_view::npos) return Failure{GeocomLineFault::kNotForUs};
  line.remove_prefix(start);
  const std::size_t colon = line.find(':');
  if (colon == std::string_view::npos) return Failure{GeocomLineFault::kBadForm};
  const auto numbers = SplitFields(line.substr(head.size(), colon - head.size()));
  if (!numbers || numbers->empty() || numbers->size() > 3) {
    return Failure{GeocomLineFault::kBadForm};
  }
  LineParts parts;
  const auto first = Unsigned((*numbers)[0]);
  if (!first) return Failure{GeocomLineFault::kBadForm};
  parts.first = *first;
  parts.rest = line.substr(colon + 1);
  if (numbers->size() > 1) {
    parts.transaction = Unsigned((*numbers)[1]);
    if (!parts.transaction || *parts.transaction > kLastTransaction) {
      return Failure{GeocomLineFault::kBadForm};
    }
  }
  if (numbers->size() > 2) {
    const auto checksum = Unsigned((*numbers)[2]);
    if (!checksum || *checksum > 0xFFFF) return Failure{GeocomLineFault::kBadForm};
    const std::size_t comma = line.rfind(',', colon);
    std::string without(line.substr(0, comma));
    without += line.substr(colon);
    if (Crc16Arc(without) != *checksum) return Failure{GeocomLineFault::kBadChecksum};
    parts.has_checksum = true;
  }
  return parts;
}

std::string WithChecksum(std::string_view numbers, std::string_view rest, bool with_checksum) {
  std::string plain = fmt::format("{}:{}", numbers, rest);
  if (!with_checksum) return plain;
  return fmt::format("{},{}:{}", numbers, Crc16Arc(plain), rest);
}

}  // namespace

std::uint16_t Crc16Arc(std::string_view text) {
  unsigned crc = 0;
  for (const char c : text) {
    crc ^= static_cast<unsigned char>(c);
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 1u) != 0 ? (crc >> 1u) ^ 0xA001u : crc >> 1u;
  }
  return static_cast<std::uint16_t>(crc);
}

Result<GeocomReply, GeocomLineFault> ParseGeocomReply(std::string_view line, bool wants_checksum) {
  const auto parts = TakeApart(line, kReplyHead);
  if (!parts) return Failure{parts.error()};
  if (!parts->transaction) return Failure{GeocomLineFault::kBadForm};
  auto fields = SplitFields(parts->rest);
  if (!fields || fields->empty()) return Failure{GeocomLineFault::kBadForm};
  const auto return_code = Unsigned(fields->front());
  if (!return_code) return Failure{GeocomLineFault::kBadForm};
  if (wants_checksum && !parts->has_checksum) return Failure{GeocomLineFault::kNoChecksum};
  GeocomReply reply{parts->first, *parts->transaction, parts->has_checksum, *return_code, {}};
  fields->erase(fields->begin());
  reply.parameters = std::move(*fields);
  return reply;
}

Result<GeocomRequest, GeocomLineFault> ParseGeocomRequest(std::string_view line) {
  const auto parts = TakeApart(line, kRequestHead);
  if (!parts) return Failure{parts.error()};
  auto fields = SplitFields(parts->rest);
  if (!fields) return Failure{GeocomLineFault::kBadForm};
  return GeocomRequest{
      parts->first, parts->transaction.value_or(0), parts->has_checksum, std::move(*fields)};
}

std::string EncodeGeocomRequest(int rpc,
                                int transaction,
                                std::string_view parameters,
                                bool with_checksum) {
  const std::string numbers = fmt::format("{}{},{}", kRequestHead, rpc, transaction);
  return "\n" + WithChecksum(numbers, parameters, with_checksum) + "\r\n";
}

std::string EncodeGeocomReply(int com_code,
                              int transaction,
                              std::string_view values,
                              bool with_checksum) {
  const std::string numbers = fmt::format("{}{},{}", kReplyHead, com_code, transaction);
  return WithChecksum(numbers, values, with_checksum) + "\r\n";
}

std::optional<double> GeocomReal(std::string_view field) {
  const auto value = ParseReal(field);
  if (!value || !std::isfinite(*value)) return std::nullopt;
  return value;
}

std::optional<std::int64_t> GeocomInteger(std::string_view field) { return ParseInteger(field); }

std::optional<int> GeocomByte(std::string_view field) {
  if (field.size() != 4 || field.front() != '\'' || field.back() != '\'') return std::nullopt;
  int value = 0;
  for (const char c : field.substr(1, 2)) {
    const int digit = c >= '0' && c <= '9'   ? c - '0'
                      : c >= 'A' && c <= 'F' ? c - 'A' + 10
                      : c >= 'a' && c <= 'f' ? c - 'a' + 10
                                             : -1;
    if (digit < 0) return std::nullopt;
    value = value * 16 + digit;
  }
  return value;
}

std::optional<std::string> GeocomText(std::string_view field) {
  if (field.size() < 2 || field.front() != '"' || field.back() != '"') return std::nullopt;
  const std::string_view inside = field.substr(1, field.size() - 2);
  for (const char c : inside) {
    if (c < 0x20 || c > 0x7e || c == '"') return std::nullopt;
  }
  return std::string(inside);
}

std::string GeocomNumber(double value) { return fmt::format("{}", value); }

std::optional<std::string_view> GeocomLineCutter::Push(char byte) {
  if (is_done_) {
    held_.clear();
    is_done_ = false;
  }
  if (byte == '\r' || byte == '\n') {
    if (is_too_long_) {
      is_too_long_ = false;
      ++lines_too_long_;
      return std::nullopt;
    }
    if (held_.empty()) return std::nullopt;
    is_done_ = true;
    return held_;
  }
  if (is_too_long_) return std::nullopt;
  if (held_.size() == kGeocomLineLimit) {
    is_too_long_ = true;
    held_.clear();
    return std::nullopt;
  }
  held_.push_back(byte);
  return std::nullopt;
}

void GeocomLineCutter::Reset() {
  held_.clear();
  is_done_ = is_too_long_ = false;
}

}  // namespace tbm
