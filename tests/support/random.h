#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <string_view>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace tbm::test {

// A random stream that belongs to one test: its name is its seed, so a failure repeats and streams
// never disturb one another. Draws are our own arithmetic on std::mt19937_64, whose output the
// standard fixes; the std:: distributions differ between libraries.
class Random {
 public:
  explicit Random(std::string_view stream, std::uint64_t case_number = 0) {
    std::uint64_t hash = 1469598103934665603ull;  // FNV-1a
    for (const char c : stream) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ull;
    engine_.seed(hash ^ (case_number * 0x9E3779B97F4A7C15ull));
  }

  // [0, 1)
  double Unit() { return static_cast<double>(engine_() >> 11) * 0x1.0p-53; }
  double Uniform(double low, double high) { return low + (high - low) * Unit(); }
  // 0 .. count - 1
  int Index(int count) { return static_cast<int>(Unit() * count); }

  double Normal(double sigma = 1.0) {
    if (has_spare_) {
      has_spare_ = false;
      return sigma * spare_;
    }
    double a = 0.0;
    double b = 0.0;
    double s = 0.0;
    do {
      a = Uniform(-1.0, 1.0);
      b = Uniform(-1.0, 1.0);
      s = a * a + b * b;
    } while (s >= 1.0 || s == 0.0);
    const double scale = std::sqrt(-2.0 * std::log(s) / s);
    spare_ = b * scale;
    has_spare_ = true;
    return sigma * a * scale;
  }
  Eigen::Vector2d Normal2(double sigma = 1.0) { return {Normal(sigma), Normal(sigma)}; }
  Eigen::Vector3d Normal3(double sigma = 1.0) {
    return {Normal(sigma), Normal(sigma), Normal(sigma)};
  }

  Eigen::Quaterniond Rotation() {
    Eigen::Quaterniond q(Normal(), Normal(), Normal(), Normal());
    return q.normalized();
  }
  std::uint64_t Bits() { return engine_(); }

 private:
  std::mt19937_64 engine_;
  double spare_ = 0.0;
  bool has_spare_ = false;
};

}  // namespace tbm::test
