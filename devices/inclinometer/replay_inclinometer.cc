#include "devices/inclinometer/replay_inclinometer.h"

namespace tbm {
namespace {

// A recording has gaps of its own; silence is judged by whoever reads the stamps.
constexpr std::chrono::hours kNeverSilent(24 * 365);

}  // namespace

ReplayInclinometer::ReplayInclinometer(std::vector<TiltSample> samples,
                                       Timestamp start,
                                       double speed,
                                       const Clock& clock,
                                       Sleeper& sleeper)
    : samples_(std::move(samples)),
      start_(start),
      speed_(speed),
      clock_(clock),
      sleeper_(sleeper),
      life_(kNeverSilent) {}

Result<TiltSample, InclinometerFailure> ReplayInclinometer::Read(
    std::chrono::steady_clock::time_point deadline) {
  if (!began_) {
    began_ = clock_.Steady();
    life_.OnPortOpen(*began_);
  }
  if (next_ == samples_.size()) {
    life_.OnFailure(InclinometerFailure::kEnded);
    sleeper_.SleepUntil(deadline);
    return Failure{InclinometerFailure::kEnded};
  }
  const TiltSample& sample = samples_[next_];
  if (speed_ > 0.0) {
    const double wait_s = SecondsBetween(start_, sample.sensed_at) / speed_;
    const auto due = *began_ + std::chrono::nanoseconds(static_cast<std::int64_t>(wait_s * 1e9));
    if (due > deadline) {
      sleeper_.SleepUntil(deadline);
      return Failure{InclinometerFailure::kNotDue};
    }
    if (due > clock_.Steady()) sleeper_.SleepUntil(due);
  }
  ++next_;
  life_.OnRequest();
  life_.OnGood(sample.sensed_at, clock_.Steady());
  return sample;
}

}  // namespace tbm
