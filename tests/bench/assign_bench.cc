// Naming the spots: AssignLeds against what one writes with OpenCV alone, every order of the spots
// through solvePnP (SQPNP) and the best reprojection kept. Five LEDs, five spots, no tilts for the
// rival: it has no place for them. Then, for the record, our own times in harder frames.

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <numeric>
#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "tests/pose/centres/assign_draws.h"

namespace tbm::test {
namespace {

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::vector<Draw> Draws(const DrawOptions& options, int count, std::string_view stream) {
  Random random(stream);
  std::vector<Draw> draws;
  for (int i = 0; i < count; ++i) draws.push_back(DrawFrame(FieldRig(), options, random));
  return draws;
}

// Median over all draws [us]: neighbours on a shared machine disturb means.
template <class Call>
double MedianMicroseconds(const std::vector<Draw>& draws, Call call) {
  std::vector<double> microseconds;
  for (const Draw& draw : draws) {
    const auto start = std::chrono::steady_clock::now();
    call(draw);
    microseconds.push_back(1e6 * SecondsSince(start));
  }
  std::nth_element(microseconds.begin(),
                   microseconds.begin() + static_cast<std::ptrdiff_t>(microseconds.size() / 2),
                   microseconds.end());
  return microseconds[microseconds.size() / 2];
}

class TryAllOrders {
 public:
  explicit TryAllOrders(const Rig& rig) {
    const CameraModel& c = rig.camera;
    matrix_ = (cv::Mat_<double>(3, 3) << c.fx_px, 0, c.cx_px, 0, c.fy_px, c.cy_px, 0, 0, 1);
    distortion_ = (cv::Mat_<double>(1, 5) << c.k1, c.k2, c.p1, c.p2, c.k3);
    for (const Led& led : rig.leds) {
      const Eigen::Vector3d& p = led.p_led_in_target;
      leds_.emplace_back(p.x(), p.y(), p.z());
    }
  }

  // Spot of each LED.
  std::array<int, 5> Assign(const Draw& draw) const {
    std::array<int, 5> order = {0, 1, 2, 3, 4};
    std::array<int, 5> best = order;
    double least_px2 = 1e300;
    do {
      std::vector<cv::Point2d> pixels;
      for (const int s : order) {
        const Eigen::Vector2d& pixel_px = draw.centres[static_cast<std::size_t>(s)].pixel_px;
        pixels.emplace_back(pixel_px.x(), pixel_px.y());
      }
      const double error_px2 = Error(pixels);
      if (error_px2 < least_px2) {
        least_px2 = error_px2;
        best = order;
      }
    } while (std::next_permutation(order.begin(), order.end()));
    return best;
  }

 private:
  double Error(const std::vector<cv::Point2d>& pixels) const {
    cv::Mat rotation;
    cv::Mat translation;
    if (!cv::solvePnP(leds_,
                      pixels,
                      matrix_,
                      distortion_,
                      rotation,
                      translation,
                      false,
                      cv::SOLVEPNP_SQPNP)) {
      return 1e300;
    }
    std::vector<cv::Point2d> projected;
    cv::projectPoints(leds_, rotation, translation, matrix_, distortion_, projected);
    double sum_px2 = 0.0;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const cv::Point2d off = pixels[i] - projected[i];
      sum_px2 += off.dot(off);
    }
    return sum_px2;
  }

  cv::Mat matrix_;
  cv::Mat distortion_;
  std::vector<cv::Point3d> leds_;
};

DrawOptions Uniform(int least_visible, int false_spots) {
  return Visible(least_visible, 5, FalseSpots::kUniform, false_spots);
}

void PrintOwn(const char* what, const DrawOptions& options, bool with_tilts) {
  const Rig rig = FieldRig();
  const std::vector<Draw> draws = Draws(options, 200, what);
  const double median_us = MedianMicroseconds(draws, [&](const Draw& draw) {
    const auto tilt = with_tilts ? draw.target_tilt : std::nullopt;
    (void)AssignLeds(rig, draw.centres, tilt, draw.camera_tilt, draw.prior);
  });
  std::printf("  %-52s %8.1f us\n", what, median_us);
}

int Main() {
  cv::setNumThreads(1);
  const Rig rig = FieldRig();
  const std::vector<Draw> draws = Draws(Uniform(5, 0), 200, "assign_bench");
  const TryAllOrders rival(rig);
  const std::vector<Draw> few_draws(draws.begin(), draws.begin() + 20);  // a tenth of a second each
  int rival_right = 0;
  int own_right = 0;
  const double rival_us = MedianMicroseconds(few_draws, [&](const Draw& draw) {
    const std::array<int, 5> spots = rival.Assign(draw);
    bool right = true;
    for (int led = 0; led < 5; ++led) {
      right &=
          draw.led_of_spot[static_cast<std::size_t>(spots[static_cast<std::size_t>(led)])] == led;
    }
    rival_right += right;
  });
  const double own_us = MedianMicroseconds(draws, [&](const Draw& draw) {
    const auto result =
        AssignLeds(rig, draw.centres, draw.target_tilt, draw.camera_tilt, draw.prior);
    own_right += AnswerTo(draw, result) == Answer::kRight;
  });
  std::printf("assign: medians of 200 frames, one thread\n");
  std::printf("  %-52s %8.1f us, %d of 200 right\n", "5 LEDs, nothing else", own_us, own_right);
  std::printf("  %-52s %8.1f us, %d of 20 right\n", "  OpenCV, all orders", rival_us, rival_right);
  PrintOwn("4..5 LEDs and 10 false spots", Uniform(4, 10), true);
  PrintOwn("4..5 LEDs and 10 false spots, prior", WithPrior(Uniform(4, 10)), true);
  PrintOwn("4..5 LEDs and 20 false spots", Uniform(4, 20), true);
  PrintOwn("5 LEDs and 59 false spots (all room taken)", Uniform(5, 59), true);
  PrintOwn("4..5 LEDs, 10 false spots, no tilts, prior", WithPrior(Uniform(4, 10)), false);
  PrintOwn("5 LEDs, 2 false spots, neither tilts nor prior", Uniform(5, 2), false);
  PrintOwn("5 LEDs, 10 false spots, neither tilts nor prior", Uniform(5, 10), false);
  std::printf(
      "bench assign: %.1fx faster than OpenCV SQPNP over all orders of five spots (wanted none)\n",
      rival_us / own_us);
  return 0;
}

}  // namespace
}  // namespace tbm::test

int main() { return tbm::test::Main(); }
