#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "hmi_bridge/server/console_source.h"

namespace tbm::hmi::test {

// Three sections that change when told. Operators may `acknowledge`, surveyors all else.
class FakeSource final : public ConsoleSource {
 public:
  Picture Now() override {
    const std::lock_guard lock(mutex_);
    return {sections_, 1'790'000'000'000.25, 4000.5};
  }
  ApiAnswer History(const HistoryQuestion& question) override {
    const std::lock_guard lock(mutex_);
    history_ = question;
    if (question.point != "cutter_face") {
      return ApiFault{400, "unknown_point", "there is no such point"};
    }
    return std::string(R"({"point":"cutter_face","columns":{}})");
  }
  ApiAnswer Advance(const AdvanceQuestion& question) override {
    const std::lock_guard lock(mutex_);
    advance_ = question;
    return std::string(R"({"point":"cutter_face","columns":{}})");
  }
  ApiAnswer Ask(const CommandRequest& request, const std::string& user, Role role) override {
    const std::lock_guard lock(mutex_);
    asked_.push_back(user + "/" + request.addressee + "/" + request.verb + "/" + request.argument +
                     "/" + request.because);
    const Role needed = request.verb == "acknowledge" ? Role::kOperator : Role::kSurveyor;
    if (role < needed) return ApiFault{403, "forbidden", "your role may not"};
    return std::string(R"({"request_id":"r1"})");
  }
  ApiAnswer StartReport(std::string_view json, const std::string& user, Role role) override {
    const std::lock_guard lock(mutex_);
    if (role < Role::kSurveyor) return ApiFault{403, "forbidden", "reports are for surveyors"};
    asked_.push_back(user + " wants a report of " + std::to_string(json.size()) + " bytes");
    return std::string(R"({"report_id":"7"})");
  }
  std::shared_ptr<const std::string> ReportFile(std::string_view id,
                                                std::string_view name) override {
    // Whatever else a name leads to is there: it is not to be asked for.
    if (id == "8" || name == "none.csv") return nullptr;
    return std::make_shared<const std::string>("chainage_m\n");
  }
  std::string Metrics() override { return "tbm_fake 1\n"; }

  // Sets a section and makes it news.
  void Put(std::string_view name, std::string json) {
    const std::lock_guard lock(mutex_);
    for (Section& section : sections_) {
      if (section.name != name) continue;
      ++section.version;
      section.json = std::make_shared<const std::string>(std::move(json));
    }
  }
  HistoryQuestion history() {
    const std::lock_guard lock(mutex_);
    return history_;
  }
  AdvanceQuestion advance() {
    const std::lock_guard lock(mutex_);
    return advance_;
  }
  std::vector<std::string> asked() {
    const std::lock_guard lock(mutex_);
    return asked_;
  }

 private:
  std::mutex mutex_;
  std::vector<Section> sections_ = {
      {"bridge", 1, std::make_shared<const std::string>(R"({"version":"1"})")},
      {"guidance", 1, std::make_shared<const std::string>("null")},
      {"alarms", 0, nullptr}};
  HistoryQuestion history_;
  AdvanceQuestion advance_;
  std::vector<std::string> asked_;
};

class FakeRaw final : public RawSource {
 public:
  const std::vector<RawChannel>& Channels() const override { return channels_; }

 private:
  const std::vector<RawChannel> channels_ = {
      {"tbm/v1/guidance", "tbm::Guidance", "struct Guidance {\n  double \"x\";\n};"},
      {"tbm/v1/event", "tbm::Event", "struct Event {};"}};
};

}  // namespace tbm::hmi::test
