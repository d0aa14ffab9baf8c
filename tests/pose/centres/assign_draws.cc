#include "tests/pose/centres/assign_draws.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "pose/base/angle.h"

namespace tbm::test {
namespace {

struct Shown {
  Eigen::Vector2d pixel_px;
  int led = -1;
};

bool InImage(const CameraModel& camera, const Eigen::Vector2d& pixel_px) {
  return pixel_px.x() >= 0.0 && pixel_px.y() >= 0.0 &&
         pixel_px.x() <= camera.image_width_px - 1.0 &&
         pixel_px.y() <= camera.image_height_px - 1.0;
}

Eigen::Vector2d Mean(const std::vector<Shown>& leds) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const Shown& led : leds) mean += led.pixel_px;
  return mean / static_cast<double>(leds.size());
}

// A false spot of the kind's own rule; may fall outside the image.
Eigen::Vector2d DrawFalse(const CameraModel& camera,
                          FalseSpots kind,
                          const std::vector<Shown>& leds,
                          Random& random) {
  if (kind == FalseSpots::kUniform) {
    return {random.Uniform(0.0, camera.image_width_px - 1.0),
            random.Uniform(0.0, camera.image_height_px - 1.0)};
  }
  constexpr double kClusterSigmaPx = 130.0;
  return Mean(leds) + random.Normal2(kClusterSigmaPx);
}

// Plane heights as a wet invert below the target, or a wet segment beside it, would have.
void AddMirrored(const std::vector<Shown>& leds,
                 const DrawOptions& options,
                 Random& random,
                 std::vector<Shown>& shown) {
  const Eigen::Vector2d mean = Mean(leds);
  int added = 0;
  for (const int axis : {1, 0}) {
    const double plane_px =
        mean[axis] + random.Uniform(60.0, 250.0) * (random.Unit() < 0.5 ? -1 : 1);
    for (const Shown& led : leds) {
      if (added >= options.most_false) return;
      Eigen::Vector2d pixel_px = led.pixel_px;
      pixel_px[axis] = 2.0 * plane_px - pixel_px[axis];
      shown.push_back({pixel_px + random.Normal2(options.mirror_jitter_px), -1});
      ++added;
    }
  }
}

void AddGhosts(const std::vector<Shown>& leds, Random& random, std::vector<Shown>& shown) {
  for (const Shown& led : leds) {
    const double distance_px = random.Uniform(4.0, 16.0);
    const double direction_rad = random.Uniform(0.0, 6.283185307179586);
    shown.push_back({led.pixel_px + distance_px * Eigen::Vector2d(std::cos(direction_rad),
                                                                  std::sin(direction_rad)),
                     -1});
  }
}

void AddFalse(const CameraModel& camera,
              const DrawOptions& options,
              const std::vector<Shown>& leds,
              Random& random,
              std::vector<Shown>& shown) {
  if (options.kind == FalseSpots::kMirrored) return AddMirrored(leds, options, random, shown);
  if (options.kind == FalseSpots::kGhosts) return AddGhosts(leds, random, shown);
  const int count =
      options.least_false + random.Index(options.most_false - options.least_false + 1);
  for (int i = 0; i < count;) {
    const Eigen::Vector2d pixel_px = DrawFalse(camera, options.kind, leds, random);
    if (!InImage(camera, pixel_px)) continue;
    shown.push_back({pixel_px, -1});
    ++i;
  }
}

template <class T>
void Shuffle(std::vector<T>& items, Random& random) {
  for (std::size_t i = items.size(); i > 1; --i) {
    std::swap(items[i - 1], items[static_cast<std::size_t>(random.Index(static_cast<int>(i)))]);
  }
}

PosePrior DrawPrior(const Rigid3& truth, const DrawOptions& options, Random& random) {
  PosePrior prior;
  PoseError error;
  error.head<3>() = random.Normal3(options.prior_rotation_sigma_rad);
  error.tail<3>() = random.Normal3(options.prior_translation_sigma_m);
  prior.camera_from_target = Moved(truth, error);
  prior.covariance.diagonal().head<3>().setConstant(options.prior_rotation_sigma_rad *
                                                    options.prior_rotation_sigma_rad);
  prior.covariance.diagonal().tail<3>().setConstant(options.prior_translation_sigma_m *
                                                    options.prior_translation_sigma_m);
  return prior;
}

}  // namespace

DrawOptions Visible(int least, int most, FalseSpots kind, int false_spots) {
  DrawOptions options;
  options.least_visible = least;
  options.most_visible = most;
  options.kind = kind;
  options.least_false = options.most_false = false_spots;
  return options;
}

DrawOptions WithPrior(DrawOptions options) {
  options.prior_rotation_sigma_rad = 1e-3;
  options.prior_translation_sigma_m = 2e-3;
  return options;
}

Rig DeclaredRig() {
  Rig rig = FieldRig();
  rig.calibration_residual_px = 0.08;
  rig.intrinsics_sigma_px = {0.6, 0.6, 0.6, 0.6};
  for (Led& led : rig.leds) led.sigma_m = 0.05e-3;
  rig.target_tilt.mounting_sigma_rad = rig.camera_tilt.mounting_sigma_rad = DegToRad(0.004);
  return rig;
}

Rig AsBuilt(const Rig& declared, Random& random) {
  Rig rig = declared;
  rig.camera.fx_px += random.Normal(rig.intrinsics_sigma_px[0]);
  rig.camera.fy_px += random.Normal(rig.intrinsics_sigma_px[1]);
  rig.camera.cx_px += random.Normal(rig.intrinsics_sigma_px[2]);
  rig.camera.cy_px += random.Normal(rig.intrinsics_sigma_px[3]);
  for (Led& led : rig.leds) led.p_led_in_target += random.Normal3(led.sigma_m);
  for (TiltMount* mount : {&rig.target_tilt, &rig.camera_tilt}) {
    mount->tilt_from_body =
        ExpRotation(random.Normal3(mount->mounting_sigma_rad)) * mount->tilt_from_body;
  }
  return rig;
}

Draw DrawFrame(const Rig& as_built, const DrawOptions& options, Random& random) {
  Draw draw;
  draw.truth = DrawTruth(random, options.range);
  const PoseProblem noisy =
      NoisyProblem(as_built, draw.truth, options.centre_sigma_px, options.tilt_sigma_rad, random);
  std::vector<Shown> leds;
  for (const LedObservation& led : noisy.leds) leds.push_back({led.pixel_px, led.led_index});
  Shuffle(leds, random);
  const int visible =
      options.least_visible + random.Index(options.most_visible - options.least_visible + 1);
  leds.resize(std::min(leds.size(), static_cast<std::size_t>(visible)));

  std::vector<Shown> shown = leds;
  AddFalse(as_built.camera, options, leds, random, shown);
  std::erase_if(shown, [&](const Shown& s) { return !InImage(as_built.camera, s.pixel_px); });
  Shuffle(shown, random);
  for (const Shown& spot : shown) {
    Centre centre;
    centre.pixel_px = spot.pixel_px;
    centre.sigma_px = options.centre_sigma_px;
    centre.peak_dn = random.Uniform(60.0, 240.0);  // brightness tells nothing
    centre.spread_px = 2.0;
    draw.centres.push_back(centre);
    draw.led_of_spot.push_back(spot.led);
  }
  draw.target_tilt = noisy.target_tilt;
  draw.camera_tilt = noisy.camera_tilt;
  if (options.prior_translation_sigma_m > 0.0) {
    draw.prior = DrawPrior(draw.truth.camera_from_target, options, random);
  }
  return draw;
}

Answer AnswerTo(const Draw& draw, const Result<Assignment, AssignFailure>& result) {
  if (!result) {
    return result.error() == AssignFailure::kAmbiguous ? Answer::kAmbiguous : Answer::kNoMatch;
  }
  for (std::size_t i = 0; i < result->leds.size(); ++i) {
    const std::size_t spot = static_cast<std::size_t>(result->spot_of_led[i]);
    if (draw.led_of_spot[spot] != result->leds[i].led_index) return Answer::kWrong;
  }
  return Answer::kRight;
}

void Tally::Add(Answer answer) {
  ++draws;
  right += answer == Answer::kRight;
  ambiguous += answer == Answer::kAmbiguous;
  no_match += answer == Answer::kNoMatch;
  wrong += answer == Answer::kWrong;
}

Tally AssignDraws(const Rig& as_built,
                  const Rig& rig,
                  const DrawOptions& options,
                  int count,
                  std::string_view stream) {
  Random random(stream);
  Tally tally;
  for (int i = 0; i < count; ++i) {
    const Draw draw = DrawFrame(as_built, options, random);
    const auto result =
        AssignLeds(rig, draw.centres, draw.target_tilt, draw.camera_tilt, draw.prior);
    const Answer answer = AnswerTo(draw, result);
    tally.Add(answer);
    if (answer != Answer::kRight) continue;
    const auto visible = std::count_if(
        draw.led_of_spot.begin(), draw.led_of_spot.end(), [](int led) { return led >= 0; });
    tally.leds_missed += static_cast<int>(visible) - static_cast<int>(result->leds.size());
  }
  return tally;
}

void Print(std::string_view name, const Tally& tally) {
  const double percent = 100.0 / tally.draws;
  std::printf(
      "%-46.*s %6d draws: right %7.3f %%  ambiguous %6.3f %%  no match %6.3f %%  wrong %6.3f %%  "
      "LEDs missed %d\n",
      static_cast<int>(name.size()),
      name.data(),
      tally.draws,
      percent * tally.right,
      percent * tally.ambiguous,
      percent * tally.no_match,
      percent * tally.wrong,
      tally.leds_missed);
}

}  // namespace tbm::test
