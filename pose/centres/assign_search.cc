#include "pose/centres/assign_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <tuple>
#include <utility>

#include <Eigen/LU>

namespace tbm::assign {
namespace {

bool Better(const Candidate& a, const Candidate& b) {
  if (a.matches.size() != b.matches.size()) return a.matches.size() > b.matches.size();
  return a.fit.chi2 < b.fit.chi2;
}

// A vector of the target turned about the vertical by a yaw: along + cos yaw * flat + sin yaw *
// across.
struct Turning {
  Eigen::Vector3d along = Eigen::Vector3d::Zero();
  Eigen::Vector3d flat = Eigen::Vector3d::Zero();
  Eigen::Vector3d across = Eigen::Vector3d::Zero();

  Eigen::Vector3d At(double cos_yaw, double sin_yaw) const {
    return along + cos_yaw * flat + sin_yaw * across;
  }
};

Turning operator-(const Turning& a, const Turning& b) {
  return {a.along - b.along, a.flat - b.flat, a.across - b.across};
}

struct LedPair {
  int i = 0;
  int j = 0;
  Turning baseline;  // from i to j
  double length_m = 0.0;
};

// Two spots, and what is the same for all LEDs tried on them.
struct SpotPair {
  int a = 0;
  int b = 0;
  Eigen::Vector3d normal;  // of both rays
  double normal_length = 0.0;
  // From z_b ray_b - z_a ray_a = d: z_a = to_depth_a . d and z_b = to_depth_b . d.
  Eigen::Vector3d to_depth_a;
  Eigen::Vector3d to_depth_b;
};

// A length that changes with the yaw: constant + cosine cos yaw + sine sin yaw.
struct Turned {
  double constant = 0.0;
  double cosine = 0.0;
  double sine = 0.0;

  double At(double cos_yaw, double sin_yaw) const {
    return constant + cosine * cos_yaw + sine * sin_yaw;
  }
};

Turned Along(const Eigen::Vector3d& direction, const Turning& turning) {
  return {direction.dot(turning.along), direction.dot(turning.flat), direction.dot(turning.across)};
}

// A pair of LEDs on a pair of spots, and the pose that follows.
struct PairPose {
  int led_i = 0;
  int led_j = 0;
  int spot_i = 0;
  int spot_j = 0;
  double length_m = 0.0;  // between the LEDs
  double cos_yaw = 1.0;
  double sin_yaw = 0.0;
  double yaw_sigma_rad = 0.0;
  double z_i_m = 0.0;       // depth of LED i
  double z_i_next_m = 0.0;  // when the yaw is one sigma larger
};

double Length(double a, double b) { return std::sqrt(a * a + b * b); }

class TiltSearch {
 public:
  TiltSearch(const Scene& scene, Candidates& found) : scene_(scene), found_(found) {
    const UpPair& ups = *scene.ups;
    level_from_target_ = TurnBetween(ups.up_in_target, ups.up_in_camera);
    tilt_sigma_rad_ = UpSigma(ups);
    focal_px_ = 0.5 * (scene.rig->camera.fx_px + scene.rig->camera.fy_px);
    for (const Led& led : scene.rig->leds) {
      const Eigen::Vector3d arm = level_from_target_ * led.p_led_in_target;
      Turning turning;
      turning.along = arm.dot(ups.up_in_camera) * ups.up_in_camera;
      turning.flat = arm - turning.along;
      turning.across = ups.up_in_camera.cross(arm);
      leds_.push_back(turning);
    }
    PickLedPairs();
  }

  bool Run() {
    const int spots = std::min(static_cast<int>(scene_.spots.size()), kSeedSpotsWithTilts);
    for (int b = 1; b < spots; ++b) {
      for (int a = 0; a < b; ++a) {
        SpotPair spot_pair{a, b, Ray(a).cross(Ray(b)), 0.0, {}, {}};
        const double normal2 = spot_pair.normal.squaredNorm();
        spot_pair.normal_length = std::sqrt(normal2);
        spot_pair.to_depth_a = spot_pair.normal.cross(Ray(b)) / normal2;
        spot_pair.to_depth_b = spot_pair.normal.cross(Ray(a)) / normal2;
        for (const LedPair& led_pair : led_pairs_) TryPair(led_pair, spot_pair);
      }
    }
    return any_pair_;
  }

 private:
  // Neighbours in the rig's order first, then LEDs further and further apart: every LED stands in
  // about as many pairs as every other, however early the list ends.
  void PickLedPairs() {
    const int count = static_cast<int>(leds_.size());
    for (int stride = 1; stride <= count / 2; ++stride) {
      for (int i = 0; i < count; ++i) {
        const int j = (i + stride) % count;
        if (2 * stride == count && i >= j) continue;
        if (led_pairs_.full()) return;
        const Turning baseline = LedAt(j) - LedAt(i);
        led_pairs_.push_back({i, j, baseline, (baseline.along + baseline.flat).norm()});
      }
    }
  }

  const Eigen::Vector3d& Ray(int spot) const {
    return scene_.spots[static_cast<std::size_t>(spot)].ray_in_camera;
  }
  const Turning& LedAt(int led) const { return leds_[static_cast<std::size_t>(led)]; }
  double SigmaPx(int spot) const { return scene_.spots[static_cast<std::size_t>(spot)].sigma_px; }

  // Yaw from n . R d = 0 with n the normal of both rays: A cos + B sin + C = 0.
  void TryPair(const LedPair& leds, const SpotPair& spots) {
    const Turned off_plane = Along(spots.normal, leds.baseline);
    const double amplitude2 = off_plane.cosine * off_plane.cosine + off_plane.sine * off_plane.sine;
    const double root2 = amplitude2 - off_plane.constant * off_plane.constant;
    if (!(root2 > 0.0)) return;
    const double root = std::sqrt(root2);
    const double inverse2 = 1.0 / amplitude2;
    const double foot = -off_plane.constant * inverse2;
    const Turned depth_a = Along(spots.to_depth_a, leds.baseline);
    const Turned depth_b = Along(spots.to_depth_b, leds.baseline);
    for (const double sign : {1.0, -1.0}) {
      PairPose pair{leds.i, leds.j, spots.a, spots.b, leds.length_m};
      const double aside = sign * root * inverse2;
      pair.cos_yaw = off_plane.cosine * foot - off_plane.sine * aside;
      pair.sin_yaw = off_plane.sine * foot + off_plane.cosine * aside;
      double z_a_m = depth_a.At(pair.cos_yaw, pair.sin_yaw);
      double z_b_m = depth_b.At(pair.cos_yaw, pair.sin_yaw);
      const bool is_swapped = z_a_m < 0.0 && z_b_m < 0.0;
      if (is_swapped) {
        // The same two spots the other way round: same yaw, depths of the other sign.
        std::swap(pair.spot_i, pair.spot_j);
        z_a_m = -z_a_m;
        z_b_m = -z_b_m;
      }
      if (!IsDistance(z_a_m) || !IsDistance(z_b_m)) continue;
      any_pair_ = true;
      const double ray_sigma =
          Length(z_a_m * SigmaPx(spots.a), z_b_m * SigmaPx(spots.b)) / focal_px_;
      pair.yaw_sigma_rad =
          spots.normal_length * Length(ray_sigma, tilt_sigma_rad_ * leds.length_m) / root;
      constexpr double kVagueYawRad = 0.06;
      if (pair.yaw_sigma_rad > kVagueYawRad) continue;
      const double cos_next = pair.cos_yaw - pair.yaw_sigma_rad * pair.sin_yaw;
      const double sin_next = pair.sin_yaw + pair.yaw_sigma_rad * pair.cos_yaw;
      pair.z_i_m = is_swapped ? z_b_m : z_a_m;
      pair.z_i_next_m =
          is_swapped ? -depth_b.At(cos_next, sin_next) : depth_a.At(cos_next, sin_next);
      LookForThird(pair, cos_next, sin_next);
    }
  }

  bool IsDistance(double z_m) const {
    return z_m >= scene_.options.min_distance_m && z_m <= scene_.options.max_distance_m;
  }

  // Pixel-scaled image of an LED, for the pose that puts LED i at depth z_i on its ray.
  bool Image(const PairPose& pair,
             double z_i_m,
             const Eigen::Vector3d& arm,
             Eigen::Vector2d& image) const {
    const Eigen::Vector3d& ray = Ray(pair.spot_i);
    const double z_m = z_i_m + arm.z();
    if (!IsDistance(z_m)) return false;
    image = focal_px_ / z_m * (z_i_m * ray.head<2>() + arm.head<2>());
    return true;
  }

  void LookForThird(const PairPose& pair, double cos_next, double sin_next) {
    const double gate = scene_.options.gate_sigma + 0.5;
    const double pair_sigma_px = std::max(SigmaPx(pair.spot_i), SigmaPx(pair.spot_j));
    const double leverage_px = 2.0 * pair_sigma_px / pair.length_m;
    const double tilt_px = focal_px_ * tilt_sigma_rad_ / pair.z_i_m;
    for (int m = 0; m < static_cast<int>(leds_.size()); ++m) {
      if (m == pair.led_i || m == pair.led_j) continue;
      const Turning arm = LedAt(m) - LedAt(pair.led_i);
      const Eigen::Vector3d arm_now = arm.At(pair.cos_yaw, pair.sin_yaw);
      Eigen::Vector2d image;
      Eigen::Vector2d image_next;
      if (!Image(pair, pair.z_i_m, arm_now, image)) continue;
      if (!Image(pair, pair.z_i_next_m, arm.At(cos_next, sin_next), image_next)) continue;
      const Eigen::Vector2d by_yaw = image_next - image;
      const double across_px = 0.2 +
                               gate * (pair_sigma_px + (leverage_px + tilt_px) * arm_now.norm()) +
                               0.1 * gate * by_yaw.norm();
      TryThird(pair, m, image, by_yaw, gate, across_px);
    }
  }

  void TryThird(const PairPose& pair,
                int led,
                const Eigen::Vector2d& image,
                const Eigen::Vector2d& by_yaw,
                double gate,
                double across_px) {
    const double by_yaw2 = by_yaw.squaredNorm();
    const double scale = by_yaw2 > 1e-12 ? 1.0 / by_yaw2 : 0.0;
    const double across2 = across_px * across_px;
    // Nothing further off in u passes.
    const double reach_u = across_px + gate * std::abs(by_yaw.x());
    const int spots = static_cast<int>(scene_.spots.size());
    for (int s = 0; s < spots; ++s) {
      const Eigen::Vector3d& ray = Ray(s);
      const double off_u = focal_px_ * ray.x() - image.x();
      if (std::abs(off_u) > reach_u) continue;
      const Eigen::Vector2d off(off_u, focal_px_ * ray.y() - image.y());
      const double along = std::clamp(scale * off.dot(by_yaw), -gate, gate);
      if ((off - along * by_yaw).squaredNorm() > across2) continue;
      if (s == pair.spot_i || s == pair.spot_j) continue;
      TrySeed(pair, {led, s});
    }
  }

  void TrySeed(const PairPose& pair, const Match& third) {
    const std::array<Match, 3> matches = {
        Match{pair.led_i, pair.spot_i}, Match{pair.led_j, pair.spot_j}, third};
    if (found_.Covers(matches) || refined_ >= kMaxRefinedSeeds) return;
    ++refined_;
    Candidate seed;
    for (const Match& match : matches) Insert(seed.matches, match);
    const double yaw_rad = std::atan2(pair.sin_yaw, pair.cos_yaw);
    Rigid3& pose = seed.fit.camera_from_target;
    pose.rotation = Eigen::AngleAxisd(yaw_rad, scene_.ups->up_in_camera) * level_from_target_;
    pose.translation =
        pair.z_i_m * Ray(pair.spot_i) -
        pose.rotation * scene_.rig->leds[static_cast<std::size_t>(pair.led_i)].p_led_in_target;
    if (!Refine(scene_, seed.matches, UsePrior::kNo, seed.fit)) return;
    if (seed.fit.chi2 > Chi2Gate(2.0, scene_.options.gate_sigma)) return;
    if (!Extend(scene_, UsePrior::kNo, seed.matches, seed.fit)) return;
    found_.Offer(seed);
  }

  const Scene& scene_;
  Candidates& found_;
  Eigen::Quaterniond level_from_target_;
  double tilt_sigma_rad_ = 0.0;
  double focal_px_ = 0.0;
  FixedVector<Turning, kMaxLeds> leds_;
  FixedVector<LedPair, kSeedLedPairs> led_pairs_;
  bool any_pair_ = false;
  int refined_ = 0;
};

// Spots near where the prior expects one LED, the nearest first.
struct Near {
  int spot = 0;
  double distance2 = 0.0;
};
constexpr std::size_t kMostNears = 6;
using Nears = FixedVector<Near, kMostNears>;

Nears NearSpots(const Scene& scene, const Expected& expected, std::size_t most) {
  FixedVector<Near, kMaxCentres> all;
  const double gate = scene.options.gate_sigma * scene.options.gate_sigma;
  for (int s = 0; s < static_cast<int>(scene.spots.size()); ++s) {
    const Spot& spot = scene.spots[static_cast<std::size_t>(s)];
    const Eigen::Vector2d off_px = spot.pixel_px - expected.pixel_px;
    Eigen::Matrix2d spread = expected.covariance;
    spread.diagonal().array() += spot.sigma_px * spot.sigma_px;
    const double distance2 = off_px.dot(spread.inverse() * off_px);
    if (distance2 < gate) all.push_back({s, distance2});
  }
  std::sort(all.begin(), all.end(), [](const Near& a, const Near& b) {
    return std::tie(a.distance2, a.spot) < std::tie(b.distance2, b.spot);
  });
  Nears nears;
  for (std::size_t i = 0; i < std::min(all.size(), most); ++i) nears.push_back(all[i]);
  return nears;
}

}  // namespace

void Candidates::Offer(const Candidate& candidate) {
  for (const Candidate& known : *this) {
    if (SameMatches(known.matches, candidate.matches)) return;
  }
  if (size_ == kRoom) {
    if (!Better(candidate, *At(kRoom - 1))) return;
    --size_;
  }
  std::construct_at(At(size_), candidate);
  for (std::size_t i = size_++; i > 0 && Better(*At(i), *At(i - 1)); --i) {
    std::swap(*At(i), *At(i - 1));
  }
}

bool Candidates::Covers(std::span<const Match> matches) const {
  return std::any_of(begin(), end(), [&](const Candidate& candidate) {
    return Contains(candidate.matches, matches);
  });
}

bool SearchByTilts(const Scene& scene, Candidates& found) { return TiltSearch(scene, found).Run(); }

void SearchByPrior(const Scene& scene, Candidates& found) {
  Fit start;
  start.camera_from_target = scene.prior->camera_from_target;
  if (!Refine(scene, {}, UsePrior::kYes, start)) return;
  const PoseCovariance covariance = InverseOf(start.factor);
  const int leds = static_cast<int>(scene.rig->leds.size());
  const std::size_t most = leds <= 6 ? kMostNears : 3;
  FixedVector<Nears, kMaxLeds> nears;
  for (int led = 0; led < leds; ++led) {
    Expected expected;
    const bool seen = Expect(scene, led, start.camera_from_target, covariance, expected);
    nears.push_back(seen ? NearSpots(scene, expected, most) : Nears{});
  }
  int refined = 0;
  for (int j = 1; j < leds; ++j) {
    for (int i = 0; i < j; ++i) {
      for (const Near& near_i : nears[static_cast<std::size_t>(i)]) {
        for (const Near& near_j : nears[static_cast<std::size_t>(j)]) {
          if (near_i.spot == near_j.spot) continue;
          const std::array<Match, 2> matches = {Match{i, near_i.spot}, Match{j, near_j.spot}};
          if (found.Covers(matches) || refined >= kMaxRefinedSeeds) continue;
          ++refined;
          Candidate seed;
          for (const Match& match : matches) Insert(seed.matches, match);
          seed.fit = start;
          if (!Refine(scene, seed.matches, UsePrior::kYes, seed.fit)) continue;
          if (!Extend(scene, UsePrior::kYes, seed.matches, seed.fit)) continue;
          found.Offer(seed);
        }
      }
    }
  }
}

}  // namespace tbm::assign
