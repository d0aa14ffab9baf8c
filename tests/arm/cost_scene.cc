#include "tests/arm/cost_scene.h"

#include <algorithm>
#include <cmath>

#include "pose/base/angle.h"
#include "tests/pose/solve/as_built.h"

namespace tbm::test {
namespace {

constexpr double kTiltSigmaRad = 8.7266e-5;  // 0.005 degree

RenderScene EmptyScene() {
  RenderScene scene;
  scene.width_px = 1280;
  scene.height_px = 1024;
  scene.background_dn = 7.0;
  scene.read_noise_dn = 1.0;
  return scene;
}

void AddLeds(const PoseProblem& seen, Random& random, RenderScene& scene) {
  for (const LedObservation& led : seen.leds) {
    RenderSpot spot;
    spot.pixel_px = led.pixel_px;
    spot.sigma_px = 2.3;
    spot.peak_dn = random.Uniform(120.0, 220.0);
    scene.spots.push_back(spot);
  }
}

void AddPipe(std::vector<double>& mean) {
  for (std::size_t i = 0; i < mean.size(); ++i) {
    if ((i / 1280 + i % 1280) % 900 < 12) mean[i] += 4.0;
  }
}

// A disc of full scale with a halo.
void AddLamp(double u_px, double v_px, double radius_px, std::vector<double>& mean) {
  for (std::size_t i = 0; i < mean.size(); ++i) {
    const double u = static_cast<double>(i % 1280) - u_px;
    const double v = static_cast<double>(i / 1280) - v_px;
    const double beyond = std::hypot(u, v) - radius_px;
    if (beyond > 150.0) continue;
    mean[i] +=
        beyond <= 0.0 ? 400.0 : 300.0 * std::exp(-beyond / 8.0) + 25.0 * std::exp(-beyond / 40.0);
  }
}

// 240 glints of wet steel, smaller than an LED; 40 streaks; 20 round ones like LEDs, as many as the
// assignment is made for.
void AddFalseSpots(Random& random, RenderScene& scene) {
  for (int i = 0; i < 300; ++i) {
    RenderSpot spot;
    spot.pixel_px = {random.Uniform(0.0, 1280.0), random.Uniform(0.0, 1024.0)};
    spot.peak_dn = random.Uniform(25.0, 200.0);
    if (i < 240) {
      spot.sigma_px = random.Uniform(0.3, 0.6);
    } else if (i < 280) {
      spot.sigma_px = random.Uniform(0.8, 1.5);
      const double angle = random.Uniform(0.0, 3.14);
      spot.smear_px =
          random.Uniform(12.0, 30.0) * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    } else {
      spot.sigma_px = random.Uniform(1.0, 3.0);
    }
    scene.spots.push_back(spot);
  }
}

template <class AddRest>
std::vector<CostFrame> Frames(const Rig& rig, int count, const char* stream, AddRest add_rest) {
  std::vector<CostFrame> frames;
  Random random(stream);
  const Truth truth = DrawTruth(random, {3.0, 3.0});
  for (int i = 0; i < count; ++i) {
    const PoseProblem seen = NoisyProblem(rig, truth, 0.0, kTiltSigmaRad, random);
    RenderScene scene = EmptyScene();
    AddLeds(seen, random, scene);
    for (int hot = 0; hot < 40; ++hot) {
      scene.hot.push_back({random.Index(1280), random.Index(1024), random.Uniform(20.0, 200.0)});
    }
    std::vector<double> mean = add_rest(random, scene);
    CostFrame frame;
    frame.image = Render(scene, mean, random);
    frame.sensed_at = Timestamp{} + i * std::chrono::milliseconds(200);
    frame.target_tilt = *seen.target_tilt;
    frame.camera_tilt = *seen.camera_tilt;
    frame.prior.camera_from_target = truth.camera_from_target;
    frame.prior.covariance.diagonal() << 1e-4, 1e-4, 1e-4, 6.4e-3, 6.4e-3, 6.4e-3;
    frames.push_back(std::move(frame));
  }
  return frames;
}

}  // namespace

Rig CostRig() {
  Rig rig = FieldRig();
  DeclareFieldSigmas(rig);
  return rig;
}

std::vector<CostFrame> DarkFrames(const Rig& rig, int count) {
  return Frames(rig, count, "frame_cost dark", [](Random&, RenderScene& scene) {
    std::vector<double> mean = RenderMean(scene);
    AddPipe(mean);
    return mean;
  });
}

std::vector<CostFrame> GlareFrames(const Rig& rig, int count) {
  return Frames(rig, count, "frame_cost glare", [](Random& random, RenderScene& scene) {
    AddFalseSpots(random, scene);
    std::vector<double> mean = RenderMean(scene);
    AddPipe(mean);
    AddLamp(1040.0, 180.0, 60.0, mean);
    return mean;
  });
}

std::vector<CostFrame> CrowdFrames(const Rig& rig, int count) {
  return Frames(rig, count, "frame_cost crowd", [](Random& random, RenderScene& scene) {
    for (int i = 0; i < 300; ++i) {
      RenderSpot spot;
      spot.pixel_px = {random.Uniform(0.0, 1280.0), random.Uniform(0.0, 1024.0)};
      spot.sigma_px = random.Uniform(1.0, 4.0);
      spot.peak_dn = random.Uniform(25.0, 200.0);
      scene.spots.push_back(spot);
    }
    return RenderMean(scene);
  });
}

}  // namespace tbm::test
