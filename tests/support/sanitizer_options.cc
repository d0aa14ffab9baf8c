// What the sanitizers are told to leave out, for the tests that link this; empty elsewhere.
//
// Debian's libraries are not instrumented: of their own locks, queues and atomics the sanitizer
// sees only the calls into libc. No line here hides a data race of our own code, also not where a
// library's thread calls it back; the last one hides a wrong order of our locks inside such a call.
#include "tests/support/sanitized.h"

#if defined(TBM_TSAN)

extern "C" const char* __tsan_default_suppressions();
extern "C" const char* __tsan_default_suppressions() {
  return
      // Hands image buffers from its receiving thread to us through a lock-free queue of GLib.
      "called_from_lib:libaravis-0.8.so\n"
      // Sockets and cancellation of Aravis.
      "called_from_lib:libgio-2.0.so\n"
      // Its locks are futexes of its own making.
      "called_from_lib:libglib-2.0.so\n"
      // Reference counts by atomics of its own.
      "called_from_lib:libgobject-2.0.so\n"
      // Locks by pthread_mutex_clocklock, which GCC 12's sanitizer does not see: it then misses a
      // lock at the unlock, ..
      "mutex:libfastrtps.so\n"
      // .. and takes the second, inner lock of a recursive mutex for the first.
      "deadlock:libfastrtps.so\n";
}

#endif

#if defined(TBM_ASAN)

extern "C" const char* __asan_default_options();
extern "C" const char* __asan_default_options() {
  // Fast DDS 2.9 deletes its history attributes under the name of their base: other size, no harm.
  return "new_delete_type_mismatch=0";
}

#endif
