#pragma once

// The few operations on 16 bytes that the finder is made of, three times: for SSE2, for NEON and
// written out plainly. All three give the same bits for the same input (tested), so a run replays
// bit for bit on any machine. Conditions:
// - NEON takes a float below 1.2e-38 for zero, and so must the code that uses these: it keeps its
//   numbers away from there.
// - No NaN and no infinity.
// - A product is rounded before it is added, also in MulAdd.
#include "pose/centres/vectors_plain.h"
#if defined(__SSE2__)
#include "pose/centres/vectors_sse2.h"
#elif defined(__ARM_NEON)
#include "pose/centres/vectors_neon.h"
#else
namespace tbm {
namespace native = plain;
}
#endif

namespace tbm {

// TBM_PLAIN_VECTORS is for the test that compares.
#if defined(TBM_PLAIN_VECTORS)
namespace vectors = plain;
#else
namespace vectors = native;
#endif

}  // namespace tbm
