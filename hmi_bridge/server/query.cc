#include "hmi_bridge/server/query.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "hmi_bridge/server/json_text.h"
#include "hmi_bridge/server/secrets.h"
#include "pose/base/parse_number.h"

namespace tbm::hmi {
namespace {

constexpr std::size_t kMostParameters = 16;
constexpr std::size_t kMostPointName = 64;

ApiFault Bad(std::string text) { return {400, "bad_request", std::move(text)}; }

char LowerHex(char c) { return c >= 'A' && c <= 'F' ? static_cast<char>(c + ('a' - 'A')) : c; }

Result<std::string, ApiFault> PointOf(const Query& query) {
  const std::string* point = query.Find("point");
  if (point == nullptr || point->empty()) return Failure{Bad("point is missing")};
  if (point->size() > kMostPointName) return Failure{Bad("point is no name")};
  return *point;
}

// Replaces `value` when the parameter is there.
std::optional<ApiFault> TakeNumber(
    const Query& query, std::string_view name, double least, double most, double& value) {
  const std::string* text = query.Find(name);
  if (text == nullptr) return std::nullopt;
  const auto number = ParseReal(*text);
  if (!number || !std::isfinite(*number) || *number < least || *number > most) {
    return Bad(fmt::format("{} must be a number from {} to {}", name, least, most));
  }
  value = *number;
  return std::nullopt;
}

// The texts of an object that has no others; `required` ones must be there.
Result<std::vector<std::pair<std::string, std::string>>, ApiFault> Texts(
    std::string_view body,
    std::initializer_list<std::string_view> required,
    std::initializer_list<std::string_view> optional) {
  if (NestsDeeperThan(body, 1)) return Failure{Bad("the body must be an object of texts")};
  const auto json = nlohmann::json::parse(body.begin(), body.end(), nullptr, false);
  if (!json.is_object()) return Failure{Bad("the body must be a JSON object")};
  std::vector<std::pair<std::string, std::string>> texts;
  for (const auto& [key, value] : json.items()) {
    const auto is_this = [&key = key](std::string_view name) { return name == key; };
    const bool is_known = std::any_of(required.begin(), required.end(), is_this) ||
                          std::any_of(optional.begin(), optional.end(), is_this);
    if (!is_known) return Failure{Bad(fmt::format("{} is not known", key.substr(0, 40)))};
    if (!value.is_string()) return Failure{Bad(fmt::format("{} must be a text", key))};
    texts.emplace_back(key, value.get<std::string>());
  }
  for (const std::string_view name : required) {
    if (!json.contains(name)) return Failure{Bad(fmt::format("{} is missing", name))};
  }
  return texts;
}

}  // namespace

std::optional<std::string> PercentDecoded(std::string_view text) {
  std::string decoded;
  for (std::size_t i = 0; i < text.size(); ++i) {
    char c = text[i] == '+' ? ' ' : text[i];
    if (c == '%') {
      if (i + 2 >= text.size()) return std::nullopt;
      const auto byte = FromHex(std::string{LowerHex(text[i + 1]), LowerHex(text[i + 2])});
      if (!byte) return std::nullopt;
      c = (*byte)[0];
      i += 2;
    }
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) return std::nullopt;
    decoded += c;
  }
  return decoded;
}

Result<Query, ApiFault> Query::Parse(std::string_view text) {
  Query query;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('&'), text.size());
    const std::string_view pair = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    const std::size_t mark = pair.find('=');
    const auto name = PercentDecoded(pair.substr(0, mark));
    const auto value = PercentDecoded(mark == std::string_view::npos ? "" : pair.substr(mark + 1));
    if (!name || !value) return Failure{Bad("a parameter is not percent-encoded rightly")};
    if (name->empty()) return Failure{Bad("a parameter has no name")};
    if (query.Find(*name) != nullptr) {
      return Failure{Bad(fmt::format("{} is there twice", name->substr(0, 40)))};
    }
    if (query.pairs_.size() >= kMostParameters) return Failure{Bad("too many parameters")};
    query.pairs_.emplace_back(*name, *value);
  }
  return query;
}

std::optional<ApiFault> Query::OnlyThese(std::initializer_list<std::string_view> names) const {
  for (const auto& [name, value] : pairs_) {
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      return Bad(fmt::format("{} is not known", name.substr(0, 40)));
    }
  }
  return std::nullopt;
}

const std::string* Query::Find(std::string_view name) const {
  for (const auto& pair : pairs_) {
    if (pair.first == name) return &pair.second;
  }
  return nullptr;
}

Result<HistoryQuestion, ApiFault> ParseHistoryQuestion(std::string_view text) {
  const auto query = Query::Parse(text);
  if (!query) return Failure{query.error()};
  if (const auto fault = query->OnlyThese({"point", "from_utc_ms", "to_utc_ms", "most"})) {
    return Failure{*fault};
  }
  auto point = PointOf(*query);
  if (!point) return Failure{point.error()};
  HistoryQuestion question;
  question.point = *point;
  double most = question.most;
  auto fault = TakeNumber(*query, "from_utc_ms", 0.0, kEndOfTime_utc_ms, question.from_utc_ms);
  if (!fault) fault = TakeNumber(*query, "to_utc_ms", 0.0, kEndOfTime_utc_ms, question.to_utc_ms);
  if (!fault) fault = TakeNumber(*query, "most", 2, 5000, most);
  if (!fault && most != std::floor(most)) fault = Bad("most must be a whole number from 2 to 5000");
  if (!fault && question.from_utc_ms > question.to_utc_ms) {
    fault = Bad("from_utc_ms is after to_utc_ms");
  }
  if (fault) return Failure{*fault};
  question.most = static_cast<int>(most);
  return question;
}

Result<AdvanceQuestion, ApiFault> ParseAdvanceQuestion(std::string_view text) {
  const auto query = Query::Parse(text);
  if (!query) return Failure{query.error()};
  if (const auto fault = query->OnlyThese({"point", "length_m"})) return Failure{*fault};
  auto point = PointOf(*query);
  if (!point) return Failure{point.error()};
  AdvanceQuestion question;
  question.point = *point;
  if (const auto fault = TakeNumber(*query, "length_m", 0.1, 1000.0, question.length_m)) {
    return Failure{*fault};
  }
  return question;
}

Result<LoginRequest, ApiFault> ParseLogin(std::string_view body) {
  const auto texts = Texts(body, {"name", "password"}, {});
  if (!texts) return Failure{texts.error()};
  LoginRequest login;
  for (const auto& [key, text] : *texts) (key == "name" ? login.name : login.password) = text;
  return login;
}

Result<CommandRequest, ApiFault> ParseCommand(std::string_view body) {
  const auto texts = Texts(body, {"addressee", "verb"}, {"argument", "because"});
  if (!texts) return Failure{texts.error()};
  CommandRequest command;
  for (const auto& [key, text] : *texts) {
    if (key == "addressee") command.addressee = text;
    if (key == "verb") command.verb = text;
    if (key == "argument") command.argument = text;
    if (key == "because") command.because = text;
  }
  return command;
}

}  // namespace tbm::hmi
