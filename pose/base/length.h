#pragma once

namespace tbm {

inline constexpr double kMmPerMetre = 1000.0;

}  // namespace tbm
