#pragma once

#include <numbers>

namespace tbm {

inline constexpr double DegToRad(double angle_deg) { return angle_deg * std::numbers::pi / 180.0; }
inline constexpr double RadToDeg(double angle_rad) { return angle_rad * 180.0 / std::numbers::pi; }

}  // namespace tbm
