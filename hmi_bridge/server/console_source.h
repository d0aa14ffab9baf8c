#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "pose/base/time.h"

namespace tbm::hmi {

// Who may what; each role contains those before it.
enum class Role { kViewer, kOperator, kSurveyor };

// "viewer", "operator", "surveyor".
constexpr std::string_view Word(Role role) {
  switch (role) {
    case Role::kViewer:
      return "viewer";
    case Role::kOperator:
      return "operator";
    case Role::kSurveyor:
      return "surveyor";
  }
  return "";
}

// One part of what consoles show (openapi.yaml, `Sections`), made into text once for all of them.
struct Section {
  std::string_view name;      // outlives the source
  std::uint64_t version = 0;  // grows with each change; 0: there is nothing yet
  std::shared_ptr<const std::string> json;
};

// All sections, and the moment they are of.
struct Picture {
  std::vector<Section> sections;
  double at_utc_ms = 0.0;
  double at_steady_ms = 0.0;
};

// An answer to a question that may be wrong.
struct ApiFault {
  int http_status = 400;
  std::string code;  // openapi.yaml, `Error`
  std::string text;  // a sentence for the person
};
using ApiAnswer = std::variant<std::string, ApiFault>;  // JSON, or why not

// Later than every row; a double and an std::int64_t hold it exactly.
inline constexpr double kEndOfTime_utc_ms = 1e15;

// Numbers are finite and within openapi.yaml's bounds. Without bounds of time it is everything.
struct HistoryQuestion {
  std::string point;
  double from_utc_ms = 0.0;
  double to_utc_ms = kEndOfTime_utc_ms;
  int most = 1000;
};

struct AdvanceQuestion {
  std::string point;
  double length_m = 50.0;
};

// A command as a person asks for it; lengths and characters are not checked yet.
struct CommandRequest {
  std::string addressee;
  std::string verb;
  std::string argument;
  std::string because;
};

// What the server serves, from whoever hears it. Called from the server's threads, several at once.
class ConsoleSource {
 public:
  virtual ~ConsoleSource() = default;

  virtual Picture Now() = 0;
  virtual ApiAnswer History(const HistoryQuestion& question) = 0;
  virtual ApiAnswer Advance(const AdvanceQuestion& question) = 0;
  // Sends it for `user`, whose role was checked by the source: it alone knows the verbs. JSON with
  // the request's id, or the refusal. Writes the audit log either way.
  virtual ApiAnswer Ask(const CommandRequest& request, const std::string& user, Role role) = 0;
  // The surveyor's reports (openapi.yaml, /api/reports): JSON with the new one's id, or the
  // refusal; a file of one, or null when there is none of this name.
  virtual ApiAnswer StartReport(std::string_view json, const std::string& user, Role role) {
    (void)json, (void)user, (void)role;
    return ApiFault{404, "not_found", "this console makes no reports"};
  }
  virtual std::shared_ptr<const std::string> ReportFile(std::string_view id,
                                                        std::string_view name) {
    (void)id, (void)name;
    return nullptr;
  }
  // In Prometheus' text format, without the server's own.
  virtual std::string Metrics() = 0;
};

// One topic as foxglove.websocket.v1 advertises it.
struct RawChannel {
  std::string topic;
  std::string schema_name;
  std::string schema_text;  // omgidl
};

// What a tool may listen to, sample by sample.
class RawSource {
 public:
  virtual ~RawSource() = default;
  // Index in this list is the channel's id; never changes.
  virtual const std::vector<RawChannel>& Channels() const = 0;
};

}  // namespace tbm::hmi
