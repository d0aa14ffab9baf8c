#include "devices/total_station/geocom_total_station.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "devices/total_station/geocom_codes.h"

namespace tbm {
namespace {

using enum StationFailure;
using std::chrono::milliseconds;

constexpr double kFullCircle = 2.0 * std::numbers::pi;

constexpr int kMostAttempts = 3;          // of a call that may be repeated
constexpr int kMostTimeouts = 2;          // of them without any answer
constexpr milliseconds kBusyPause(200);   // before a busy instrument is asked again
constexpr milliseconds kStillPause(200);  // between two looks at a telescope
constexpr double kStillWithinRad = 2e-5;  // twice the noise of a 1" instrument, and a slow prism
constexpr double kRecognitionFieldRad = 0.03;  // target recognition never moves further than that
constexpr double kPrismConstantStepM = 5e-5;   // instruments keep tenths of a millimetre
constexpr double kPpmStep = 0.06;

double Wrapped(double angle_rad) {
  const double rest = std::fmod(angle_rad, kFullCircle);
  return rest < 0.0 ? rest + kFullCircle : rest;
}

double DistanceOnCircle(double a_rad, double b_rad) {
  return std::abs(std::remainder(a_rad - b_rad, kFullCircle));
}

bool AreNear(const CircleReading& a, const CircleReading& b, double within_rad) {
  return DistanceOnCircle(a.horizontal_rad, b.horizontal_rad) <= within_rad &&
         DistanceOnCircle(a.zenith_rad, b.zenith_rad) <= within_rad;
}

bool IsCircle(double angle_rad) { return angle_rad > -1e-6 && angle_rad < kFullCircle + 1e-6; }

std::optional<CircleReading> CirclesFrom(const std::vector<std::string>& values) {
  const auto horizontal = GeocomReal(values[0]);
  const auto zenith = GeocomReal(values[1]);
  if (!horizontal || !zenith || !IsCircle(*horizontal) || !IsCircle(*zenith)) return std::nullopt;
  return CircleReading{Wrapped(*horizontal), Wrapped(*zenith)};
}

// After these nobody knows what the instrument has done.
bool LeavesOpen(const StationFault& fault) {
  return fault.why == kTimeout || fault.why == kLinkLost ||
         (fault.why == kGarbled && fault.return_code == 0);
}

StationFault FaultOfCode(int code) {
  return {FailureOfGeocomCode(code).value_or(kImplausible), code};
}

Failure<StationFault> Fail(StationFailure why, int code = 0) {
  return Failure{StationFault{why, code}};
}

}  // namespace

Result<StationPower, StationFault> GeocomTotalStation::ReadPower() {
  const auto answer = Plain(geocom::kCheckPower, "", 3);
  if (!answer) return Failure{answer.error()};
  const auto percent = GeocomInteger(answer->values[0]);
  const auto source = GeocomInteger(answer->values[1]);
  if (!percent || !source || *percent < 0 || *percent > 100) {
    return Failure{Failed({kImplausible})};
  }
  const StationPower power{static_cast<int>(*percent), *source == 1};
  const std::lock_guard lock(mutex_);
  health_.power = power;
  return power;
}

Result<double, StationFault> GeocomTotalStation::ReadTemperatureCelsius() {
  return ReadOneReal(geocom::kGetTemperature);
}

Result<double, StationFault> GeocomTotalStation::ReadOneReal(int rpc) {
  const auto answer = Plain(rpc, "", 1);
  if (!answer) return Failure{answer.error()};
  const auto value = GeocomReal(answer->values[0]);
  if (!value) return Failure{Failed({kImplausible})};
  return *value;
}

Result<Done, StationFault> GeocomTotalStation::SetPrismConstant(double constant_m) {
  wanted_prism_constant_m_ = constant_m;
  const auto is_taken = [&] {
    return std::abs(*prism_constant_m_ - constant_m) < kPrismConstantStepM;
  };
  const auto before = ReadOneReal(geocom::kGetPrismConstant);
  if (!before) return Failure{before.error()};
  prism_constant_m_ = *before;
  if (is_taken()) return Done{};
  prism_constant_m_.reset();  // until it is read back, also when the answer to the setting is lost
  const auto set = PlainDone(geocom::kSetPrismConstant, GeocomNumber(constant_m));
  if (!set) return set;
  const auto after = ReadOneReal(geocom::kGetPrismConstant);
  if (!after) return Failure{after.error()};
  prism_constant_m_ = *after;
  if (!is_taken()) return Failure{Failed({kSettingNotTaken})};
  return Done{};
}

Result<Done, StationFault> GeocomTotalStation::SetAtmosphere(double ppm) {
  wanted_ppm_ = ppm;
  ppm_.reset();
  const auto set = PlainDone(geocom::kSetAtmospherePpm, GeocomNumber(ppm));
  if (!set) return set;
  const auto after = ReadOneReal(geocom::kGetAtmospherePpm);
  if (!after) return Failure{after.error()};
  ppm_ = *after;
  if (std::abs(*after - ppm) > kPpmStep) return Failure{Failed({kSettingNotTaken})};
  return Done{};
}

Result<Done, StationFault> GeocomTotalStation::TurnTo(const CircleReading& target, Aim aim) {
  const CircleReading wanted{Wrapped(target.horizontal_rad), Wrapped(target.zenith_rad)};
  const auto outcome = [&](const CircleReading& standing) -> Result<Done, StationFault> {
    if (aim == Aim::kDirection) {
      if (AreNear(standing, wanted, config_.arrived_within_rad)) return Done{};
      return Fail(kNotExecuted);
    }
    return Fail(AreNear(standing, wanted, kRecognitionFieldRad) ? kOutcomeUnknown : kNotExecuted);
  };
  return Motion(geocom::kMakePositioning,
                fmt::format("{},{},0,{},0",
                            GeocomNumber(wanted.horizontal_rad),
                            GeocomNumber(wanted.zenith_rad),
                            aim == Aim::kPrism ? 1 : 0),
                outcome);
}

Result<Done, StationFault> GeocomTotalStation::ChangeFace(Aim aim) {
  const auto before = Plain(geocom::kGetAngles, "1", 2);
  if (!before) return Failure{before.error()};
  const auto circles = CirclesFrom(before->values);
  if (!circles) return Failure{Failed({kImplausible})};
  const auto outcome = [&](const CircleReading& standing) -> Result<Done, StationFault> {
    if (FaceOf(standing) == FaceOf(*circles)) return Fail(kNotExecuted);
    if (aim == Aim::kPrism) return Fail(kOutcomeUnknown);
    return Done{};
  };
  return Motion(geocom::kChangeFace, fmt::format("0,{},0", aim == Aim::kPrism ? 1 : 0), outcome);
}

Result<Done, StationFault> GeocomTotalStation::Search(const SearchWindow& window) {
  return Motion(
      geocom::kSearch,
      fmt::format("{},{},0", GeocomNumber(window.horizontal_rad), GeocomNumber(window.zenith_rad)),
      [](const CircleReading&) -> Result<Done, StationFault> { return Fail(kOutcomeUnknown); });
}

Result<Done, StationFault> GeocomTotalStation::FineAdjust(const SearchWindow& window) {
  return Motion(
      geocom::kFineAdjust,
      fmt::format("{},{},0", GeocomNumber(window.horizontal_rad), GeocomNumber(window.zenith_rad)),
      [](const CircleReading&) -> Result<Done, StationFault> { return Fail(kOutcomeUnknown); });
}

Result<Done, StationFault> GeocomTotalStation::LockIn() {
  const auto on = EitherDone(geocom::kSetLock, geocom::kSetLockOld, "1");
  if (!on) return on;
  return Motion(geocom::kLockIn, "", [this](const CircleReading&) -> Result<Done, StationFault> {
    const auto lock = ReadLock();
    if (!lock) return Failure{lock.error()};
    if (*lock == LockState::kNone) return Fail(kNotExecuted);
    return Done{};
  });
}

Result<Done, StationFault> GeocomTotalStation::ReleaseLock() {
  return EitherDone(geocom::kSetLock, geocom::kSetLockOld, "0");
}

Result<LockState, StationFault> GeocomTotalStation::ReadLock() {
  const auto answer = Plain(geocom::kReadLockStatus, "", 1);
  if (!answer) return Failure{answer.error()};
  const auto status = GeocomInteger(answer->values[0]);
  if (!status || *status < 0 || *status > 2) return Failure{Failed({kImplausible})};
  return static_cast<LockState>(*status);
}

Result<PolarObservation, StationFault> GeocomTotalStation::Measure() {
  if (const auto fault = SettleFirst()) return Failure{*fault};
  // The instrument hands out its last distance until it is told to forget it: without this, a
  // start that gets lost would bring the distance of the prism before.
  const auto cleared = PlainDone(geocom::kDoMeasure, fmt::format("{},1", geocom::kMeasureClear));
  if (!cleared) return Failure{cleared.error()};
  const auto started = Once({geocom::kDoMeasure,
                             fmt::format("{},1", geocom::kMeasureDefault),
                             0,
                             config_.answer_timeout,
                             false});
  if (!started) return Failure{started.error()};
  if (FailureOfGeocomCode(started->return_code)) {
    return Failure{Failed(FaultOfCode(started->return_code))};
  }
  const auto answer = AwaitDistance();
  if (!answer) return Failure{answer.error()};
  const auto observation = ToObservation(*answer, started->sent);
  if (!observation) return Failure{Failed(observation.error())};
  return observation;
}

// A distance that is there stays until it is cleared, so asking again is harmless.
GeocomTotalStation::Answer GeocomTotalStation::AwaitDistance() {
  const auto wait_ms = std::max<std::int64_t>(
      100,
      std::chrono::duration_cast<milliseconds>(config_.measure_timeout - config_.answer_timeout)
          .count());
  const std::string parameters = fmt::format("{},1", wait_ms);
  if (has_full_measure_) {
    auto answer = Ask({geocom::kGetFullMeasure, parameters, 8, config_.measure_timeout, false});
    const int code = answer ? answer->return_code : answer.error().return_code;
    if (FailureOfGeocomCode(code) != kNotSupported) return answer;
    has_full_measure_ = false;
  }
  return Ask({geocom::kGetSimpleMeasure, parameters, 3, config_.measure_timeout, false});
}

Result<PolarObservation, StationFault> GeocomTotalStation::ToObservation(const GeocomAnswer& answer,
                                                                         SteadyTime begun) const {
  const auto parts = PartsOfGeocomCode(answer.return_code);
  if (!parts) return Failure{FaultOfCode(answer.return_code)};
  const auto& values = answer.values;
  const auto circles = CirclesFrom(values);
  if (!circles) return Fail(kImplausible);
  PolarObservation observation = Stamped(begun, answer.received);
  observation.circles = *circles;
  observation.face = FaceOf(*circles);
  observation.quality = parts->quality;
  observation.return_code = answer.return_code;
  const bool is_full = values.size() == 8;
  if (is_full) {
    observation.angle_sigma_rad = GeocomReal(values[2]);
    observation.tilt_cross_rad = GeocomReal(values[3]);
    observation.tilt_length_rad = GeocomReal(values[4]);
  }
  if (parts->has_distance) {
    const auto slope_m = GeocomReal(values[is_full ? 6 : 2]);
    if (!slope_m || *slope_m <= 0.0 || *slope_m > config_.longest_distance_m) {
      return Fail(kImplausible);
    }
    observation.slope_m = *slope_m;
  }
  return observation;
}

Result<PolarObservation, StationFault> GeocomTotalStation::MeasureAngles() {
  if (const auto fault = SettleFirst()) return Failure{*fault};
  return AnglesAndTilt();
}

Result<PolarObservation, StationFault> GeocomTotalStation::AnglesAndTilt() {
  const auto answer = Ask({geocom::kGetAngleAndTilt, "0", 9, config_.answer_timeout, false});
  if (!answer) return Failure{answer.error()};
  const auto parts = PartsOfGeocomCode(answer->return_code);
  if (!parts) return Failure{Failed(FaultOfCode(answer->return_code))};
  const auto circles = CirclesFrom(answer->values);
  if (!circles) return Failure{Failed({kImplausible})};
  PolarObservation observation = Stamped(answer->sent, answer->received);
  observation.circles = *circles;
  observation.face = FaceOf(*circles);
  observation.quality = parts->quality;
  observation.return_code = answer->return_code;
  observation.angle_sigma_rad = GeocomReal(answer->values[2]);
  observation.tilt_cross_rad = GeocomReal(answer->values[4]);
  observation.tilt_length_rad = GeocomReal(answer->values[5]);
  return observation;
}

Result<CompensatorReading, StationFault> GeocomTotalStation::ReadCompensator() {
  const auto observation = AnglesAndTilt();
  if (!observation) return Failure{observation.error()};
  if (!observation->tilt_length_rad || !observation->tilt_cross_rad) {
    return Failure{Failed({kImplausible})};
  }
  return CompensatorReading{observation->sensed_at,
                            *observation->tilt_length_rad,
                            *observation->tilt_cross_rad,
                            observation->quality};
}

PolarObservation GeocomTotalStation::Stamped(SteadyTime begun, SteadyTime ended) const {
  PolarObservation observation;
  const SteadyTime middle = begun + (ended - begun) / 2;
  observation.sensed_at = clock_.Now() - (clock_.Steady() - middle);
  observation.sensed_within = (ended - begun) / 2;
  observation.prism_constant_m = prism_constant_m_;
  observation.ppm = ppm_;
  return observation;
}

Result<Done, StationFault> GeocomTotalStation::Motion(int rpc,
                                                      std::string parameters,
                                                      const Outcome& outcome) {
  if (const auto fault = SettleFirst()) return Failure{*fault};
  const auto answer = Once({rpc, std::move(parameters), 0, config_.motion_timeout, true});
  if (answer && answer->return_code == geocom::kOk) return Done{};
  const StationFault fault = answer ? FaultOfCode(answer->return_code) : answer.error();
  if (!LeavesOpen(fault)) return Failure{Failed(fault)};
  is_motion_open_ = true;
  if (!IsConnected()) return Failure{fault};
  const auto standing = WaitUntilStill();
  if (!standing) return Failure{standing.error()};
  is_motion_open_ = false;
  auto known = outcome(*standing);
  if (!known) return Failure{Failed(known.error())};
  return known;
}

std::optional<StationFault> GeocomTotalStation::SettleFirst() {
  if (!IsConnected()) return Failed({kNotConnected});
  if (!is_motion_open_) return std::nullopt;
  const auto standing = WaitUntilStill();
  if (!standing) return standing.error();
  is_motion_open_ = false;
  return std::nullopt;
}

Result<CircleReading, StationFault> GeocomTotalStation::WaitUntilStill() {
  const SteadyTime until = clock_.Steady() + config_.motion_timeout;
  std::optional<CircleReading> before;
  while (clock_.Steady() < until) {
    const auto answer = Ask({geocom::kGetAngles, "1", 2, config_.answer_timeout, false});
    if (!answer && answer.error().why != kBusy) return Failure{answer.error()};
    std::optional<CircleReading> now;
    if (answer && PartsOfGeocomCode(answer->return_code)) now = CirclesFrom(answer->values);
    if (now && before && AreNear(*now, *before, kStillWithinRad)) return *now;
    before = now;
    sleeper_.SleepUntil(clock_.Steady() + kStillPause);
  }
  return Failure{Failed({kBusy})};
}

GeocomTotalStation::Answer GeocomTotalStation::Ask(const GeocomCall& call) {
  const SteadyTime busy_until = clock_.Steady() + config_.answer_timeout;
  int timeouts = 0;
  for (int attempt = 1;; ++attempt) {
    auto answer = Once(call);
    const bool is_busy_code =
        answer && FailureOfGeocomCode(answer->return_code) == std::optional(kBusy);
    if (answer && !is_busy_code) return answer;
    const StationFailure why = is_busy_code ? kBusy : answer.error().why;
    if (!client_.IsOpen()) return answer;
    if (why == kBusy && clock_.Steady() < busy_until) {
      sleeper_.SleepUntil(clock_.Steady() + kBusyPause);
      continue;
    }
    const bool may_pass = why == kGarbled || (why == kTimeout && ++timeouts < kMostTimeouts);
    if (!may_pass || attempt >= kMostAttempts) return answer;
  }
}

GeocomTotalStation::Answer GeocomTotalStation::Plain(int rpc,
                                                     std::string parameters,
                                                     std::size_t values) {
  auto answer = Ask({rpc, std::move(parameters), values, config_.answer_timeout, false});
  if (answer && FailureOfGeocomCode(answer->return_code)) {
    return Failure{Failed(FaultOfCode(answer->return_code))};
  }
  return answer;
}

Result<Done, StationFault> GeocomTotalStation::PlainDone(int rpc, std::string parameters) {
  const auto answer = Plain(rpc, std::move(parameters), 0);
  if (!answer) return Failure{answer.error()};
  return Done{};
}

Result<Done, StationFault> GeocomTotalStation::EitherDone(int newer,
                                                          int older,
                                                          const std::string& parameters) {
  const auto done = PlainDone(newer, parameters);
  if (done || done.error().why != kNotSupported) return done;
  return PlainDone(older, parameters);
}

}  // namespace tbm
