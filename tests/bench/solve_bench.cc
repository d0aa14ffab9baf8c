// Fused pose, cold and with covariance, against what a user of OpenCV writes: SQPNP, then ITERATIVE
// from there. Same draws (the paper's rig at 4 m, 0.1 px), same run, chunk by chunk in turn;
// medians.

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <vector>

#include <opencv2/calib3d.hpp>

#include "pose/base/angle.h"
#include "pose/solve/solve_pose.h"
#include "pose/solve/start_pose.h"
#include "tests/pose/solve/as_built.h"

namespace {

using tbm::PoseProblem;
using tbm::Rig;

constexpr int kDraws = 400;
constexpr int kRounds = 40;

struct CvDraw {
  std::vector<cv::Point3d> object_m;
  std::vector<cv::Point2d> image_px;
};

struct Draws {
  Rig rig;
  std::vector<PoseProblem> problems;
  std::vector<CvDraw> cv_draws;
  cv::Matx33d camera;
  cv::Vec<double, 5> distortion;
};

Draws MakeDraws(const Rig& rig, const char* stream) {
  Draws draws;
  draws.rig = rig;
  tbm::test::Random random(stream);
  for (int i = 0; i < kDraws; ++i) {
    const auto truth = tbm::test::DrawTruth(random, {4.0, 4.0});
    draws.problems.push_back(
        tbm::test::NoisyProblem(rig, truth, 0.1, tbm::DegToRad(0.005), random));
    CvDraw cv_draw;
    for (const auto& led : draws.problems.back().leds) {
      const auto& p = rig.leds[static_cast<std::size_t>(led.led_index)].p_led_in_target;
      cv_draw.object_m.emplace_back(p.x(), p.y(), p.z());
      cv_draw.image_px.emplace_back(led.pixel_px.x(), led.pixel_px.y());
    }
    draws.cv_draws.push_back(cv_draw);
  }
  const auto& c = rig.camera;
  draws.camera = {c.fx_px, 0, c.cx_px, 0, c.fy_px, c.cy_px, 0, 0, 1};
  draws.distortion = {c.k1, c.k2, c.p1, c.p2, c.k3};
  return draws;
}

// Keeps results from being optimised away.
double sink = 0.0;

template <class Solve>
double SecondsPerDraw(const Draws& draws, Solve solve) {
  const std::clock_t start = std::clock();
  for (std::size_t i = 0; i < kDraws; ++i) sink += solve(i);
  const auto took = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
  return took / static_cast<double>(draws.problems.size());
}

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + kRounds / 2, values.end());
  return values[kRounds / 2];
}

struct Medians {
  double fused_s;
  double vision_s;
  double start_s;
  double opencv_s;
};

Medians Measure(Draws& draws) {
  for (PoseProblem& problem : draws.problems) problem.rig = &draws.rig;
  std::vector<double> fused;
  std::vector<double> vision;
  std::vector<double> start;
  std::vector<double> opencv;
  for (int round = 0; round < kRounds; ++round) {
    fused.push_back(SecondsPerDraw(draws, [&](std::size_t i) {
      const auto result = tbm::SolveFused(draws.problems[i]);
      return result ? result->covariance(0, 0) : 0.0;
    }));
    opencv.push_back(SecondsPerDraw(draws, [&](std::size_t i) {
      cv::Vec3d turn;
      cv::Vec3d shift;
      const CvDraw& d = draws.cv_draws[i];
      cv::solvePnP(d.object_m,
                   d.image_px,
                   draws.camera,
                   draws.distortion,
                   turn,
                   shift,
                   false,
                   cv::SOLVEPNP_SQPNP);
      cv::solvePnP(d.object_m,
                   d.image_px,
                   draws.camera,
                   draws.distortion,
                   turn,
                   shift,
                   true,
                   cv::SOLVEPNP_ITERATIVE);
      return shift[2];
    }));
    vision.push_back(SecondsPerDraw(draws, [&](std::size_t i) {
      const auto result = tbm::SolveVision(draws.problems[i]);
      return result ? result->covariance(0, 0) : 0.0;
    }));
    start.push_back(SecondsPerDraw(draws, [&](std::size_t i) {
      const auto result = tbm::StartPose(draws.problems[i]);
      return result ? result->camera_from_target[0].translation.z() : 0.0;
    }));
  }
  return {Median(fused), Median(vision), Median(start), Median(opencv)};
}

void Print(const char* name, const Medians& m) {
  std::printf(
      "%-28s fused %6.2f us  vision %6.2f us  start %6.2f us  OpenCV %7.2f us  ratio %5.1f\n",
      name,
      1e6 * m.fused_s,
      1e6 * m.vision_s,
      1e6 * m.start_s,
      1e6 * m.opencv_s,
      m.opencv_s / m.fused_s);
}

}  // namespace

int main() {
  cv::setNumThreads(1);
  Draws published = MakeDraws(tbm::test::PublishedRig(), "bench published");
  const Medians plain = Measure(published);
  Print("published rig", plain);
  Draws distorted = MakeDraws(tbm::test::FieldRig(), "bench distorted");
  Print("lens with distortion", Measure(distorted));
  Rig field = tbm::test::FieldRig();
  tbm::test::DeclareFieldSigmas(field);
  Draws calibrated = MakeDraws(field, "bench calibrated");
  Print("and all calibration sigmas", Measure(calibrated));
  std::printf("bench solve: %.1fx faster than OpenCV SQPNP + ITERATIVE (wanted 15)\n",
              plain.opencv_s / plain.fused_s);
  return sink == 0.12345 ? 1 : 0;
}
