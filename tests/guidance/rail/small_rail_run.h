#pragma once

#include <array>

#include <fmt/format.h>

#include "guidance/app/rail_run.h"
#include "tests/support/random.h"

namespace tbm::test {

// The texts of a run of four seconds with every kind of file: three at rest, one along x at a
// constant 0.1 m/s2. World and unit have the same axes; the camera looks along x.
inline RailRunTexts SmallRailRun() {
  RailRunTexts texts;
  const char* lens =
      "  image_width: 640\n  image_height: 480\n  distortion_model: plumb_bob\n"
      "  camera_matrix: {rows: 3, cols: 3, data: [800, 0, 320, 0, 800, 240, 0, 0, 1]}\n"
      "  distortion_coefficients: {rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}\n";
  texts["rail.yaml"] =
      std::string(
          "gravity_m_s2: 9.81\n"
          "imu: {rate_hz: 50, angle_random_walk_deg_sqrt_h: 0.2, velocity_random_walk_ug_sqrt_hz: "
          "50, gyro_bias_deg_h: 30, accel_bias_mg: 1, gyro_instability_deg_h: 0.5, "
          "accel_instability_ug: 20}\n"
          "tilt: {rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], sigma_deg: 0.01, sigma_rotation_deg: "
          "0.01}\ncamera:\n") +
      lens +
      "  residual_px: 0.1\n  rotation: [0, -1, 0, 0, 0, -1, 1, 0, 0]\n  position_m: [0, 0, 0]\n"
      "  sigma_rotation_deg: 0.05\n  sigma_position_mm: 1\n  time_offset_s: 0\n"
      "  sigma_time_offset_s: 0.002\n"
      "odometer: {rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], position_m: [0, 0, 0], sigma_mm: 1, "
      "sigma_scale_ppm: 1000, sigma_rotation_deg: 0.1, sigma_side_mm_s: 5}\nground_camera:\n" +
      lens +
      "  rotation: [0, -1, 0, -1, 0, 0, 0, 0, -1]\n  position_m: [0, 0, 0]\n  height_m: 0.5\n"
      "  sigma_rotation_deg: 0.1\n"
      "  sigma_height_mm: 5\n"
      "start: {position_m: [0, 0, 0], sigma_position_mm: 1, heading_known: true, heading_deg: 0, "
      "sigma_heading_deg: 0.5, at_rest_s: 3}\n";
  Random random("small rail run");
  const auto distance_m = [](int row) {
    const double moving_s = std::max(0.0, 0.02 * (row - 150));
    return 0.5 * 0.1 * moving_s * moving_s;
  };
  std::string& imu = texts["imu.csv"];
  imu = "stamp_ns,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,accel_x_m_s2,accel_y_m_s2,accel_z_m_s2\n";
  texts["truth.csv"] = "stamp_ns,x_m,y_m,z_m,qw,qx,qy,qz\n";
  for (int row = 1; row <= 200; ++row) {
    const long stamp_ns = 1'790'000'000'000'000'000 + 20'000'000L * row;
    imu += fmt::format("{},{:.7f},{:.7f},{:.7f},{:.6f},{:.6f},{:.6f}\n",
                       stamp_ns,
                       random.Normal(4e-4),
                       random.Normal(4e-4),
                       random.Normal(4e-4),
                       (row > 150 ? 0.1 : 0.0) + random.Normal(3.5e-3),
                       random.Normal(3.5e-3),
                       9.81 + random.Normal(3.5e-3));
    texts["truth.csv"] += fmt::format("{},{:.7f},0,0,1,0,0,0\n", stamp_ns, distance_m(row));
  }
  texts["targets.csv"] =
      "target,x_m,y_m,z_m,sigma_mm,kind\nA,4,1,0.5,0.1,led\nB,4,-1,0.6,0.1,coded:3\n"
      "C,5,0.8,-0.7,0.1,circle:60\nD,6,-0.9,-0.8,0.1,board:W:9x6:0\n";
  constexpr std::array<std::array<double, 3>, 4> kTargets = {
      {{4, 1, 0.5}, {4, -1, 0.6}, {5, 0.8, -0.7}, {6, -0.9, -0.8}}};
  texts["tilt.csv"] = "stamp_ns,sensor,beta_deg,gamma_deg\n";
  texts["centres.csv"] = "stamp_ns,target,u_px,v_px\n";
  texts["odometer.csv"] = "stamp_ns,distance_m\n";
  texts["displacement.csv"] = "from_ns,to_ns,dx_m,dy_m,sigma_m\n";
  texts["frames.csv"] = texts["ground_frames.csv"] = "stamp_ns,file\n";
  for (int row = 20; row <= 200; row += 20) {
    const long stamp_ns = 1'790'000'000'000'000'000 + 20'000'000L * row;
    texts["tilt.csv"] += fmt::format(
        "{},trolley,{:.4f},{:.4f}\n", stamp_ns, random.Normal(0.01), random.Normal(0.01));
    for (std::size_t i = 0; i < kTargets.size(); ++i) {
      const double ahead_m = kTargets[i][0] - distance_m(row);
      texts["centres.csv"] += fmt::format("{},{},{:.3f},{:.3f}\n",
                                          stamp_ns,
                                          "ABCD"[i],
                                          320.0 - 800.0 * kTargets[i][1] / ahead_m,
                                          240.0 - 800.0 * kTargets[i][2] / ahead_m);
    }
    texts["odometer.csv"] += fmt::format("{},{:.4f}\n", stamp_ns, distance_m(row));
    texts["displacement.csv"] += fmt::format("{},{},{:.5f},0,0.001\n",
                                             stamp_ns - 400'000'000,
                                             stamp_ns,
                                             distance_m(row) - distance_m(row - 20));
    texts["frames.csv"] += fmt::format("{},frames/{}.pgm\n", stamp_ns, row);
    texts["ground_frames.csv"] += fmt::format("{},ground/{}.pgm\n", stamp_ns, row);
  }
  return texts;
}

}  // namespace tbm::test
