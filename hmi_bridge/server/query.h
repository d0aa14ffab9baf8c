#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "hmi_bridge/server/console_source.h"
#include "pose/base/result.h"

namespace tbm::hmi {

// "%41" and '+' undone. Empty where a '%' is not followed by two hexadecimal digits, or stands for
// a control character.
std::optional<std::string> PercentDecoded(std::string_view text);

// What stands behind the '?', each name once.
class Query {
 public:
  static Result<Query, ApiFault> Parse(std::string_view text);

  // Refuses names that are not among these.
  std::optional<ApiFault> OnlyThese(std::initializer_list<std::string_view> names) const;
  const std::string* Find(std::string_view name) const;

 private:
  std::vector<std::pair<std::string, std::string>> pairs_;
};

// Questions of openapi.yaml; a fault names the parameter.
Result<HistoryQuestion, ApiFault> ParseHistoryQuestion(std::string_view query);
Result<AdvanceQuestion, ApiFault> ParseAdvanceQuestion(std::string_view query);

// Bodies of openapi.yaml; a fault names the key.
struct LoginRequest {
  std::string name;
  std::string password;
};
Result<LoginRequest, ApiFault> ParseLogin(std::string_view body);
Result<CommandRequest, ApiFault> ParseCommand(std::string_view body);

}  // namespace tbm::hmi
