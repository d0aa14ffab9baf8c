#include "devices/total_station/emulated_instrument.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "devices/sim/hash_noise.h"
#include "devices/total_station/geocom_codes.h"

namespace tbm {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr int kNoTargetCode = 8710;
constexpr int kSeveralTargetsCode = 8711;

double Wrapped(double angle_rad) {
  const double rest = std::fmod(angle_rad, 2.0 * kPi);
  return rest < 0.0 ? rest + 2.0 * kPi : rest;
}

// The zenith angle whichever face shows it.
double FirstFaceZenith(const CircleReading& reading) {
  return reading.zenith_rad > kPi ? 2.0 * kPi - reading.zenith_rad : reading.zenith_rad;
}

double HalfTurn(double angle_rad) { return std::remainder(angle_rad, 2.0 * kPi); }

// How the line of sight runs: what a straight ruler and a bent ray make of one point.
struct Sight {
  double bearing_rad;
  double apparent_zenith_rad;
  double slope_m;
};

Sight SightTo(const Eigen::Vector3d& from,
              const Eigen::Vector3d& to,
              const EmulatedErrors& errors) {
  const Eigen::Vector3d way = to - from;
  const double plan_m = std::hypot(way.x(), way.y());
  const double bulge_m = plan_m * plan_m / (2.0 * errors.earth_radius_m);
  return {std::atan2(way.x(), way.y()) + errors.lateral_bend_rad_per_m * plan_m,
          std::atan2(plan_m, way.z() - (1.0 - errors.refraction_k) * bulge_m),
          std::hypot(plan_m, way.z() - bulge_m)};
}

}  // namespace

Eigen::Vector3d EmulatedInstrument::PillarAt(Timestamp at) const {
  Eigen::Vector3d p_in_site =
      pillar.p_in_site + SecondsBetween(pillar.since, at) * pillar.drift_m_per_s;
  for (const EmulatedKnock& knock : pillar.knocks) {
    if (knock.at <= at) p_in_site += knock.shift_m;
  }
  return p_in_site;
}

double EmulatedInstrument::CircleZeroAt(Timestamp at) const {
  double bearing_rad =
      pillar.circle_zero_bearing_rad + SecondsBetween(pillar.since, at) * pillar.drift_rad_per_s;
  for (const EmulatedKnock& knock : pillar.knocks) {
    if (knock.at <= at) bearing_rad += knock.turn_rad;
  }
  return bearing_rad;
}

CircleReading EmulatedInstrument::IdealReading(const Eigen::Vector3d& p_in_site,
                                               Timestamp at,
                                               Face face) const {
  const Sight sight = SightTo(PillarAt(at), p_in_site, errors);
  const double circle_rad = sight.bearing_rad - CircleZeroAt(at);
  if (face == Face::kOne) return {Wrapped(circle_rad), sight.apparent_zenith_rad};
  return {Wrapped(circle_rad + kPi), 2.0 * kPi - sight.apparent_zenith_rad};
}

void EmulatedInstrument::PlungeTelescope() {
  telescope_ = {Wrapped(telescope_.horizontal_rad + kPi), 2.0 * kPi - telescope_.zenith_rad};
}

std::vector<EmulatedInstrument::Seen> EmulatedInstrument::InSight(Timestamp at) const {
  std::vector<Seen> seen;
  const Face face = FaceOf(telescope_);
  for (std::size_t i = 0; i < prisms.size(); ++i) {
    const auto p_in_site = prisms[i].p_in_site(at);
    if (!p_in_site) continue;
    const CircleReading reading = IdealReading(*p_in_site, at, face);
    const double aside_rad = HalfTurn(reading.horizontal_rad - telescope_.horizontal_rad) *
                             std::sin(FirstFaceZenith(reading));
    seen.push_back({i, reading, std::hypot(aside_rad, reading.zenith_rad - telescope_.zenith_rad)});
  }
  std::ranges::sort(seen, {}, &Seen::away_rad);
  return seen;
}

int EmulatedInstrument::FindPrism(double horizontal_window_rad,
                                  double zenith_window_rad,
                                  Timestamp at) {
  is_locked_ = false;
  found_.reset();
  std::vector<Seen> seen = InSight(at);
  if (takes_wrong_prism && seen.size() > 1) {
    takes_wrong_prism = false;
    seen = {seen[1]};
  } else {
    std::erase_if(seen, [&](const Seen& one) {
      const double aside_rad = HalfTurn(one.reading.horizontal_rad - telescope_.horizontal_rad);
      const double up_rad = one.reading.zenith_rad - telescope_.zenith_rad;
      return std::abs(aside_rad) > horizontal_window_rad / 2.0 ||
             std::abs(up_rad) > zenith_window_rad / 2.0;
    });
  }
  if (seen.empty()) return kNoTargetCode;
  // Two in one field of view cannot be told apart; two in a search window can.
  const auto is_beside = [&](const Seen& other) {
    return other.prism != seen[0].prism &&
           std::abs(HalfTurn(other.reading.horizontal_rad - seen[0].reading.horizontal_rad)) <
               kRecognitionRad &&
           std::abs(other.reading.zenith_rad - seen[0].reading.zenith_rad) < kRecognitionRad;
  };
  if (std::ranges::any_of(seen, is_beside)) return kSeveralTargetsCode;
  found_ = seen[0].prism;
  telescope_ = seen[0].reading;
  return geocom::kOk;
}

LockState EmulatedInstrument::LockAt(Timestamp at) const {
  if (!is_locked_) return LockState::kNone;
  return prisms[*found_].p_in_site(at) ? LockState::kLocked : LockState::kPredicting;
}

void EmulatedInstrument::Follow(Timestamp at) {
  if (!is_locked_) return;
  if (const auto p_in_site = prisms[*found_].p_in_site(at)) {
    telescope_ = IdealReading(*p_in_site, at, FaceOf(telescope_));
  }
}

double EmulatedInstrument::Noise() { return sim::NormalFrom(sim::Mixed(errors.seed) + ++draws_); }

std::pair<double, double> EmulatedInstrument::ReadLean(Timestamp at) const {
  double bearing_rad = telescope_.horizontal_rad + CircleZeroAt(at);
  if (FaceOf(telescope_) == Face::kTwo) bearing_rad += kPi;
  const double east = pillar.lean_east_rad;
  const double north = pillar.lean_north_rad;
  return {east * std::sin(bearing_rad) + north * std::cos(bearing_rad),
          east * std::cos(bearing_rad) - north * std::sin(bearing_rad)};
}

bool EmulatedInstrument::IsWithinCompensatorRange() const {
  return std::hypot(pillar.lean_east_rad, pillar.lean_north_rad) <= errors.compensator_range_rad;
}

CircleReading EmulatedInstrument::ReadCircles(Timestamp at) {
  Follow(at);
  const double zenith_rad = FirstFaceZenith(telescope_);
  const double cot = std::cos(zenith_rad) / std::sin(zenith_rad);
  const double side = FaceOf(telescope_) == Face::kOne ? 1.0 : -1.0;
  double circle_rad =
      telescope_.horizontal_rad +
      side * (errors.collimation_rad / std::sin(zenith_rad) + errors.trunnion_rad * cot);
  double reading_rad = telescope_.zenith_rad + errors.index_rad;
  if (!compensator_is_on || !IsWithinCompensatorRange()) {
    // An axis that leans towards the target makes its zenith angle smaller, one that leans to the
    // right shifts the circle against what is above the horizon.
    const auto [length_rad, cross_rad] = ReadLean(at);
    circle_rad -= cross_rad * cot;
    reading_rad -= side * length_rad;
  }
  circle_rad += errors.angle_sigma_rad * Noise() / std::sin(zenith_rad);
  reading_rad += errors.angle_sigma_rad * Noise();
  return {Wrapped(circle_rad), Wrapped(reading_rad)};
}

std::optional<double> EmulatedInstrument::ReadSlope(Timestamp at) {
  Follow(at);
  const std::vector<Seen> seen = InSight(at);
  if (seen.empty()) return std::nullopt;
  const EmulatedPrism& prism = prisms[seen[0].prism];
  const double true_m = SightTo(PillarAt(at), *prism.p_in_site(at), errors).slope_m;
  if (seen[0].away_rad > std::max(kBeamRad, kPrismRadiusM / true_m)) return std::nullopt;
  const double sigma_m = std::hypot(errors.slope_sigma_m, errors.slope_sigma_ppm * 1e-6 * true_m);
  const double raw_m =
      true_m * (1.0 - errors.air_ppm * 1e-6) - prism.constant_m + sigma_m * Noise();
  return (raw_m + prism_constant_m) * (1.0 + ppm * 1e-6);
}

}  // namespace tbm
