#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

#include "hmi_bridge/server/auth_files.h"
#include "hmi_bridge/server/foxglove.h"
#include "hmi_bridge/server/http_message.h"
#include "hmi_bridge/server/origin.h"
#include "hmi_bridge/server/query.h"

namespace {

using namespace tbm::hmi;

void Require(bool holds) {
  if (!holds) __builtin_trap();
}

// What a tool says, line by line: answers are JSON, counts of listeners never go wrong.
void TryFoxglove(std::string_view text) {
  FoxgloveSubscriptions subscriptions(3);
  int listening[3] = {0, 0, 0};
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const auto outcome = subscriptions.TakeText(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    for (const std::string& answer : outcome.answers) {
      Require(nlohmann::json::accept(answer));
    }
    for (const std::size_t channel : outcome.begun) ++listening[channel];
    for (const std::size_t channel : outcome.ended) --listening[channel];
  }
  for (std::size_t channel = 0; channel < 3; ++channel) {
    int subscribed = 0;
    subscriptions.Each(channel, [&](std::uint32_t) { ++subscribed; });
    Require(listening[channel] == (subscribed > 0 ? 1 : 0));
  }
}

void TryQuestions(std::string_view text) {
  if (const auto history = ParseHistoryQuestion(text)) {
    Require(!history->point.empty() && history->most >= 2 && history->most <= 5000);
    Require(history->from_utc_ms >= 0.0 && history->from_utc_ms <= history->to_utc_ms);
  } else {
    Require(history.error().http_status == 400 && !history.error().text.empty());
  }
  if (const auto advance = ParseAdvanceQuestion(text)) {
    Require(advance->length_m >= 0.1 && advance->length_m <= 1000.0);
  }
  if (const auto decoded = PercentDecoded(text)) {
    Require(decoded->find('\0') == std::string::npos && decoded->size() <= text.size());
  }
}

void TryHeaders(std::string_view text) {
  for (const std::string& value : CookieValues(text, "tbm_session")) {
    Require(value.find(';') == std::string::npos);
  }
  ListHolds(text, "tbm.console.v1");
  TakesGzip(text);
  BearerToken(text);
  IsJson(text);
  if (const auto name = HostName(text)) {
    Require(!name->empty() && name->find_first_of("/@[] \r\n") == std::string::npos);
  }
}

// A file that is taken is written and read back the same.
template <class Parse>
void TryFile(std::string_view text, Parse parse) {
  const auto rows = parse(text, "fuzz.json");
  if (!rows) {
    Require(rows.error().starts_with("fuzz.json: "));
    return;
  }
  const std::string written = TextOf(*rows);
  const auto again = parse(written, "fuzz.json");
  Require(again.has_value() && TextOf(*again) == written);
}

}  // namespace

// The first byte says what the rest is.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view text(reinterpret_cast<const char*>(data) + 1, size - 1);
  switch (data[0]) {
    case 'f':
      TryFoxglove(text);
      break;
    case 'q':
      TryQuestions(text);
      break;
    case 'h':
      TryHeaders(text);
      break;
    case 'u':
      TryFile(text, ParseUsers);
      break;
    case 's':
      TryFile(text, ParseSessions);
      break;
    case 't':
      TryFile(text, ParseReadTokens);
      break;
    case 'c':
      if (const auto command = ParseCommand(text)) {
        Require(command->addressee.size() + command->verb.size() <= size);
      }
      break;
    case 'l':
      if (const auto login = ParseLogin(text)) Require(login->name.size() <= size);
      break;
    default:
      break;
  }
  return 0;
}
