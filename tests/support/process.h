#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstdio>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

namespace tbm::test {

// A child process whose output is read line by line. Killed and reaped when it goes out of scope.
class Process {
 public:
  explicit Process(const std::vector<std::string>& command,
                   const std::vector<std::string>& environment = {}) {
    std::array<int, 2> pipe_ends{};
    if (pipe2(pipe_ends.data(), O_CLOEXEC) != 0) return;
    pid_ = fork();
    if (pid_ == 0) {
      dup2(pipe_ends[1], STDOUT_FILENO);
      dup2(pipe_ends[1], STDERR_FILENO);
      for (const std::string& variable : environment) putenv(const_cast<char*>(variable.c_str()));
      std::vector<char*> arguments;
      for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
      arguments.push_back(nullptr);
      execvp(arguments[0], arguments.data());
      std::_Exit(127);
    }
    close(pipe_ends[1]);
    reader_ = std::thread([this, fd = pipe_ends[0]] { Read(fd); });
  }
  ~Process() {
    Kill();
    if (reader_.joinable()) reader_.join();
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  void Signal(int signal) const {
    if (pid_ > 0 && !is_reaped_) kill(pid_, signal);
  }
  void Kill() {
    Signal(SIGKILL);
    Wait();
  }
  // Exit code; 128 + n when a signal n ended it. What it has said is then in the lines, unless a
  // child of its own still holds the pipe open.
  int Wait() {
    if (pid_ <= 0 || is_reaped_) return exit_code_;
    int status = 0;
    waitpid(pid_, &status, 0);
    is_reaped_ = true;
    exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    std::unique_lock lock(mutex_);
    all_read_.wait_for(lock, std::chrono::seconds(2), [this] { return is_all_read_; });
    return exit_code_;
  }

  std::vector<std::string> Lines() const {
    const std::lock_guard lock(mutex_);
    return lines_;
  }
  std::size_t LineCount() const {
    const std::lock_guard lock(mutex_);
    return lines_.size();
  }
  bool HasLine(const std::string& beginning) const {
    for (const std::string& line : Lines()) {
      if (line.compare(0, beginning.size(), beginning) == 0) return true;
    }
    return false;
  }
  std::string Output() const {
    std::string all;
    for (const std::string& line : Lines()) all += line + "\n";
    return all;
  }

 private:
  void Read(int fd) {
    std::FILE* stream = fdopen(fd, "r");
    std::array<char, 4096> buffer{};
    while (std::fgets(buffer.data(), static_cast<int>(buffer.size()), stream) != nullptr) {
      std::string line(buffer.data());
      while (!line.empty() && line.back() == '\n') line.pop_back();
      const std::lock_guard lock(mutex_);
      lines_.push_back(line);
    }
    std::fclose(stream);
    const std::lock_guard lock(mutex_);
    is_all_read_ = true;
    all_read_.notify_all();
  }

  pid_t pid_ = -1;
  std::atomic<bool> is_reaped_ = false;
  int exit_code_ = -1;
  mutable std::mutex mutex_;
  std::condition_variable all_read_;
  bool is_all_read_ = false;
  std::vector<std::string> lines_;
  std::thread reader_;
};

}  // namespace tbm::test
