#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "hmi_bridge/app/report_request.h"
#include "hmi_bridge/core/view_json.h"
#include "hmi_bridge/server/console_source.h"
#include "pose/base/clock.h"

namespace tbm::hmi {

// Makes the surveyor's reports with `tbm`, one after the other, each in a folder of its own: no
// shell, a low priority, bounds on time, memory and files. What a report says is what `tbm` says.
class ReportRunner {
 public:
  static constexpr std::size_t kMostWaiting = 4;
  static constexpr std::size_t kMostKept = 20;

  // `folder` is emptied: reports are of one run of the bridge.
  ReportRunner(ReportPlaces places, std::string folder, const Clock& clock);
  ~ReportRunner();
  ReportRunner(const ReportRunner&) = delete;
  ReportRunner& operator=(const ReportRunner&) = delete;

  // JSON with the report's id, or why not.
  ApiAnswer Start(std::string_view json, const std::string& user);

  // Section `reports`, made anew when its version changes.
  Section View();

  // The whole file, or empty when there is none of this name.
  std::shared_ptr<const std::string> File(std::string_view id, std::string_view name);

 private:
  struct Report {
    std::uint64_t number = 0;
    ReportRequest request;
    std::string by;
    Timestamp asked_at;
    std::string state = "waiting";
    std::string text;
    std::vector<std::pair<std::string, std::uintmax_t>> files;
  };

  void Work();
  std::string FolderOf(std::uint64_t number) const;
  // Its last words and whether all went well.
  std::pair<bool, std::string> Make(std::uint64_t number, const ReportRequest& request);
  std::pair<bool, std::string> RunProgram(const Arguments& arguments, const std::string& folder);
  void Change(std::uint64_t number, const std::function<void(Report&)>& change);

  const ReportPlaces places_;
  const std::string folder_;
  const Clock& clock_;

  std::mutex mutex_;  // guards all below
  std::condition_variable work_;
  std::deque<Report> reports_;  // oldest first
  std::uint64_t last_number_ = 0;
  std::uint64_t version_ = 1;
  Section view_;
  int child_ = -1;  // process group that runs now
  bool ends_ = false;
  std::thread thread_;
};

}  // namespace tbm::hmi
