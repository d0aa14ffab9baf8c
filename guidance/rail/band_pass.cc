#include "guidance/rail/band_pass.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Core>
#include <Eigen/QR>

#include "pose/base/check.h"

namespace tbm {
namespace {

constexpr int kOrder = 4;
// What lies beyond an end does less than a hundredth of its own size to places further away than
// this many of the longest waves.
constexpr double kRoomWaves = 2.0;

double HalfStepTangent(double wavelength_m, double step_m) {
  return std::tan(std::numbers::pi * step_m / wavelength_m);
}

// Two passes square the gain. So that both together have 1 / sqrt 2 at the end of the band, one has
// its own corner this factor further out.
double CornerShift() { return std::pow(std::numbers::sqrt2 - 1.0, 1.0 / (2.0 * kOrder)); }

// The parabola of least squares through the first `count` samples, taken from all of them. What is
// left begins at nothing, and so may the filter; a parabola itself does not pass it.
void TakeParabola(std::size_t count, std::vector<double>* samples) {
  const auto rows = static_cast<Eigen::Index>(count);
  Eigen::Matrix<double, Eigen::Dynamic, 3> powers(rows, 3);
  const double unit = 1.0 / static_cast<double>(count);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const double x = unit * static_cast<double>(i);
    powers.row(i) << 1.0, x, x * x;
  }
  const Eigen::Vector3d parabola =
      powers.colPivHouseholderQr().solve(Eigen::Map<const Eigen::VectorXd>(samples->data(), rows));
  for (std::size_t i = 0; i < samples->size(); ++i) {
    const double x = unit * static_cast<double>(i);
    (*samples)[i] -= parabola[0] + x * (parabola[1] + x * parabola[2]);
  }
}

}  // namespace

BandPass::BandPass(double shortest_m, double longest_m, double step_m)
    : longest_m_(longest_m),
      step_m_(step_m),
      high_corner_(HalfStepTangent(longest_m, step_m) * CornerShift()),
      low_corner_(HalfStepTangent(shortest_m, step_m) / CornerShift()) {
  TBM_CHECK(step_m > 0.0 && shortest_m >= 4.0 * step_m && longest_m > shortest_m);
  AddSections(high_corner_, true);
  AddSections(low_corner_, false);
}

void BandPass::AddSections(double corner, bool is_high_pass) {
  for (int k = 0; k < kOrder / 2; ++k) {
    const double damping = 2.0 * std::cos(std::numbers::pi * (2 * k + 1) / (2.0 * kOrder));
    const double scale = 1.0 / (1.0 + damping * corner + corner * corner);
    const double b0 = is_high_pass ? scale : corner * corner * scale;
    sections_.push_back({b0,
                         is_high_pass ? -2.0 * b0 : 2.0 * b0,
                         b0,
                         2.0 * (corner * corner - 1.0) * scale,
                         (1.0 - damping * corner + corner * corner) * scale});
  }
}

void BandPass::Run(std::vector<double>* samples) const {
  for (const Section& section : sections_) {
    double s1 = 0.0;
    double s2 = 0.0;
    for (double& sample : *samples) {
      const double in = sample;
      sample = section.b0 * in + s1;
      s1 = section.b1 * in - section.a1 * sample + s2;
      s2 = section.b2 * in - section.a2 * sample;
    }
  }
}

double BandPass::Gain(double wavelength_m) const {
  const double tangent = HalfStepTangent(wavelength_m, step_m_);
  const double high = std::pow(high_corner_ / tangent, 2.0 * kOrder);
  const double low = std::pow(tangent / low_corner_, 2.0 * kOrder);
  return 1.0 / ((1.0 + high) * (1.0 + low));
}

double BandPass::room_m() const { return kRoomWaves * longest_m_; }

std::vector<std::optional<double>> BandPass::Filtered(std::span<const double> samples) const {
  std::vector<std::optional<double>> filtered(samples.size());
  const auto room = static_cast<std::size_t>(std::ceil(room_m() / step_m_ - 1e-9));
  if (samples.size() < 2 * room + 1) return filtered;
  std::vector<double> values(samples.begin(), samples.end());
  TakeParabola(room, &values);
  Run(&values);
  std::reverse(values.begin(), values.end());
  Run(&values);
  std::reverse(values.begin(), values.end());
  for (std::size_t i = room; i + room < values.size(); ++i) filtered[i] = values[i];
  return filtered;
}

}  // namespace tbm
