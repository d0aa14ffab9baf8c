#pragma once

namespace tbm {

// Which way round a total station's telescope was when it read its circles.
enum class Face { kOne, kTwo };

}  // namespace tbm
