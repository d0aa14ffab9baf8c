#pragma once

#include <array>
#include <cstdint>

#include "pose/solve/problem.h"

namespace tbm {

// The simulation of the pose paper's section 4.1, as a pure function of its arguments: its lens (16
// mm, 5.3 um, 1280 x 1024), the LEDs of Table 1, 4 m, tilts of 0.005 degree, random relative poses.
//
// Draw number k of a case is the same whoever computes it: its random stream is made from seed,
// noise and k alone. A caller splits the draws over threads as it likes; sums of the same chunks
// merged in the same order agree bit for bit.
struct StudyCase {
  double centre_sigma_px = 0.1;  // the paper: 0.1 .. 1
  std::uint64_t seed = 1;
  double distance_m = 4.0;
  double tilt_sigma_rad = 8.7266462599716477e-5;  // 0.005 degree
  bool with_published = false;  // also Eq. 18 (Ceres): some 200 us a draw instead of 5
};

enum class StudyMethod { kVision, kFused, kPublished };
inline constexpr std::size_t kStudyMethods = 3;

// pitch, yaw, roll [rad]: turns about x, y, z of the camera, as Euler angles R = R_z R_y R_x of
// R_TC (the paper's omega, phi, kappa); then tx, ty, tz [m].
inline constexpr std::size_t kStudyAxes = 6;
using StudyVector = std::array<double, kStudyAxes>;

// Running sums of estimate - truth, of its size and its square, and of the bound's variance.
struct StudySums {
  struct Method {
    std::int64_t solved = 0;
    std::int64_t refused = 0;
    StudyVector error{};
    StudyVector absolute{};
    StudyVector squared{};
    StudyVector bound_variance{};  // Cramer-Rao; that of kFused stands for kPublished too
  };
  std::array<Method, kStudyMethods> methods;
};

// Draws first .. last - 1.
StudySums RunPublishedStudy(const StudyCase& study, std::int64_t first, std::int64_t last);

void Merge(const StudySums& more, StudySums& sums);

// What a table or a picture shows of one method in one case.
struct StudyRow {
  StudyVector rmse{};
  StudyVector mean{};  // signed
  StudyVector mean_absolute{};
  StudyVector bound{};  // no unbiased estimator has a smaller RMSE
  std::int64_t solved = 0;
  std::int64_t refused = 0;
};
StudyRow Summarise(const StudySums& sums, StudyMethod method);

// The rig that the study is made with.
Rig PublishedStudyRig();

}  // namespace tbm
