#include "pose/geometry/tilt.h"

#include <cmath>
#include <numbers>

namespace tbm {

Result<Eigen::Vector3d, TiltFailure> UpInTilt(const Inclination& reading) {
  if (!std::isfinite(reading.beta_rad) || !std::isfinite(reading.gamma_rad)) {
    return Failure{TiltFailure::kNotFinite};
  }
  constexpr double kQuarterTurn = 0.5 * std::numbers::pi;
  if (std::abs(reading.beta_rad) >= kQuarterTurn || std::abs(reading.gamma_rad) >= kQuarterTurn) {
    return Failure{TiltFailure::kOutOfRange};
  }
  const double sin_beta = std::sin(reading.beta_rad);
  const double sin_gamma = std::sin(reading.gamma_rad);
  const double up_z_squared = 1.0 - sin_beta * sin_beta - sin_gamma * sin_gamma;
  if (up_z_squared <= 0.0) return Failure{TiltFailure::kOutOfRange};
  return Eigen::Vector3d(-sin_beta, sin_gamma, std::sqrt(up_z_squared));
}

Eigen::Matrix<double, 3, 2> UpByInclination(const Inclination& reading) {
  const double sin_beta = std::sin(reading.beta_rad);
  const double sin_gamma = std::sin(reading.gamma_rad);
  const double cos_beta = std::cos(reading.beta_rad);
  const double cos_gamma = std::cos(reading.gamma_rad);
  const double up_z = std::sqrt(1.0 - sin_beta * sin_beta - sin_gamma * sin_gamma);
  Eigen::Matrix<double, 3, 2> derivative;
  derivative << -cos_beta, 0.0, 0.0, cos_gamma, -sin_beta * cos_beta / up_z,
      -sin_gamma * cos_gamma / up_z;
  return derivative;
}

Inclination InclinationFromUp(const Eigen::Vector3d& up_in_tilt) {
  return {-std::asin(up_in_tilt.x()), std::asin(up_in_tilt.y())};
}

}  // namespace tbm
