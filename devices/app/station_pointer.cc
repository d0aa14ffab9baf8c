#include "devices/app/station_pointer.h"

#include <cmath>
#include <numbers>

namespace tbm {
namespace {

using enum StationFailure;

constexpr int kMostAttempts = 4;     // of a motion that was not carried out
constexpr double kFieldRad = 0.025;  // of target recognition, full width
constexpr double kPi = std::numbers::pi;

// Nothing more can be asked for on this connection, or there is none.
bool MeansGone(const StationFault& fault) {
  return fault.why == kNotConnected || fault.why == kLinkLost || fault.why == kUnreachable ||
         fault.why == kRefused;
}

// The line, not the world: the same may be told again.
bool IsOfTheLine(const StationFault& fault) {
  return fault.why == kTimeout || fault.why == kGarbled || fault.why == kBusy ||
         fault.why == kImplausible || fault.why == kAborted || fault.why == kInaccurate;
}

CircleReading InFace(const Pointing& pointing) {
  if (pointing.face == Face::kOne) return {Turn(pointing.circle_rad), pointing.zenith_rad};
  return {Turn(pointing.circle_rad + kPi), 2.0 * kPi - pointing.zenith_rad};
}

}  // namespace

std::optional<StationFault> StationPointer::FineAdjust() {
  std::optional<StationFault> fault;
  for (int attempt = 0; attempt < kMostAttempts && !is_ending_(); ++attempt) {
    const auto done = instrument_.FineAdjust({kFieldRad, kFieldRad});
    if (done) return {};
    fault = done.error();
    if (fault->why != kOutcomeUnknown && fault->why != kNotExecuted && !IsOfTheLine(*fault)) break;
  }
  return fault;
}

std::optional<StationFault> StationPointer::Aim(const Pointing& pointing) {
  std::optional<StationFault> fault;
  const SearchWindow window{config_.keeper.window.horizontal_rad,
                            config_.keeper.window.vertical_rad};
  for (int attempt = 0; attempt < kMostAttempts && !is_ending_(); ++attempt) {
    const auto turned = instrument_.TurnTo(InFace(pointing), tbm::Aim::kPrism);
    if (turned) return {};
    fault = turned.error();
    // The prism that is nearest now is not always the one that was aimed at; geometry tells.
    if (fault->why == kOutcomeUnknown) return FineAdjust();
    if (fault->why == kNotExecuted || IsOfTheLine(*fault)) continue;
    const bool may_search = fault->why == kNoTarget && pointing.is_rough;
    if (!may_search) return fault;
    const auto found = instrument_.Search(window);
    if (found) return FineAdjust();
    fault = found.error();
    if (fault->why == kOutcomeUnknown) return FineAdjust();
    if (fault->why != kNotExecuted && !IsOfTheLine(*fault)) return fault;
  }
  return fault;
}

bool StationPointer::Reduce(const StationTarget& target,
                            const PolarObservation& observation,
                            Pointed* pointed) {
  const auto applied_m = observation.prism_constant_m ? observation.prism_constant_m
                                                      : config_.distance.assumed_prism_constant_m;
  const auto applied_ppm = observation.ppm ? observation.ppm : config_.distance.assumed_ppm;
  if (!applied_m || !applied_ppm) return false;
  const double wanted_m =
      target.kind == TargetKind::kPrism
          ? config_.prism_constant_m
          : config_.reference_constants_m[static_cast<std::size_t>(target.index)];
  pointed->to_be_added.prism_constant_m = wanted_m - *applied_m;
  pointed->to_be_added.air_correction_ppm =
      AirCorrection_ppm(config_.distance.air, config_.distance.meter) - *applied_ppm;
  return true;
}

StationPointer::Outcome StationPointer::Carry(const Pointing& pointing) {
  Outcome outcome;
  outcome.pointed.at = clock_.Now();
  const auto fail = [&](const StationFault& fault) {
    outcome.fault = fault;
    outcome.pointed.failure = FailureCode(fault.why);
    outcome.is_gone = MeansGone(fault) || !instrument_.IsConnected();
    return outcome;
  };
  if (const auto fault = Aim(pointing)) return fail(*fault);
  std::optional<StationFault> fault;
  for (int attempt = 0; attempt < kMostAttempts && !is_ending_(); ++attempt) {
    const auto measured = instrument_.Measure();
    if (measured) {
      outcome.observation = *measured;
      fault.reset();
      break;
    }
    fault = measured.error();
    if (!IsOfTheLine(*fault)) break;
  }
  if (fault) return fail(*fault);
  if (!outcome.observation) return fail({kAborted});

  const PolarObservation& observation = *outcome.observation;
  Pointed& pointed = outcome.pointed;
  pointed.at = observation.sensed_at;
  pointed.within_s = 1e-9 * static_cast<double>(observation.sensed_within.count());
  pointed.raw = {observation.circles.horizontal_rad,
                 observation.circles.zenith_rad,
                 observation.slope_m,
                 observation.face};
  // A lean that the compensator cannot take up is an error without a limit.
  if (observation.quality == ObservationQuality::kNotFullyCorrected) {
    pointed.failure = FailureCode(kTilted);
    outcome.fault = StationFault{kTilted, observation.return_code};
    return outcome;
  }
  if (observation.face != pointing.face) {
    pointed.failure = FailureCode(kNotExecuted);
    return outcome;
  }
  if (observation.quality == ObservationQuality::kNoAccuracy) pointed.doubt = "no_accuracy";
  if (pointed.raw.slope_m && !Reduce(pointing.target, observation, &pointed)) {
    pointed.raw.slope_m.reset();
    pointed.doubt = "setting_unknown";
  }
  return outcome;
}

}  // namespace tbm
