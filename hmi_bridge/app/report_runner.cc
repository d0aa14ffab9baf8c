#include "hmi_bridge/app/report_runner.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "pose/base/parse_number.h"

namespace tbm::hmi {
namespace {

constexpr rlim_t kMostCpu_s = 600;
constexpr rlim_t kMostFile_bytes = 50'000'000;
constexpr rlim_t kMostMemory_bytes = 4'000'000'000;
constexpr std::size_t kMostText_bytes = 6000;
constexpr std::string_view kWords = "report.txt";  // what the programs said

std::string ReadText(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(file), {});
}

void Limit(int what, rlim_t most) {
  const rlimit limit{most, most};
  setrlimit(static_cast<__rlimit_resource>(what), &limit);
}

// After fork in a process with threads: nothing but what is safe in a signal handler.
[[noreturn]] void Become(char* const* arguments, const char* folder, const char* words) {
  setpgid(0, 0);
  const int null = open("/dev/null", O_RDONLY);
  if (chdir(folder) != 0) _exit(127);
  const int out = open(words, O_WRONLY | O_CREAT | O_APPEND, 0600);
  if (null < 0 || out < 0) _exit(127);
  dup2(null, STDIN_FILENO);
  dup2(out, STDOUT_FILENO);
  dup2(out, STDERR_FILENO);
  close_range(3, ~0U, 0);
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  signal(SIGPIPE, SIG_DFL);
  Limit(RLIMIT_CPU, kMostCpu_s);
  Limit(RLIMIT_FSIZE, kMostFile_bytes);
  Limit(RLIMIT_AS, kMostMemory_bytes);
  (void)nice(10);
  execv(arguments[0], arguments);
  _exit(127);
}

std::string WhyEnded(int status) {
  if (WIFEXITED(status)) return fmt::format("the program ended with {}", WEXITSTATUS(status));
  if (WTERMSIG(status) == SIGXFSZ) {
    return "a table would be larger than 50 MB: choose a shorter time";
  }
  if (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL) {
    return "it took too long and was ended";
  }
  return fmt::format("the program was ended by signal {}", WTERMSIG(status));
}

}  // namespace

ReportRunner::ReportRunner(ReportPlaces places, std::string folder, const Clock& clock)
    : places_(std::move(places)), folder_(std::move(folder)), clock_(clock) {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
  thread_ = std::thread([this] { Work(); });
}

ReportRunner::~ReportRunner() {
  {
    const std::lock_guard lock(mutex_);
    ends_ = true;
    if (child_ > 0) kill(-child_, SIGKILL);
  }
  work_.notify_all();
  thread_.join();
}

std::string ReportRunner::FolderOf(std::uint64_t number) const {
  return fmt::format("{}/{}", folder_, number);
}

ApiAnswer ReportRunner::Start(std::string_view json, const std::string& user) {
  const auto request = ParseReportRequest(json);
  if (!request) return request.error();
  // What cannot be made is said now and not later.
  if (const auto commands = CommandsOf(*request, places_); !commands) return commands.error();
  std::uint64_t number = 0;
  {
    const std::lock_guard lock(mutex_);
    const auto waiting = std::count_if(reports_.begin(), reports_.end(), [](const Report& report) {
      return report.state == "waiting";
    });
    if (static_cast<std::size_t>(waiting) >= kMostWaiting) {
      return ApiFault{429, "too_many", "four reports are waiting already"};
    }
    number = ++last_number_;
    Report report;
    report.number = number;
    report.request = *request;
    report.by = user;
    report.asked_at = clock_.Now();
    reports_.push_back(std::move(report));
    while (reports_.size() > kMostKept && reports_.front().state != "running" &&
           reports_.front().state != "waiting") {
      std::error_code ignored;
      std::filesystem::remove_all(FolderOf(reports_.front().number), ignored);
      reports_.pop_front();
    }
    ++version_;
  }
  work_.notify_all();
  return Json({{"report_id", std::to_string(number)}}).dump();
}

void ReportRunner::Change(std::uint64_t number, const std::function<void(Report&)>& change) {
  const std::lock_guard lock(mutex_);
  for (Report& report : reports_) {
    if (report.number == number) change(report);
  }
  ++version_;
}

void ReportRunner::Work() {
  while (true) {
    std::uint64_t number = 0;
    ReportRequest request;
    {
      std::unique_lock lock(mutex_);
      const auto next = [this] {
        return std::find_if(reports_.begin(), reports_.end(), [](const Report& report) {
          return report.state == "waiting";
        });
      };
      work_.wait(lock, [&] { return ends_ || next() != reports_.end(); });
      if (ends_) return;
      number = next()->number;
      request = next()->request;
    }
    Change(number, [](Report& report) { report.state = "running"; });
    const auto [is_good, text] = Make(number, request);
    std::vector<std::pair<std::string, std::uintmax_t>> files;
    std::error_code ignored;
    for (const auto& entry : std::filesystem::directory_iterator(FolderOf(number), ignored)) {
      const std::string name = entry.path().filename().string();
      const bool is_file = std::filesystem::is_regular_file(entry.symlink_status(ignored));
      if (is_file && name != "shots.txt") {
        files.emplace_back(name, entry.file_size(ignored));
      }
    }
    std::sort(files.begin(), files.end());
    Change(number, [&, good = is_good, words = text](Report& report) {
      report.state = good ? "done" : "failed";
      report.text = words;
      report.files = files;
      report.request.shots_text.clear();
    });
  }
}

std::pair<bool, std::string> ReportRunner::Make(std::uint64_t number,
                                                const ReportRequest& request) {
  const std::string folder = FolderOf(number);
  std::error_code fault;
  std::filesystem::create_directories(folder, fault);
  if (fault) return {false, folder + ": " + fault.message()};
  if (request.kind == ReportKind::kAccuracy) {
    std::ofstream shots(folder + "/shots.txt", std::ios::binary);
    shots << request.shots_text;
    if (!shots.flush()) return {false, folder + "/shots.txt: cannot be written"};
  }
  const auto commands = CommandsOf(request, places_);
  if (!commands) return {false, commands.error().text};
  bool is_good = true;
  std::string why;
  for (const Arguments& arguments : *commands) {
    const auto [went_well, reason] = RunProgram(arguments, folder);
    if (!went_well && is_good) why = reason;
    is_good = is_good && went_well;
  }
  std::string text = ReadText(fmt::format("{}/{}", folder, kWords));
  if (text.size() > kMostText_bytes) {
    text = "..." + text.substr(text.size() - kMostText_bytes);
  }
  if (!why.empty()) text += (text.empty() || text.back() == '\n' ? "" : "\n") + why + "\n";
  return {is_good, text};
}

std::pair<bool, std::string> ReportRunner::RunProgram(const Arguments& arguments,
                                                      const std::string& folder) {
  std::vector<char*> raw;
  for (const std::string& argument : arguments) raw.push_back(const_cast<char*>(argument.c_str()));
  raw.push_back(nullptr);
  const std::string words(kWords);
  const pid_t child = fork();
  if (child < 0) return {false, "no further process can be started"};
  if (child == 0) Become(raw.data(), folder.c_str(), words.c_str());
  setpgid(child, child);
  {
    const std::lock_guard lock(mutex_);
    child_ = child;
    if (ends_) kill(-child, SIGKILL);
  }
  int status = 0;
  const auto until = clock_.Steady() + std::chrono::seconds(2 * kMostCpu_s);
  while (waitpid(child, &status, WNOHANG) == 0) {
    if (clock_.Steady() > until) kill(-child, SIGKILL);
    usleep(20'000);
  }
  const std::lock_guard lock(mutex_);
  child_ = -1;
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return {true, ""};
  return {false, WhyEnded(status)};
}

Section ReportRunner::View() {
  const std::lock_guard lock(mutex_);
  if (view_.version == version_) return view_;
  Json list = Json::array();
  for (auto report = reports_.rbegin(); report != reports_.rend(); ++report) {
    Json files = Json::array();
    for (const auto& [name, bytes] : report->files) {
      files.push_back({{"name", name}, {"bytes", bytes}});
    }
    list.push_back({{"id", std::to_string(report->number)},
                    {"kind", std::string(WordOf(report->request.kind))},
                    {"by", report->by},
                    {"asked_at_utc_ms", Milliseconds(report->asked_at)},
                    {"state", report->state},
                    {"text", report->text},
                    {"files", std::move(files)}});
  }
  view_ = {"reports",
           version_,
           std::make_shared<const std::string>(
               list.dump(-1, ' ', false, Json::error_handler_t::replace))};
  return view_;
}

std::shared_ptr<const std::string> ReportRunner::File(std::string_view id, std::string_view name) {
  const auto number = ParseInteger(id);
  if (!number) return nullptr;
  {
    const std::lock_guard lock(mutex_);
    const auto report =
        std::find_if(reports_.begin(), reports_.end(), [&](const Report& candidate) {
          return candidate.number == static_cast<std::uint64_t>(*number);
        });
    if (report == reports_.end()) return nullptr;
    // Only what was listed: no name of a path ever reaches the file system.
    const bool is_listed = std::any_of(report->files.begin(),
                                       report->files.end(),
                                       [&](const auto& file) { return file.first == name; });
    if (!is_listed) return nullptr;
  }
  return std::make_shared<const std::string>(
      ReadText(fmt::format("{}/{}", FolderOf(static_cast<std::uint64_t>(*number)), name)));
}

}  // namespace tbm::hmi
