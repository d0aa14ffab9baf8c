// The steps of frame_cost.cc as one writes them with OpenCV, on the same frames. Only this program
// links OpenCV, and it stays on the PC: the camera box has none.
#include <cstdio>
#include <vector>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "tests/arm/cost_scene.h"
#include "tests/arm/counted.h"

// OpenCV's core asks for these although no window is ever opened.
extern "C" {
void* glXGetProcAddressARB(const unsigned char*) { return nullptr; }
void* glXGetCurrentContext() { return nullptr; }
void* glXGetCurrentDisplay() { return nullptr; }
}

namespace tbm::test {
namespace {

// Known to frame_cost_test.py; glare is one more than dark.
enum Region : unsigned long {
  kComponents = 11,
  kBlobDetector = 13,
  kSolvePnp = 15,
};

void CountFind(CostFrame& frame, unsigned long glare) {
  const ImageView& view = frame.image.view;
  const cv::Mat image(view.height_px, view.width_px, CV_8U, frame.image.bytes.data());
  cv::Mat bright;
  cv::Mat labels;
  cv::Mat stats;
  cv::Mat centroids;
  int components = 0;
  for (int round = 0; round < 2; ++round) {  // the first takes its memory
    const Counted counted(round == 0 ? 30 : kComponents + glare);
    cv::threshold(image, bright, 16.0, 255.0, cv::THRESH_BINARY);
    components = cv::connectedComponentsWithStats(bright, labels, stats, centroids);
  }
  std::vector<cv::KeyPoint> blobs;
  const auto detector = cv::SimpleBlobDetector::create();
  {
    const Counted counted(kBlobDetector + glare);
    detector->detect(image, blobs);
  }
  std::printf("region %lu threshold + connectedComponentsWithStats: %d components\n",
              kComponents + glare,
              components - 1);
  std::printf("region %lu SimpleBlobDetector: %zu blobs\n", kBlobDetector + glare, blobs.size());
}

void CountSolve(const Rig& rig, const CostFrame& frame) {
  std::vector<cv::Point3d> leds;
  std::vector<cv::Point2d> pixels;
  for (const Led& led : rig.leds) {
    const Eigen::Vector3d& p = led.p_led_in_target;
    const Eigen::Vector2d pixel =
        ExactPixel(rig.camera, frame.prior.camera_from_target * led.p_led_in_target);
    leds.emplace_back(p.x(), p.y(), p.z());
    pixels.emplace_back(pixel.x(), pixel.y());
  }
  const CameraModel& c = rig.camera;
  const cv::Matx33d matrix(c.fx_px, 0, c.cx_px, 0, c.fy_px, c.cy_px, 0, 0, 1);
  const cv::Vec<double, 5> lens(c.k1, c.k2, c.p1, c.p2, c.k3);
  cv::Vec3d turn;
  cv::Vec3d shift;
  for (int round = 0; round < 2; ++round) {
    const Counted counted(round == 0 ? 30ul : static_cast<unsigned long>(kSolvePnp));
    cv::solvePnP(leds, pixels, matrix, lens, turn, shift, false, cv::SOLVEPNP_SQPNP);
    cv::solvePnP(leds, pixels, matrix, lens, turn, shift, true, cv::SOLVEPNP_ITERATIVE);
  }
  std::printf("region %lu solvePnP: %.3f m\n", static_cast<unsigned long>(kSolvePnp), shift[2]);
}

int Main() {
  cv::setNumThreads(1);
  const Rig rig = CostRig();
  std::vector<CostFrame> dark = DarkFrames(rig, 1);
  CountFind(dark[0], 0);
  CountSolve(rig, dark[0]);
  std::vector<CostFrame> glare = GlareFrames(rig, 1);
  CountFind(glare[0], 1);
  return 0;
}

}  // namespace
}  // namespace tbm::test

int main() { return tbm::test::Main(); }
