// The centre finder against OpenCV's SimpleBlobDetector with its defaults, and against the time it
// takes merely to read the frame (cv::sum), on the same frame in the same run: 1280 x 1024, 8 bit,
// five LEDs, a pipe, forty hot pixels.
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>

#include "pose/centres/find_centres.h"
#include "tests/support/render.h"

namespace {

using tbm::test::Random;
using tbm::test::RenderedImage;
using tbm::test::RenderScene;

RenderedImage Frame() {
  Random random("find_centres_bench");
  RenderScene scene;
  scene.width_px = 1280;
  scene.height_px = 1024;
  scene.background_dn = 7.0;
  const std::array<std::array<double, 2>, 5> places = {
      {{490.2, 579.7}, {883.9, 567.7}, {679.9, 386.4}, {691.0, 769.6}, {754.7, 509.0}}};
  for (const auto& place : places) {
    tbm::test::RenderSpot spot;
    spot.pixel_px = {place[0], place[1]};
    spot.sigma_px = 2.3;
    spot.peak_dn = random.Uniform(120.0, 220.0);
    scene.spots.push_back(spot);
  }
  for (int i = 0; i < 40; ++i) {
    scene.hot.push_back({random.Index(1280), random.Index(1024), random.Uniform(20.0, 200.0)});
  }
  std::vector<double> mean = RenderMean(scene);
  for (std::size_t i = 0; i < mean.size(); ++i) {
    if ((i / 1280 + i % 1280) % 900 < 12) mean[i] += 4.0;
  }
  return Render(scene, mean, random);
}

// Median of the time of one call [us]; what is compared takes turns, so that a busy machine slows
// all.
template <class... Calls>
std::array<double, sizeof...(Calls)> MediansUs(int rounds, const Calls&... calls) {
  std::array<std::vector<double>, sizeof...(Calls)> times;
  const auto time_us = [](const auto& call) {
    const auto start = std::chrono::steady_clock::now();
    call();
    return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start)
        .count();
  };
  for (int round = 0; round < rounds; ++round) {
    std::size_t i = 0;
    (times[i++].push_back(time_us(calls)), ...);
  }
  std::array<double, sizeof...(Calls)> medians;
  for (std::size_t i = 0; i < times.size(); ++i) {
    std::nth_element(times[i].begin(), times[i].begin() + rounds / 2, times[i].end());
    medians[i] = times[i][static_cast<std::size_t>(rounds / 2)];
  }
  return medians;
}

}  // namespace

int main() {
  cv::setNumThreads(1);
  RenderedImage image = Frame();
  const cv::Mat frame(1024, 1280, CV_8U, image.bytes.data());
  tbm::CentreFinder finder({});
  std::size_t centres = 0;
  double total = 0.0;
  std::size_t blobs = 0;
  const auto find = [&] {
    const auto found = finder.Find(image.view);
    centres = found ? found.value()->centres.size() : 0;
  };
  const auto sum = [&] { total = cv::sum(frame)[0]; };
  const auto detector = cv::SimpleBlobDetector::create();
  const auto detect = [&] {
    std::vector<cv::KeyPoint> found;
    detector->detect(frame, found);
    blobs = found.size();
  };
  MediansUs(20, find, sum);
  const auto [find_us, sum_us] = MediansUs(1000, find, sum);
  const auto [find_beside_us, detect_us] = MediansUs(60, find, detect);
  std::printf(
      "finder %.1f us (%zu centres), cv::sum %.1f us (%.0f)\n", find_us, centres, sum_us, total);
  std::printf("finder %.1f us beside SimpleBlobDetector %.1f us (%zu blobs)\n",
              find_beside_us,
              detect_us,
              blobs);
  std::printf(
      "bench find_centres_vs_blob_detector: %.1fx faster than cv::SimpleBlobDetector "
      "(wanted >= 30)\n",
      detect_us / find_beside_us);
  std::printf("bench find_centres_vs_sum: %.2fx the time of cv::sum (wanted <= 4)\n",
              find_us / sum_us);
  return centres == 5 ? 0 : 1;
}
