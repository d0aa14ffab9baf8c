#include "guidance/app/gnuplot.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <string_view>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include "guidance/app/output_file.h"

namespace tbm {
namespace {

constexpr const char* kProgram = "gnuplot";

struct Pipe {
  std::array<int, 2> ends = {-1, -1};
  ~Pipe() {
    CloseRead();
    CloseWrite();
  }
  bool Open() { return ::pipe2(ends.data(), O_CLOEXEC) == 0; }
  void CloseRead() { Close(ends[0]); }
  void CloseWrite() { Close(ends[1]); }

 private:
  static void Close(int& end) {
    if (end >= 0) ::close(end);
    end = -1;
  }
};

// Runs gnuplot without a shell: script in, picture out on its standard output.
class PlotRun {
 public:
  // Empty when the program runs.
  std::optional<std::string> Start() {
    if (!in_.Open() || !out_.Open()) return "no pipes left";
    child_ = ::fork();
    if (child_ < 0) return "no process can be started";
    if (child_ == 0) {
      const int nowhere = ::open("/dev/null", O_WRONLY);
      ::dup2(in_.ends[0], STDIN_FILENO);
      ::dup2(out_.ends[1], STDOUT_FILENO);
      if (nowhere >= 0) ::dup2(nowhere, STDERR_FILENO);
      ::execlp(kProgram, kProgram, "-d", static_cast<char*>(nullptr));
      ::_exit(127);
    }
    in_.CloseRead();
    out_.CloseWrite();
    return std::nullopt;
  }

  // Feeds the script and collects the picture, both at once: either pipe may be full.
  std::string Exchange(std::string_view script) {
    std::string picture;
    std::array<char, 65536> piece{};
    ::fcntl(in_.ends[1], F_SETFL, O_NONBLOCK);
    while (out_.ends[0] >= 0) {
      if (script.empty()) in_.CloseWrite();
      std::array<pollfd, 2> waits = {pollfd{out_.ends[0], POLLIN, 0},
                                     pollfd{in_.ends[1], POLLOUT, 0}};
      if (::poll(waits.data(), in_.ends[1] >= 0 ? 2 : 1, -1) < 0 && errno != EINTR) break;
      if ((waits[1].revents & (POLLOUT | POLLERR)) != 0 && in_.ends[1] >= 0) {
        const ssize_t written = ::write(in_.ends[1], script.data(), script.size());
        if (written > 0) script.remove_prefix(static_cast<std::size_t>(written));
        if (written < 0 && errno != EAGAIN && errno != EINTR) script = {};
      }
      if ((waits[0].revents & (POLLIN | POLLHUP)) != 0) {
        const ssize_t count = ::read(out_.ends[0], piece.data(), piece.size());
        if (count <= 0) break;
        picture.append(piece.data(), static_cast<std::size_t>(count));
      }
    }
    return picture;
  }

  int Wait() {
    int status = 0;
    while (::waitpid(child_, &status, 0) < 0 && errno == EINTR) {
    }
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

 private:
  Pipe in_;
  Pipe out_;
  pid_t child_ = -1;
};

}  // namespace

std::optional<std::string> DrawPicture(const std::string& script,
                                       int width_px,
                                       int height_px,
                                       const std::string& path,
                                       bool may_replace) {
  // A gnuplot that dies early must not take us along.
  std::signal(SIGPIPE, SIG_IGN);
  PlotRun run;
  if (const auto fault = run.Start()) return fmt::format("{}: no picture: {}", path, *fault);
  const std::string head = fmt::format(
      "set terminal pngcairo size {},{} font 'sans,11' noenhanced\n", width_px, height_px);
  const std::string picture = run.Exchange(head + script);
  const int code = run.Wait();
  if (code == 127) return path + ": no picture: the program gnuplot is not installed";
  if (code != 0 || !picture.starts_with("\x89PNG")) {
    return fmt::format("{}: no picture: gnuplot failed with code {}", path, code);
  }
  return OutputFile(path, may_replace).Write(picture);
}

}  // namespace tbm
