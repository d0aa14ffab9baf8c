#include <algorithm>
#include <array>
#include <cmath>

#include "pose/centres/assign_search.h"
#include "pose/solve/p3p.h"

namespace tbm::assign {
namespace {

using Triple = std::array<int, 3>;

class VisionSearch {
 public:
  VisionSearch(const Scene& scene, Candidates& found) : scene_(scene), found_(found) {}

  bool Run() {
    const int spots = std::min(static_cast<int>(scene_.spots.size()), kSeedSpotsWithoutTilts);
    const FixedVector<Triple, kSeedLedTriples> led_triples = PickLedTriples();
    for (int a = 0; a < spots; ++a) {
      for (int b = 0; b < spots; ++b) {
        for (int c = 0; c < spots; ++c) {
          if (a == b || a == c || b == c) continue;
          for (const Triple& leds : led_triples) TryTriple(leds, {a, b, c});
        }
      }
    }
    return any_triple_;
  }

 private:
  // Triples i, i + s, i + 2 s - and on, so that every LED stands in about as many as every other.
  FixedVector<Triple, kSeedLedTriples> PickLedTriples() const {
    const int count = static_cast<int>(scene_.rig->leds.size());
    FixedVector<Triple, kSeedLedTriples> triples;
    for (int first_step = 1; first_step < count; ++first_step) {
      for (int second_step = 1; second_step < count - first_step; ++second_step) {
        for (int i = 0; i < count && !triples.full(); ++i) {
          Triple triple = {i, (i + first_step) % count, (i + first_step + second_step) % count};
          std::sort(triple.begin(), triple.end());
          if (std::find(triples.begin(), triples.end(), triple) == triples.end()) {
            triples.push_back(triple);
          }
        }
      }
    }
    return triples;
  }

  const Eigen::Vector3d& Ray(int spot) const {
    return scene_.spots[static_cast<std::size_t>(spot)].ray_in_camera;
  }
  const Eigen::Vector3d& LedAt(int led) const {
    return scene_.rig->leds[static_cast<std::size_t>(led)].p_led_in_target;
  }

  bool IsDistance(const Rigid3& pose, const Triple& leds) const {
    return std::all_of(leds.begin(), leds.end(), [&](int led) {
      const double z_m = (pose * LedAt(led)).z();
      return z_m >= scene_.options.min_distance_m && z_m <= scene_.options.max_distance_m;
    });
  }

  void TryTriple(const Triple& leds, const Triple& spots) {
    const P3pPoses poses = SolveP3p({Ray(spots[0]), Ray(spots[1]), Ray(spots[2])},
                                    {LedAt(leds[0]), LedAt(leds[1]), LedAt(leds[2])});
    for (const Rigid3& pose : poses) {
      if (!IsDistance(pose, leds)) continue;
      if (ContradictsUps(pose)) continue;
      any_triple_ = true;
      if (ExplainsFourth(pose, leds, spots)) TrySeed(pose, leds, spots);
    }
  }

  bool ContradictsUps(const Rigid3& pose) const {
    if (!scene_.ups) return false;
    const Eigen::Vector3d off = scene_.ups->up_in_camera - pose.rotation * scene_.ups->up_in_target;
    // Three LEDs seen nearly face-on leave their own tilt uncertain by some degrees.
    constexpr double kTripleSigmaRad = 0.03;
    const double gate =
        scene_.options.gate_sigma * std::hypot(UpSigma(*scene_.ups), kTripleSigmaRad);
    return off.squaredNorm() > gate * gate;
  }

  // A coarse look before the fit: three centres place a fourth LED of a target seen nearly face-on
  // to some tens of their own sigma.
  bool ExplainsFourth(const Rigid3& pose, const Triple& leds, const Triple& spots) const {
    constexpr double kLeverage = 15.0;
    const CameraModel& camera = scene_.rig->camera;
    for (int m = 0; m < static_cast<int>(scene_.rig->leds.size()); ++m) {
      if (std::find(leds.begin(), leds.end(), m) != leds.end()) continue;
      const Eigen::Vector3d p_in_camera = pose * LedAt(m);
      if (p_in_camera.z() < scene_.options.min_distance_m) continue;
      const Eigen::Vector2d image = p_in_camera.head<2>() / p_in_camera.z();
      for (int s = 0; s < static_cast<int>(scene_.spots.size()); ++s) {
        const Spot& spot = scene_.spots[static_cast<std::size_t>(s)];
        const double reach = kLeverage * scene_.options.gate_sigma * spot.sigma_px / camera.fx_px;
        if ((spot.ray_in_camera.head<2>() - image).squaredNorm() > reach * reach) continue;
        if (std::find(spots.begin(), spots.end(), s) == spots.end()) return true;
      }
    }
    return false;
  }

  void TrySeed(const Rigid3& pose, const Triple& leds, const Triple& spots) {
    Candidate seed;
    for (std::size_t i = 0; i < leds.size(); ++i) seed.matches.push_back({leds[i], spots[i]});
    if (found_.Covers(seed.matches) || refined_ >= kMaxRefinedSeeds) return;
    ++refined_;
    seed.fit.camera_from_target = pose;
    if (!Refine(scene_, seed.matches, UsePrior::kNo, seed.fit)) return;
    if (!Extend(scene_, UsePrior::kNo, seed.matches, seed.fit)) return;
    if (seed.matches.size() > leds.size()) found_.Offer(seed);
  }

  const Scene& scene_;
  Candidates& found_;
  bool any_triple_ = false;
  int refined_ = 0;
};

}  // namespace

bool SearchByVision(const Scene& scene, Candidates& found) {
  return VisionSearch(scene, found).Run();
}

}  // namespace tbm::assign
