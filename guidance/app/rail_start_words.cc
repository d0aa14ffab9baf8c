#include "guidance/app/rail_start_words.h"

#include <array>
#include <string_view>

#include <fmt/format.h>

#include "pose/base/angle.h"

namespace tbm {
namespace {

constexpr std::array<std::string_view, 6> kImuAxes = {
    "gyro_x_rad_s", "gyro_y_rad_s", "gyro_z_rad_s", "accel_x_m_s2", "accel_y_m_s2", "accel_z_m_s2"};

}  // namespace

std::string Explain(const RailStartFailure& failure, const RailSetup& setup) {
  switch (failure.fault) {
    case RailStartFault::kNoImu:
      return "imu.csv: there is less than a second of samples";
    case RailStartFault::kNoRest:
      return "rail.yaml: start.at_rest_s: the trolley must rest for at least 2 s at first";
    case RailStartFault::kMovesAtStart:
      return fmt::format(
          "imu.csv: the trolley moves {:.1f} s after its first sample, and rail.yaml says "
          "start.at_rest_s: {}; give the time it really rested",
          failure.at_s,
          setup.start.at_rest_s);
    case RailStartFault::kWrongRateUnit:
      if (failure.times < 1.0) {
        return fmt::format(
            "imu.csv: the gyros' noise at rest is {:.3f} times what "
            "imu.angle_random_walk_deg_sqrt_h says: were they turned from degrees into radians "
            "twice?",
            failure.times);
      }
      return fmt::format(
          "imu.csv: the gyros' noise at rest is {:.0f} times what imu.angle_random_walk_deg_sqrt_h "
          "says: are these degrees per second where radians per second belong?",
          failure.times);
    case RailStartFault::kTurnsTooFast:
      return fmt::format(
          "imu.csv: over the run the gyros turn {:.0f} times as far as gravity does in the "
          "accelerometers: are these degrees per second where radians per second belong?",
          failure.times);
    case RailStartFault::kTiltDisagrees:
      return fmt::format(
          "tilt.csv: at rest the inclinometer's up lies {:.2f} deg from that of the "
          "accelerometers, and {:.2f} deg is what their bias and its mounting allow: beta_deg and "
          "gamma_deg are degrees with up.x = -sin(beta), up.y = +sin(gamma), and rail.yaml has "
          "tilt.rotation from imu into the housing",
          RadToDeg(failure.off_rad),
          RadToDeg(failure.most_rad));
    case RailStartFault::kWrongForce:
      return fmt::format(
          "imu.csv: at rest the accelerometers show {:.3f} times gravity: m/s2 belong there, not g "
          "or mg",
          failure.times);
    case RailStartFault::kBiasTooLarge:
      return fmt::format(
          "imu.csv: {} shows at rest {:.0f} times what imu.gyro_bias_deg_h and the turning of the "
          "Earth allow",
          kImuAxes[static_cast<std::size_t>(failure.axis)],
          failure.times);
    case RailStartFault::kFrozen:
      return fmt::format("imu.csv: {} shows one and the same number",
                         kImuAxes[static_cast<std::size_t>(failure.axis)]);
    case RailStartFault::kNoHeading:
      return "rail.yaml: the heading is not known and no target is seen: give start.heading_deg, "
             "sigma_heading_deg and heading_known: true";
    case RailStartFault::kNoTargetFits:
      return fmt::format(
          "centres.csv: whatever the heading, the targets lie {:.0f} px from where "
          "start.position_m and targets.csv put them: names exchanged, another place, or another "
          "camera",
          failure.off_px);
  }
  return "";
}

}  // namespace tbm
