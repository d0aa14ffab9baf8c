#include "guidance/rail/rail_start.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "guidance/rail/quiet_watch.h"
#include "pose/base/angle.h"
#include "pose/geometry/rigid3.h"

namespace tbm {
namespace {

constexpr double kLeastRest_s = 2.0;
constexpr std::size_t kStartImages = 5;
// Of the noise of the other axes.
constexpr double kFrozen = 1e-6;
// Of the focal length: what targets may be off when all is as well known as it can be; and how near
// they may stand.
constexpr double kAstray = 0.02;
constexpr double kNear_m = 1.0;
// A gyro's bias over its sigma.
constexpr double kMostBias = 8.0;
// Noise over that of the data sheet, or under it: a unit may be worse or better, but not so much.
constexpr double kOtherUnit = 20.0;
constexpr double kMostTurns = 10.0;
constexpr double kSure = 4.0;
const double kTiltMounting_rad = DegToRad(0.05);

Failure<RailStartFailure> Fail(const RailStartFailure& failure) { return {failure}; }

Timestamp BeginOf(const ImuSample& sample) {
  return sample.ends_at - Duration(static_cast<std::int64_t>(sample.interval_s * 1e9));
}

// How far from where they should be the targets of the first images lie when the unit's heading is
// this [px], each at most `cap_px`, on average. All of one image at rest are as good as another's.
double MeanOff(const RailSetup& setup,
               const RailRecording& recording,
               const Eigen::Quaterniond& world_from_imu,
               double cap_px) {
  const RailCamera& camera = *setup.camera;
  const Eigen::Quaterniond camera_from_world = camera.camera_from_imu * world_from_imu.conjugate();
  const Eigen::Vector3d camera_in_world =
      setup.start.position_world_m + world_from_imu * camera.in_imu_m;
  double sum = 0.0;
  double count = 0.0;
  std::size_t images = 0;
  for (const TargetImage& image : recording.images) {
    if (images++ == kStartImages) break;
    for (const TargetPixel& pixel : image.pixels) {
      const Eigen::Vector3d in_camera =
          camera_from_world *
          (recording.targets[static_cast<std::size_t>(pixel.target)].in_world_m - camera_in_world);
      const auto projection = Project(camera.model, in_camera);
      const double off = projection ? (projection->pixel_px - pixel.pixel_px).norm() : cap_px;
      sum += std::min(off, cap_px);
      count += 1.0;
    }
  }
  return count > 0.0 ? sum / count : cap_px;
}

// The inclinometer's mean over the rest, in the unit's axes; empty where there is none.
std::optional<Eigen::Vector3d> UpByTilt(const RailSetup& setup, const RailRecording& recording) {
  if (!setup.tilt || recording.tilts.empty()) return {};
  const Timestamp begin = BeginOf(recording.imu.front());
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const TrolleyTilt& tilt : recording.tilts) {
    if (SecondsBetween(begin, tilt.sensed_at) > setup.start.at_rest_s) break;
    const double x = -std::sin(tilt.angles.beta_rad);
    const double y = std::sin(tilt.angles.gamma_rad);
    sum += Eigen::Vector3d(x, y, std::sqrt(std::max(0.0, 1.0 - x * x - y * y)));
  }
  if (sum.norm() <= 0.5) return {};
  return setup.tilt->housing_from_imu.conjugate() * sum.normalized();
}

}  // namespace

Result<RestSignature, RailStartFailure> FindRestSignature(const RailSetup& setup,
                                                          const RailRecording& recording) {
  const std::vector<ImuSample>& imu = recording.imu;
  if (imu.size() < static_cast<std::size_t>(setup.imu.rate_hz)) {
    return Fail({.fault = RailStartFault::kNoImu});
  }
  if (setup.start.at_rest_s < kLeastRest_s) {
    return Fail({.fault = RailStartFault::kNoRest});
  }
  const Timestamp begin = BeginOf(imu.front());
  std::size_t end = 0;
  while (end < imu.size() && SecondsBetween(begin, imu[end].ends_at) <= setup.start.at_rest_s) {
    ++end;
  }
  // The first second alone says what rest looks like: later ones are held against it.
  const auto first_second = std::min(end, static_cast<std::size_t>(setup.imu.rate_hz));
  const QuietMean first = MeanOf(imu, 0, first_second);
  for (int axis = 0; axis < 3; ++axis) {
    if (first.gyro_sigma[axis] <= kFrozen * first.gyro_sigma.maxCoeff()) {
      return Fail({.fault = RailStartFault::kFrozen, .axis = axis});
    }
    if (first.accel_sigma[axis] <= kFrozen * first.accel_sigma.maxCoeff()) {
      return Fail({.fault = RailStartFault::kFrozen, .axis = 3 + axis});
    }
  }
  const double expected = setup.imu.noise.angle_random_walk_rad * std::sqrt(setup.imu.rate_hz);
  const double gravity = first.accel.norm();
  const bool is_too_large = first.gyro_sigma.minCoeff() > kOtherUnit * expected;
  const bool is_too_small = first.gyro_sigma.maxCoeff() < expected / kOtherUnit;
  const bool is_wrong_force = std::abs(gravity / setup.gravity_m_s2 - 1.0) > 0.1;
  RestSignature signature{first.gyro, first.accel, first.gyro_sigma, first.accel_sigma};
  const std::size_t window = QuietWindowSamples(setup);
  for (std::size_t at = 0; at + window <= end; at += window) {
    const QuietMean mean = MeanOf(imu, at, at + window);
    const auto samples = static_cast<double>(window);
    if (IsQuiet(mean, signature, samples) &&
        IsNear(mean.accel, signature.mean_accel_m_s2, signature.sigma_accel_m_s2, samples)) {
      continue;
    }
    return Fail(
        {.fault = RailStartFault::kMovesAtStart, .at_s = SecondsBetween(begin, imu[at].ends_at)});
  }
  if (is_too_large || is_too_small) {
    const double shown = is_too_large ? first.gyro_sigma.minCoeff() : first.gyro_sigma.maxCoeff();
    return Fail({.fault = RailStartFault::kWrongRateUnit, .times = shown / expected});
  }
  if (is_wrong_force) {
    return Fail({.fault = RailStartFault::kWrongForce, .times = gravity / setup.gravity_m_s2});
  }
  const QuietMean all = MeanOf(imu, 0, end);
  const double bias_rad_s = std::hypot(setup.imu.gyro_bias_sigma_rad_s, kEarthRate_rad_s);
  for (int axis = 0; axis < 3; ++axis) {
    const double times = std::abs(all.gyro[axis]) / bias_rad_s;
    if (times > kMostBias) {
      return Fail({.fault = RailStartFault::kBiasTooLarge, .axis = axis, .times = times});
    }
  }
  return RestSignature{all.gyro, all.accel, all.gyro_sigma, all.accel_sigma};
}

Result<Eigen::Quaterniond, RailStartFailure> FindStartAttitude(const RailSetup& setup,
                                                               const RailRecording& recording,
                                                               const RestSignature& rest) {
  Eigen::Vector3d up_in_imu = rest.mean_accel_m_s2.normalized();
  if (const auto by_tilt = UpByTilt(setup, recording)) {
    const double off_rad = std::atan2(up_in_imu.cross(*by_tilt).norm(), up_in_imu.dot(*by_tilt));
    const double most_rad =
        kSure * std::hypot(setup.imu.accel_bias_sigma_m_s2 / setup.gravity_m_s2,
                           setup.tilt->sigma_rad,
                           std::max(kTiltMounting_rad, setup.tilt->sigma_rotation_rad));
    if (off_rad > most_rad) {
      return Fail(
          {.fault = RailStartFault::kTiltDisagrees, .off_rad = off_rad, .most_rad = most_rad});
    }
    up_in_imu = *by_tilt;
  }
  const Eigen::Quaterniond level = TurnBetween(up_in_imu, Eigen::Vector3d::UnitZ());
  const auto headed = [&](double turn_rad) { return ExpRotation({0.0, 0.0, turn_rad}) * level; };
  if (setup.start.heading_rad) {
    const Eigen::Vector3d x = level * Eigen::Vector3d::UnitX();
    return headed(*setup.start.heading_rad - std::atan2(x.y(), x.x()));
  }
  const bool sees_targets =
      std::any_of(recording.images.begin(), recording.images.end(), [](const TargetImage& image) {
        return !image.pixels.empty();
      });
  if (!setup.camera || !sees_targets) {
    return Fail({.fault = RailStartFault::kNoHeading});
  }
  // Coarse to fine; the cap keeps the worst of a wrong match the same wherever one looks.
  double best_rad = 0.0;
  double span_rad = std::numbers::pi;
  double step_rad = DegToRad(1.0);
  double cap_px = 0.25 * setup.camera->model.fx_px;
  double least = std::numeric_limits<double>::infinity();
  while (step_rad > 1e-6) {
    least = std::numeric_limits<double>::infinity();
    const double centre_rad = best_rad;
    for (double turn = centre_rad - span_rad; turn <= centre_rad + span_rad; turn += step_rad) {
      const double off = MeanOff(setup, recording, headed(turn), cap_px);
      if (off >= least) continue;
      least = off;
      best_rad = turn;
    }
    span_rad = 2.0 * step_rad;
    step_rad *= 0.1;
    cap_px = std::max(10.0, 0.3 * cap_px);
  }
  // Far off everywhere: these are other targets, or it stands elsewhere.
  least = MeanOff(setup, recording, headed(best_rad), 0.25 * setup.camera->model.fx_px);
  const RailCamera& camera = *setup.camera;
  const double unsure = camera.sigma_rotation_rad +
                        std::hypot(camera.sigma_position_m, setup.start.sigma_position_m) / kNear_m;
  if (least > (kAstray + 3.0 * unsure) * camera.model.fx_px) {
    return Fail({.fault = RailStartFault::kNoTargetFits, .off_px = least});
  }
  return headed(best_rad);
}

std::optional<RailStartFailure> FindTurnsTooFast(const RailSetup& setup,
                                                 const RailRecording& recording,
                                                 const RestSignature& rest) {
  const auto window = static_cast<std::size_t>(setup.imu.rate_hz);
  const double window_s = static_cast<double>(window) / setup.imu.rate_hz;
  double turned = 0.0;  // sums of squares [rad2]
  double felt = 0.0;
  double seconds = 0.0;
  std::optional<QuietMean> before;
  for (std::size_t at = 0; at + window <= recording.imu.size(); at += window) {
    const QuietMean mean = MeanOf(recording.imu, at, at + window);
    if (before) {
      const Eigen::Vector3d up = (before->accel + mean.accel).normalized();
      const Eigen::Vector3d rate = 0.5 * (before->gyro + mean.gyro) - rest.mean_gyro_rad_s;
      turned += (window_s * up.cross(rate)).squaredNorm();
      felt += (mean.accel.normalized() - before->accel.normalized()).squaredNorm();
      seconds += window_s;
    }
    before = mean;
  }
  const double noise = kOtherUnit * setup.imu.noise.angle_random_walk_rad;
  if (turned <= noise * noise * seconds || turned <= kMostTurns * kMostTurns * felt) return {};
  return RailStartFailure{.fault = RailStartFault::kTurnsTooFast,
                          .times = std::sqrt(turned / felt)};
}

std::vector<RestSpan> FindQuietSpans(const RailSetup& setup,
                                     const RailRecording& recording,
                                     const RestSignature& rest) {
  QuietWatch watch(setup, rest);
  for (const ImuSample& sample : recording.imu) watch.Feed(sample);
  return watch.spans();
}

}  // namespace tbm
