// own_world [--loopback] COMMAND...
//
// Runs COMMAND as root of a world of its own: user, mount and process namespaces, in which ARM
// programs run under qemu-arm-static wherever they stand, also inside a chroot. Mounts, processes
// and the registration of the emulator end with the command; the machine outside notices nothing.
// With --loopback the world also has a network of its own that holds 127.0.0.1 and nothing else.
//
// Needs root, and Linux 6.7 or newer: only since then may a user namespace register binary formats.
// Exit code: the command's; 125 when the world cannot be made; 128 + n when signal n ended the
// command.
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <net/if.h>
#include <sched.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mount.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

static void Give_up(const char* what) {
  fprintf(stderr, "own_world: %s: %s\n", what, strerror(errno));
  _exit(125);
}

static void Write(const char* path, const char* text) {
  const int file = open(path, O_WRONLY | O_CLOEXEC);
  if (file < 0 || write(file, text, strlen(text)) != (ssize_t)strlen(text)) Give_up(path);
  close(file);
}

static int Exit_code_of(pid_t child) {
  int status = 0;
  while (waitpid(child, &status, 0) < 0) {
    if (errno != EINTR) Give_up("waitpid");
  }
  return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
}

// A 32-bit little-endian ARM program, executable or shared object, whatever system it says it is
// for. The kernel opens the emulator now (flag F), so it need not exist in a chroot.
static void Register_emulator(void) {
  static const char kMagic[] =
      "\\x7f"
      "ELF"
      "\\x01\\x01\\x01\\x00"
      "\\x00\\x00\\x00\\x00\\x00\\x00\\x00\\x00"
      "\\x02\\x00\\x28\\x00";
  static const char kMask[] =
      "\\xff\\xff\\xff\\xff\\xff\\xff\\xff\\x00"
      "\\xff\\xff\\xff\\xff\\xff\\xff\\xff\\xff"
      "\\xfe\\xff\\xff\\xff";
  char line[512];
  snprintf(line, sizeof line, ":box:M:0:%s:%s:/usr/bin/qemu-arm-static:F", kMagic, kMask);
  if (mount("binfmt_misc", "/proc/sys/fs/binfmt_misc", "binfmt_misc", 0, NULL) != 0) {
    Give_up("binfmt_misc (Linux 6.7 or newer needed)");
  }
  Write("/proc/sys/fs/binfmt_misc/register", line);
}

static void Raise_loopback(void) {
  const int any = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  struct ifreq request = {.ifr_name = "lo", .ifr_flags = IFF_UP | IFF_RUNNING | IFF_MULTICAST};
  if (any < 0 || ioctl(any, SIOCSIFFLAGS, &request) != 0) Give_up("loopback");
  close(any);
}

// The first process of the new world.
static void Live(bool loopback, char** command) {
  if (setgid(0) != 0 || setuid(0) != 0) Give_up("root");
  if (mount(NULL, "/", NULL, MS_REC | MS_PRIVATE, NULL) != 0) Give_up("private mounts");
  if (mount("proc", "/proc", "proc", 0, NULL) != 0) Give_up("/proc");
  Register_emulator();
  if (loopback) Raise_loopback();
  execvp(command[0], command);
  Give_up(command[0]);
}

// Makes the namespaces, stops until the one outside has said who is who in them, goes on in a
// child.
static void Enter(bool loopback, char** command) {
  if (unshare(CLONE_NEWUSER | CLONE_NEWNS | CLONE_NEWPID | (loopback ? CLONE_NEWNET : 0)) != 0) {
    Give_up("namespaces");
  }
  raise(SIGSTOP);
  const pid_t first = fork();
  if (first < 0) Give_up("fork");
  if (first == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    Live(loopback, command);
  }
  _exit(Exit_code_of(first));
}

int main(int count, char** words) {
  bool loopback = false;
  int next = 1;
  if (next < count && strcmp(words[next], "--loopback") == 0) {
    loopback = true;
    ++next;
  }
  if (next >= count) {
    fprintf(stderr, "own_world [--loopback] COMMAND...\n");
    return 125;
  }
  // What was inherited open is nobody's business inside; mmdebstrap also trips over high numbers.
  close_range(3, ~0U, CLOSE_RANGE_CLOEXEC);

  const pid_t child = fork();
  if (child < 0) Give_up("fork");
  if (child == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    Enter(loopback, words + next);
  }
  int status = 0;
  if (waitpid(child, &status, WUNTRACED) < 0) Give_up("waitpid");
  if (!WIFSTOPPED(status)) return WIFEXITED(status) ? WEXITSTATUS(status) : 125;
  // Everybody is inside who they are outside.
  static const char* const kMaps[] = {"uid_map", "gid_map"};
  for (size_t i = 0; i < 2; ++i) {
    char path[64];
    snprintf(path, sizeof path, "/proc/%d/%s", (int)child, kMaps[i]);
    Write(path, "0 0 4294967295");
  }
  kill(child, SIGCONT);
  return Exit_code_of(child);
}
