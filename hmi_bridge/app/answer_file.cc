#include "hmi_bridge/app/answer_file.h"

#include <cstdint>
#include <optional>

#include <nlohmann/json.hpp>

namespace tbm::hmi {
namespace {

constexpr std::string_view kFile = "answers.json";

}  // namespace

std::string AnswerText(const std::map<std::string, Answer>& answers) {
  nlohmann::ordered_json text = nlohmann::ordered_json::object();
  for (const auto& [key, answer] : answers) {
    text[key] = {{"event_at_utc_ns", answer.event_at.ns}, {"by", answer.by}};
  }
  return text.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

std::map<std::string, Answer> AnswersFrom(std::string_view text) {
  std::map<std::string, Answer> answers;
  const auto read = nlohmann::json::parse(text, nullptr, false);
  if (!read.is_object()) return answers;
  for (const auto& [key, value] : read.items()) {
    if (!value.is_object()) continue;
    const auto at = value.find("event_at_utc_ns");
    const auto by = value.find("by");
    if (at == value.end() || !at->is_number_integer() || by == value.end() || !by->is_string()) {
      continue;
    }
    answers[key] = {Timestamp{at->get<std::int64_t>()}, by->get<std::string>()};
  }
  return answers;
}

std::map<std::string, Answer> AnswerFile::Load() const {
  const auto content = folder_.Read(kFile);
  if (!content || !content.value()) return {};
  return AnswersFrom(content.value()->text);
}

void AnswerFile::Keep(const std::map<std::string, Answer>& answers) const {
  (void)folder_.Write(kFile, AnswerText(answers));
}

}  // namespace tbm::hmi
