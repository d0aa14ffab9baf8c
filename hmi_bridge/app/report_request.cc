#include "hmi_bridge/app/report_request.h"

#include <algorithm>
#include <array>
#include <ctime>
#include <utility>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "hmi_bridge/server/json_text.h"
#include "idl/cpp/topics.h"

namespace tbm::hmi {
namespace {

constexpr std::size_t kDeepest = 4;
constexpr std::size_t kMostShots_bytes = 200'000;
constexpr std::size_t kMostPoints = 16;
// A day of one topic is what a table program can still open.
constexpr std::int64_t kLongestExport_ms = 24 * 3600 * 1000;
constexpr std::int64_t kLatest_utc_ms = 4'102'444'800'000;  // 2100

Failure<ApiFault> Bad(std::string text) {
  return Failure<ApiFault>{ApiFault{400, "bad_request", std::move(text)}};
}

// A word that goes to a command line: no option, no path.
bool IsPlainWord(std::string_view word) {
  return !word.empty() && word.size() <= 32 && word.front() != '-' && word.front() != '.' &&
         std::all_of(word.begin(), word.end(), [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                  c == '_' || c == '-' || c == '.';
         });
}

std::string TopicWord(const dds::TopicRow& topic) {
  return std::string(topic.name.substr(topic.name.rfind('/') + 1));
}

std::optional<std::vector<std::string>> WordsOf(const nlohmann::json& body, const char* key) {
  std::vector<std::string> words;
  const auto list = body.find(key);
  if (list == body.end()) return words;
  if (!list->is_array() || list->size() > kMostPoints) return {};
  for (const auto& word : *list) {
    if (!word.is_string() || !IsPlainWord(word.get_ref<const std::string&>())) return {};
    words.push_back(word);
  }
  return words;
}

std::optional<std::int64_t> TimeOf(const nlohmann::json& body, const char* key) {
  const auto time = body.find(key);
  if (time == body.end() || !time->is_number()) return {};
  const double value = time->get<double>();
  if (!(value >= 0.0 && value <= static_cast<double>(kLatest_utc_ms))) return {};
  return static_cast<std::int64_t>(value);
}

// "2026-11-23T14:05:00Z", as tbm reads it; the second that holds the moment.
std::string TimeText(std::int64_t utc_ms) {
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(static_cast<std::time_t>(utc_ms / 1000)));
}

Result<ReportRequest, ApiFault> ParseAccuracy(const nlohmann::json& body) {
  ReportRequest request;
  request.kind = ReportKind::kAccuracy;
  const auto points = WordsOf(body, "points");
  if (!points) return Bad("points: a list of up to 16 names of guided points");
  request.points = *points;
  const auto shots = body.find("shots_text");
  if (shots == body.end() || !shots->is_string()) {
    return Bad("shots_text: the text of the total station's file, CSV or GSI");
  }
  request.shots_text = *shots;
  if (request.shots_text.empty() || request.shots_text.size() > kMostShots_bytes) {
    return Bad(fmt::format("shots_text: 1 to {} bytes", kMostShots_bytes));
  }
  if (body.contains("at_utc_ms")) {
    request.at_utc_ms = TimeOf(body, "at_utc_ms");
    if (!request.at_utc_ms) return Bad("at_utc_ms: milliseconds since 1970");
  }
  return request;
}

Result<ReportRequest, ApiFault> ParseExport(const nlohmann::json& body) {
  ReportRequest request;
  request.kind = ReportKind::kExport;
  const auto topics = WordsOf(body, "topics");
  if (!topics || topics->empty()) return Bad("topics: at least one, such as [\"guidance\"]");
  for (const std::string& topic : *topics) {
    const bool is_known =
        std::any_of(dds::kTopics.begin(), dds::kTopics.end(), [&](const dds::TopicRow& row) {
          return TopicWord(row) == topic;
        });
    if (!is_known) return Bad("topics: there is no topic '" + topic + "'");
  }
  request.topics = *topics;
  const auto from = TimeOf(body, "from_utc_ms");
  const auto to = TimeOf(body, "to_utc_ms");
  if (!from || !to || *from >= *to || *to - *from > kLongestExport_ms) {
    return Bad("from_utc_ms, to_utc_ms: milliseconds since 1970, at most 24 hours apart");
  }
  request.from_utc_ms = *from;
  request.to_utc_ms = *to;
  return request;
}

void AppendOption(std::string_view option, const std::string& value, Arguments* arguments) {
  if (value.empty()) return;
  arguments->push_back(fmt::format("{}={}", option, value));
}

}  // namespace

std::string_view WordOf(ReportKind kind) {
  switch (kind) {
    case ReportKind::kAxisCheck:
      return "axis_check";
    case ReportKind::kAccuracy:
      return "accuracy";
    case ReportKind::kExport:
      return "export";
  }
  return "";
}

Result<ReportRequest, ApiFault> ParseReportRequest(std::string_view json) {
  if (NestsDeeperThan(json, kDeepest)) return Bad("the body is nested too deep");
  const auto body = nlohmann::json::parse(json, nullptr, false);
  if (!body.is_object()) return Bad("the body is no JSON object");
  const auto kind = body.find("kind");
  const std::string word =
      kind != body.end() && kind->is_string() ? kind->get<std::string>() : std::string();
  if (word == WordOf(ReportKind::kAxisCheck)) return ReportRequest{};
  if (word == WordOf(ReportKind::kAccuracy)) return ParseAccuracy(body);
  if (word == WordOf(ReportKind::kExport)) return ParseExport(body);
  return Bad("kind: axis_check, accuracy or export");
}

Result<std::vector<Arguments>, ApiFault> CommandsOf(const ReportRequest& request,
                                                    const ReportPlaces& places) {
  if (request.kind == ReportKind::kAxisCheck) {
    Arguments check = {places.tbm_program, "axis", "check", places.axis_file};
    Arguments plot = {places.tbm_program, "axis", "plot", places.axis_file, "--out=axis.png"};
    for (Arguments* command : {&check, &plot}) {
      AppendOption("--alignment", places.axis_options.alignment, command);
      AppendOption("--profile", places.axis_options.profile, command);
      const Eigen::Vector3d& origin = places.axis_options.site_origin;
      if (origin.isZero()) continue;
      command->push_back("--origin");
      for (int i = 0; i < 3; ++i) command->push_back(fmt::format("{}", origin[i]));
    }
    return std::vector<Arguments>{check, plot};
  }
  if (places.journal_folder.empty()) {
    return Bad("this console knows of no journal: `journal` of hmi_bridge.yaml names its folder");
  }
  Arguments command;
  if (request.kind == ReportKind::kAccuracy) {
    command = {places.tbm_program, "check", places.journal_folder, "shots.txt", "--report=."};
    for (const std::string& point : request.points) AppendOption("--point", point, &command);
    if (request.at_utc_ms) AppendOption("--at", TimeText(*request.at_utc_ms), &command);
    command.push_back("--force");
  } else {
    command = {places.tbm_program, "export", places.journal_folder, "--out=."};
    for (const std::string& topic : request.topics) AppendOption("--topic", topic, &command);
    AppendOption("--from", TimeText(request.from_utc_ms), &command);
    AppendOption("--to", TimeText(request.to_utc_ms + 999), &command);
    command.push_back("--force");
  }
  return std::vector<Arguments>{command};
}

}  // namespace tbm::hmi
