#include "pose/solve/vision_start.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "pose/solve/p3p.h"

namespace tbm {
namespace {

struct SeenLed {
  Eigen::Vector3d bearing;  // z = 1
  Eigen::Vector3d p_led_in_target;
};
using SeenLeds = FixedVector<SeenLed, kMaxLeds>;

SeenLeds Undistort(const PoseProblem& problem) {
  SeenLeds seen;
  for (const LedObservation& led : problem.leds) {
    const auto point = NormalisedFromPixel(problem.rig->camera, led.pixel_px);
    if (!point) continue;
    seen.push_back({point->homogeneous(),
                    problem.rig->leds[static_cast<std::size_t>(led.led_index)].p_led_in_target});
  }
  return seen;
}

// Sum of squared distances on the plane z = 1. Infinite with an LED behind the camera.
double Mismatch(const SeenLeds& seen, const Rigid3& camera_from_target) {
  double sum = 0.0;
  for (const SeenLed& led : seen) {
    const Eigen::Vector3d p = camera_from_target * led.p_led_in_target;
    if (!(p.z() > 0.0)) return std::numeric_limits<double>::infinity();
    sum += (p.hnormalized() - led.bearing.head<2>()).squaredNorm();
  }
  return sum;
}

struct Ranked {
  Rigid3 camera_from_target;
  double mismatch = 0.0;
};

// Keeps the best few, sorted, each once.
void Insert(const Ranked& candidate, FixedVector<Ranked, 4>& best) {
  constexpr double kSameTurnRad = 0.02;
  for (std::size_t i = 0; i < best.size(); ++i) {
    const PoseError apart = ErrorBetween(best[i].camera_from_target, candidate.camera_from_target);
    if (apart.head<3>().norm() > kSameTurnRad) continue;
    if (best[i].mismatch <= candidate.mismatch) return;
    best.erase(i);
    break;
  }
  if (best.full()) {
    if (best.back().mismatch <= candidate.mismatch) return;
    best.erase(best.size() - 1);
  }
  best.push_back(candidate);
  for (std::size_t i = best.size() - 1; i > 0 && best[i].mismatch < best[i - 1].mismatch; --i) {
    std::swap(best[i], best[i - 1]);
  }
}

// The corner of the target furthest from where the first two already are, in area.
std::size_t WidestThird(const SeenLeds& seen, std::size_t first, std::size_t second) {
  const Eigen::Vector3d side = seen[second].p_led_in_target - seen[first].p_led_in_target;
  std::size_t widest = 0;
  double most = -1.0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const double area =
        side.cross(seen[i].p_led_in_target - seen[first].p_led_in_target).squaredNorm();
    if (area > most) {
      most = area;
      widest = i;
    }
  }
  return widest;
}

std::size_t Furthest(const SeenLeds& seen, std::size_t from) {
  std::size_t furthest = from;
  double most = -1.0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const double distance = (seen[i].p_led_in_target - seen[from].p_led_in_target).squaredNorm();
    if (distance > most) {
      most = distance;
      furthest = i;
    }
  }
  return furthest;
}

}  // namespace

VisionStarts StartVision(const PoseProblem& problem) {
  const SeenLeds seen = Undistort(problem);
  FixedVector<Ranked, 4> best;
  if (seen.size() < 3) return {};
  const std::size_t triples = seen.size() == 3 ? 1 : std::min<std::size_t>(seen.size(), 6);
  for (std::size_t first = 0; first < triples; ++first) {
    const std::size_t second = Furthest(seen, first);
    const std::size_t third = WidestThird(seen, first, second);
    const P3pPoses poses = SolveP3p(
        {seen[first].bearing, seen[second].bearing, seen[third].bearing},
        {seen[first].p_led_in_target, seen[second].p_led_in_target, seen[third].p_led_in_target});
    for (const Rigid3& pose : poses) {
      const double mismatch = Mismatch(seen, pose);
      if (std::isfinite(mismatch)) Insert({pose, mismatch}, best);
    }
  }
  VisionStarts starts;
  for (const Ranked& ranked : best) starts.push_back(ranked.camera_from_target);
  return starts;
}

}  // namespace tbm
