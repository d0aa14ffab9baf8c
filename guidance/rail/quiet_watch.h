#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "guidance/rail/rail_start.h"

namespace tbm {

// Mean and spread of successive samples.
struct QuietMean {
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel = Eigen::Vector3d::Zero();
  Eigen::Vector3d gyro_sigma = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_sigma = Eigen::Vector3d::Zero();
};
QuietMean MeanOf(const std::vector<ImuSample>& imu, std::size_t begin, std::size_t end);

// Whether `mean`, of so many samples, is that of the rest but for chance.
bool IsNear(const Eigen::Vector3d& mean,
            const Eigen::Vector3d& rest_mean,
            const Eigen::Vector3d& rest_sigma,
            double samples);

// Whether a window shows no more than the unit's noise, and no rate but its bias.
bool IsQuiet(const QuietMean& window, const RestSignature& rest, double samples);

// How long samples were missing before this one; 0 when none were.
double GapBefore(const RailSetup& setup, Timestamp last, const ImuSample& sample);

// Samples in a window of quiet: a quarter of a second.
std::size_t QuietWindowSamples(const RailSetup& setup);

// Finds the spans in which the unit shows nothing but its noise, as the samples come. A span is
// told from its first half second on and grows with each window; its first and last window, a
// quarter of a second each, may hold motion and are no part of it. Where samples are missing
// nobody knows: a span ends there, and another may begin.
class QuietWatch {
 public:
  // `setup` stays where it is.
  QuietWatch(const RailSetup& setup, const RestSignature& rest);

  void Feed(const ImuSample& sample);

  // In the order of time.
  const std::vector<RestSpan>& spans() const { return spans_; }

 private:
  void Break();

  const RailSetup& setup_;
  const RestSignature rest_;
  const std::size_t window_samples_;
  std::optional<Timestamp> last_;
  std::vector<ImuSample> window_;
  std::size_t quiet_windows_ = 0;  // on end
  RestSpan span_;                  // of them
  bool is_told_ = false;           // the span is the last of spans_
  std::vector<RestSpan> spans_;
};

}  // namespace tbm
