// hmi_bridge.yaml, requests for reports, the answers that the bridge keeps, and what it reads of
// the page's index.html.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "hmi_bridge/app/answer_file.h"
#include "hmi_bridge/app/bridge_config.h"
#include "hmi_bridge/app/report_request.h"
#include "hmi_bridge/app/web_folder.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto answers = tbm::hmi::AnswersFrom(text);
  const auto again = tbm::hmi::AnswersFrom(tbm::hmi::AnswerText(answers));
  if (again.size() > answers.size()) __builtin_trap();
  if (tbm::hmi::PageBuildOf(text.substr(0, 4096)).size() > 64) __builtin_trap();
  if (const auto report = tbm::hmi::ParseReportRequest(text)) {
    for (const std::string& word : report->points) {
      if (word.empty() || word.front() == '-' || word.find('/') != std::string::npos) {
        __builtin_trap();
      }
    }
  }
  const auto config = tbm::hmi::ParseBridgeConfig(text, "hmi_bridge.yaml");
  if (!config) {
    if (config.error().empty()) __builtin_trap();  // refused without saying why
    return 0;
  }
  if (config->listen.empty() || config->state_folder.empty()) __builtin_trap();
  return 0;
}
