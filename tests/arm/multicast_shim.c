/* Loaded into the box's programs when qemu-user runs them: it lacks IP_MULTICAST_IF, and Fast DDS then sends
   nothing at all. Without the option the kernel's route decides; the test runs in a network namespace whose only
   interface is loopback. A real box needs none of this. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <netinet/in.h>
#include <sys/socket.h>

int setsockopt(int socket, int level, int option, const void* value, socklen_t size) {
  if (level == IPPROTO_IP && option == IP_MULTICAST_IF) return 0;
  int (*next)(int, int, int, const void*, socklen_t) =
      (int (*)(int, int, int, const void*, socklen_t))dlsym(RTLD_NEXT, "setsockopt");
  return next(socket, level, option, value, size);
}
