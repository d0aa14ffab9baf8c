#pragma once

// TBM_ASAN or TBM_TSAN, and TBM_SANITIZED for either: the compilers have different names for them.
#if defined(__has_feature)
#if __has_feature(address_sanitizer)
#define TBM_ASAN
#elif __has_feature(thread_sanitizer)
#define TBM_TSAN
#endif
#endif
#if defined(__SANITIZE_ADDRESS__) && !defined(TBM_ASAN)
#define TBM_ASAN
#endif
#if defined(__SANITIZE_THREAD__) && !defined(TBM_TSAN)
#define TBM_TSAN
#endif
#if defined(TBM_ASAN) || defined(TBM_TSAN)
#define TBM_SANITIZED
#endif
