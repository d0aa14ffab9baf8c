#include "pose/centres/assign_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include <Eigen/Cholesky>
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

// A pair of LEDs on a pair of spots, and the pose that follows.
struct PairPose {
  int led_i = 0;
  int led_j = 0;
  int spot_i = 0;
  int spot_j = 0;
  double cos_yaw = 1.0;
  double sin_yaw = 0.0;
  double yaw_sigma_rad = 0.0;
};

class TiltSearch {
 public:
  TiltSearch(const Scene& scene, Candidates& found) : scene_(scene), found_(found) {
    const UpPair& ups = *scene.ups;
    level_from_target_ = Eigen::Quaterniond::FromTwoVectors(ups.up_in_target, ups.up_in_camera);
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
        for (const auto& [i, j] : led_pairs_) TryPair(i, j, a, b);
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
        if (!led_pairs_.full()) led_pairs_.push_back({i, j});
      }
    }
  }

  const Eigen::Vector3d& Ray(int spot) const {
    return scene_.spots[static_cast<std::size_t>(spot)].ray_in_camera;
  }
  const Turning& LedAt(int led) const { return leds_[static_cast<std::size_t>(led)]; }
  double SigmaPx(int spot) const { return scene_.spots[static_cast<std::size_t>(spot)].sigma_px; }

  // Yaw from n . R d = 0 with n the normal of both rays: A cos + B sin + C = 0.
  void TryPair(int i, int j, int a, int b) {
    const Turning baseline = LedAt(j) - LedAt(i);
    const Eigen::Vector3d normal = Ray(a).cross(Ray(b));
    const double cosine = normal.dot(baseline.flat);
    const double sine = normal.dot(baseline.across);
    const double constant = normal.dot(baseline.along);
    const double amplitude2 = cosine * cosine + sine * sine;
    const double root2 = amplitude2 - constant * constant;
    if (!(root2 > 0.0)) return;
    const double root = std::sqrt(root2);
    for (const double sign : {1.0, -1.0}) {
      PairPose pair{i, j, a, b};
      pair.cos_yaw = (-cosine * constant - sign * sine * root) / amplitude2;
      pair.sin_yaw = (-sine * constant + sign * cosine * root) / amplitude2;
      TryPose(baseline, normal, root, pair);
    }
  }

  // Depths along both rays, from z_j ray_j - z_i ray_i = R d.
  std::array<double, 2> Depths(const Eigen::Vector3d& normal,
                               const Eigen::Vector3d& baseline,
                               const PairPose& pair) const {
    const double scale = 1.0 / normal.squaredNorm();
    return {scale * normal.dot(Ray(pair.spot_j).cross(baseline)),
            scale * normal.dot(Ray(pair.spot_i).cross(baseline))};
  }

  bool IsDistance(double z_m) const {
    return z_m >= scene_.options.min_distance_m && z_m <= scene_.options.max_distance_m;
  }

  void TryPose(const Turning& baseline, Eigen::Vector3d normal, double root, PairPose& pair) {
    const Eigen::Vector3d turned = baseline.At(pair.cos_yaw, pair.sin_yaw);
    std::array<double, 2> depths = Depths(normal, turned, pair);
    if (depths[0] < 0.0 && depths[1] < 0.0) {
      // The same two spots the other way round: same yaw, depths of the other sign.
      std::swap(pair.spot_i, pair.spot_j);
      normal = -normal;
      depths = Depths(normal, turned, pair);
    }
    if (!IsDistance(depths[0]) || !IsDistance(depths[1])) return;
    any_pair_ = true;
    const double ray_sigma =
        std::hypot(depths[0] * SigmaPx(pair.spot_i), depths[1] * SigmaPx(pair.spot_j)) / focal_px_;
    pair.yaw_sigma_rad =
        normal.norm() * std::hypot(ray_sigma, tilt_sigma_rad_ * turned.norm()) / root;
    constexpr double kVagueYawRad = 0.06;
    if (pair.yaw_sigma_rad > kVagueYawRad) return;
    LookForThird(baseline, normal, depths, turned, pair);
  }

  // Pixel-scaled image of LED m, for the pose that puts LED i at depth z_i on its ray.
  bool Image(const PairPose& pair,
             double z_i_m,
             const Eigen::Vector3d& arm,
             Eigen::Vector2d& image) const {
    const Eigen::Vector3d p_in_camera = z_i_m * Ray(pair.spot_i) + arm;
    if (!IsDistance(p_in_camera.z())) return false;
    image = focal_px_ / p_in_camera.z() * p_in_camera.head<2>();
    return true;
  }

  void LookForThird(const Turning& baseline,
                    const Eigen::Vector3d& normal,
                    const std::array<double, 2>& depths,
                    const Eigen::Vector3d& turned,
                    const PairPose& pair) {
    const double gate = scene_.options.gate_sigma + 0.5;
    const double cos_next = pair.cos_yaw - pair.yaw_sigma_rad * pair.sin_yaw;
    const double sin_next = pair.sin_yaw + pair.yaw_sigma_rad * pair.cos_yaw;
    const std::array<double, 2> depths_next = Depths(normal, baseline.At(cos_next, sin_next), pair);
    const double pair_sigma_px = std::max(SigmaPx(pair.spot_i), SigmaPx(pair.spot_j));
    const double length_m = turned.norm();
    for (int m = 0; m < static_cast<int>(leds_.size()); ++m) {
      if (m == pair.led_i || m == pair.led_j) continue;
      const Turning arm = LedAt(m) - LedAt(pair.led_i);
      const Eigen::Vector3d arm_now = arm.At(pair.cos_yaw, pair.sin_yaw);
      Eigen::Vector2d image;
      Eigen::Vector2d image_next;
      if (!Image(pair, depths[0], arm_now, image)) continue;
      if (!Image(pair, depths_next[0], arm.At(cos_next, sin_next), image_next)) continue;
      const Eigen::Vector2d by_yaw = image_next - image;
      const double leverage = 1.0 + 2.0 * arm_now.norm() / length_m;
      const double tilt_px = focal_px_ * tilt_sigma_rad_ * arm_now.norm() / depths[0];
      const double across_px =
          0.2 + gate * (leverage * pair_sigma_px + tilt_px) + 0.1 * gate * by_yaw.norm();
      TryThird(pair, depths[0], m, image, by_yaw, gate, across_px);
    }
  }

  void TryThird(const PairPose& pair,
                double z_i_m,
                int led,
                const Eigen::Vector2d& image,
                const Eigen::Vector2d& by_yaw,
                double gate,
                double across_px) {
    const double by_yaw2 = by_yaw.squaredNorm();
    const double scale = by_yaw2 > 1e-12 ? 1.0 / by_yaw2 : 0.0;
    const int spots = static_cast<int>(scene_.spots.size());
    for (int s = 0; s < spots; ++s) {
      const Eigen::Vector2d off = focal_px_ * Ray(s).head<2>() - image;
      const double along = std::clamp(scale * off.dot(by_yaw), -gate, gate);
      if ((off - along * by_yaw).squaredNorm() > across_px * across_px) continue;
      if (s == pair.spot_i || s == pair.spot_j) continue;
      TrySeed(pair, z_i_m, {led, s});
    }
  }

  void TrySeed(const PairPose& pair, double z_i_m, const Match& third) {
    Candidate seed;
    Insert(seed.matches, {pair.led_i, pair.spot_i});
    Insert(seed.matches, {pair.led_j, pair.spot_j});
    Insert(seed.matches, third);
    if (found_.Covers(seed.matches) || refined_ >= kMaxRefinedSeeds) return;
    ++refined_;
    const double yaw_rad = std::atan2(pair.sin_yaw, pair.cos_yaw);
    Rigid3& pose = seed.fit.camera_from_target;
    pose.rotation = Eigen::AngleAxisd(yaw_rad, scene_.ups->up_in_camera) * level_from_target_;
    pose.translation =
        z_i_m * Ray(pair.spot_i) -
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
  FixedVector<std::pair<int, int>, kSeedLedPairs> led_pairs_;
  bool any_pair_ = false;
  int refined_ = 0;
};

// Spots near where the prior expects one LED, the nearest first.
struct Near {
  int spot = 0;
  double distance2 = 0.0;
};
using Nears = FixedVector<Near, kMaxCentres>;

Nears NearSpots(const Scene& scene, const Expected& expected, std::size_t most) {
  Nears nears;
  for (int s = 0; s < static_cast<int>(scene.spots.size()); ++s) {
    const Spot& spot = scene.spots[static_cast<std::size_t>(s)];
    const Eigen::Vector2d off_px = spot.pixel_px - expected.pixel_px;
    Eigen::Matrix2d spread = expected.covariance;
    spread.diagonal().array() += spot.sigma_px * spot.sigma_px;
    const double distance2 = off_px.dot(spread.inverse() * off_px);
    const double gate = scene.options.gate_sigma * scene.options.gate_sigma;
    if (distance2 < gate) nears.push_back({s, distance2});
  }
  std::sort(nears.begin(), nears.end(), [](const Near& a, const Near& b) {
    return std::tie(a.distance2, a.spot) < std::tie(b.distance2, b.spot);
  });
  if (nears.size() > most) nears.resize(most);
  return nears;
}

}  // namespace

void Candidates::Offer(const Candidate& candidate) {
  for (const Candidate& known : list_) {
    if (SameMatches(known.matches, candidate.matches)) return;
  }
  if (list_.full()) {
    if (!Better(candidate, list_.back())) return;
    list_.erase(list_.size() - 1);
  }
  list_.push_back(candidate);
  for (std::size_t i = list_.size() - 1; i > 0 && Better(list_[i], list_[i - 1]); --i) {
    std::swap(list_[i], list_[i - 1]);
  }
}

bool Candidates::Covers(const Matches& matches) const {
  return std::any_of(list_.begin(), list_.end(), [&](const Candidate& candidate) {
    return Contains(candidate.matches, matches);
  });
}

bool SearchByTilts(const Scene& scene, Candidates& found) { return TiltSearch(scene, found).Run(); }

void SearchByPrior(const Scene& scene, Candidates& found) {
  Fit start;
  start.camera_from_target = scene.prior->camera_from_target;
  if (!Refine(scene, {}, UsePrior::kYes, start)) return;
  const PoseCovariance covariance = start.information.ldlt().solve(PoseCovariance::Identity());
  const int leds = static_cast<int>(scene.rig->leds.size());
  const std::size_t most = leds <= 6 ? 6 : 3;
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
          Candidate seed;
          Insert(seed.matches, {i, near_i.spot});
          Insert(seed.matches, {j, near_j.spot});
          if (found.Covers(seed.matches) || refined >= kMaxRefinedSeeds) continue;
          ++refined;
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
