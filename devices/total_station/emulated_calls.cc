// What the emulated instrument does when a procedure is called. Parameters are checked as real ones
// do: a call with one too many or too few is refused.

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "devices/total_station/geocom_codes.h"
#include "devices/total_station/geocom_emulator.h"

namespace tbm {
namespace {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;

constexpr int kBadParameterCode = 2;
constexpr int kNoLicenceCode = 27;
constexpr int kNotEnabledCode = 8714;
constexpr int kInternalBattery = 2;

struct CallShape {
  int rpc;
  std::size_t parameters;
  bool is_new = false;      // not before the TPS1200
  bool is_robotic = false;  // needs a licence
};

constexpr CallShape kShapes[] = {
    {geocom::kNullProc, 0},
    {geocom::kSetDoublePrecision, 1},
    {geocom::kSwitchOn, 1},
    {geocom::kGetAngleAndTilt, 1},
    {geocom::kSetInclineSwitch, 1},
    {geocom::kDoMeasure, 2},
    {geocom::kGetPrismConstant, 0},
    {geocom::kSetPrismConstant, 1},
    {geocom::kGetAngles, 1},
    {geocom::kGetSimpleMeasure, 2},
    {geocom::kSetAtmospherePpm, 1, true},
    {geocom::kGetAtmospherePpm, 0, true},
    {geocom::kGetFullMeasure, 2, true},
    {geocom::kGetSerialNumber, 0},
    {geocom::kGetModel, 0},
    {geocom::kGetTemperature, 0},
    {geocom::kGetFirmware, 0},
    {geocom::kCheckPower, 0},
    {geocom::kReadLockStatus, 0, false, true},
    {geocom::kLockIn, 0, false, true},
    {geocom::kSetAtrOld, 1, false, true},
    {geocom::kSetLockOld, 1, false, true},
    {geocom::kMakePositioning, 5, false, true},
    {geocom::kChangeFace, 3, false, true},
    {geocom::kSearch, 3, false, true},
    {geocom::kFineAdjust, 3, false, true},
    {geocom::kSetAtr, 1, true, true},
    {geocom::kSetLock, 1, true, true},
};

nanoseconds Seconds(double seconds) {
  return nanoseconds(static_cast<std::int64_t>(seconds * 1e9));
}

}  // namespace

std::optional<GeocomEmulator::Outcome> GeocomEmulator::CarryOut(const GeocomRequest& request,
                                                                SteadyTime now) {
  const auto* const shape = std::ranges::find(kShapes, request.rpc, &CallShape::rpc);
  if (shape == std::end(kShapes) || (shape->is_new && options_.is_old)) return std::nullopt;
  if (shape->is_robotic && !options_.is_licensed) return Outcome{kNoLicenceCode, "", {}, false};
  std::vector<double> parameters;
  for (const std::string_view field : request.parameters) {
    const auto value = GeocomReal(field);
    if (!value) return Outcome{kBadParameterCode, "", {}, false};
    parameters.push_back(*value);
  }
  if (parameters.size() != shape->parameters) return Outcome{kBadParameterCode, "", {}, false};
  if (auto result = Settings(request.rpc, parameters)) return result;
  if (auto result = Motions(request.rpc, parameters, now)) return result;
  return Measurements(request.rpc, parameters, now);
}

std::optional<GeocomEmulator::Outcome> GeocomEmulator::Settings(int rpc,
                                                                const std::vector<double>& p) {
  const auto says = [](std::string values) { return Outcome{0, std::move(values), {}, false}; };
  switch (rpc) {
    case geocom::kNullProc:
    case geocom::kSetDoublePrecision:
    case geocom::kSwitchOn:
      return Outcome{};
    case geocom::kSetInclineSwitch:
      instrument_.compensator_is_on = p[0] != 0.0;
      return Outcome{};
    case geocom::kGetPrismConstant:
      return says(GeocomNumber(instrument_.prism_constant_m));
    case geocom::kSetPrismConstant:
      if (!options_.ignores_prism_constant) instrument_.prism_constant_m = p[0];
      return Outcome{};
    case geocom::kGetAtmospherePpm:
      return says(GeocomNumber(instrument_.ppm));
    case geocom::kSetAtmospherePpm:
      instrument_.ppm = p[0];
      return Outcome{};
    case geocom::kGetSerialNumber:
      return says(fmt::format("{}", options_.serial_number));
    case geocom::kGetModel:
      return says(fmt::format("\"{}\"", options_.model));
    case geocom::kGetFirmware:
      return says("5,60,1");
    case geocom::kGetTemperature:
      return says(fmt::format("{}", options_.temperature_celsius));
    case geocom::kCheckPower:
      return says(fmt::format("{},{},{}", options_.battery_percent, kInternalBattery, 0));
    case geocom::kSetAtr:
    case geocom::kSetAtrOld:
      has_recognition_ = p[0] != 0.0;
      return Outcome{};
    case geocom::kSetLock:
    case geocom::kSetLockOld:
      has_lock_ = p[0] != 0.0;
      if (!has_lock_) instrument_.Unlock();
      return Outcome{};
    default:
      return std::nullopt;
  }
}

std::optional<GeocomEmulator::Outcome> GeocomEmulator::Motions(int rpc,
                                                               const std::vector<double>& p,
                                                               SteadyTime now) {
  constexpr double kFieldRad = 2.0 * EmulatedInstrument::kRecognitionRad;
  switch (rpc) {
    case geocom::kMakePositioning:
      if (p[0] < 0.0 || p[0] > 7.0 || p[1] < 0.0 || p[1] > 7.0) {
        return Outcome{kBadParameterCode, "", {}, false};
      }
      return Turned({p[0], p[1]}, p[3] != 0.0, now);
    case geocom::kChangeFace: {
      const CircleReading before = instrument_.telescope();
      instrument_.PlungeTelescope();
      const CircleReading other_face = instrument_.telescope();
      instrument_.PointTo(before);
      return Turned(other_face, p[1] != 0.0, now);
    }
    case geocom::kSearch:
    case geocom::kFineAdjust:
      return Found(p[0], p[1], now);
    case geocom::kLockIn: {
      if (!has_lock_) return Outcome{kNotEnabledCode, "", {}, false};
      Outcome result = Found(kFieldRad, kFieldRad, now);
      if (result.return_code == geocom::kOk) instrument_.Lock();
      return result;
    }
    case geocom::kReadLockStatus:
      return Outcome{
          0, fmt::format("{}", static_cast<int>(instrument_.LockAt(CivilAt(now)))), {}, false};
    default:
      return std::nullopt;
  }
}

GeocomEmulator::Outcome GeocomEmulator::Turned(const CircleReading& to,
                                               bool finds_prism,
                                               SteadyTime now) {
  MeasureUntil(now);
  distance_ready_.reset();
  const CircleReading from = instrument_.telescope();
  const double turn_rad = std::max(
      std::abs(std::remainder(to.horizontal_rad - from.horizontal_rad, 2.0 * std::numbers::pi)),
      std::abs(to.zenith_rad - from.zenith_rad));
  const nanoseconds takes = Seconds(turn_rad / options_.turn_rad_per_s);
  instrument_.Unlock();
  instrument_.PointTo(to);
  if (!finds_prism) return {geocom::kOk, "", takes, true};
  constexpr double kFieldRad = 2.0 * EmulatedInstrument::kRecognitionRad;
  Outcome found = Found(kFieldRad, kFieldRad, now + takes);
  found.takes += takes;
  return found;
}

GeocomEmulator::Outcome GeocomEmulator::Found(double horizontal_window_rad,
                                              double zenith_window_rad,
                                              SteadyTime now) {
  MeasureUntil(now);
  distance_ready_.reset();
  if (!has_recognition_) return {kNotEnabledCode, "", {}, false};
  const int code = instrument_.FindPrism(
      horizontal_window_rad, zenith_window_rad, CivilAt(now + options_.recognition_time));
  return {code, "", options_.recognition_time, true};
}

// A distance meter that is ready by now has looked where the telescope pointed when it was.
void GeocomEmulator::MeasureUntil(SteadyTime now) {
  if (!distance_ready_ || *distance_ready_ > now) return;
  slope_m_ = instrument_.ReadSlope(CivilAt(*distance_ready_));
  circles_ = instrument_.ReadCircles(CivilAt(*distance_ready_));
  distance_ready_.reset();
}

int GeocomEmulator::CodeOfAngles() const {
  return instrument_.compensator_is_on && instrument_.IsWithinCompensatorRange()
             ? geocom::kOk
             : geocom::kNoFullCorrection;
}

std::optional<GeocomEmulator::Outcome> GeocomEmulator::Measurements(int rpc,
                                                                    const std::vector<double>& p,
                                                                    SteadyTime now) {
  switch (rpc) {
    case geocom::kGetAngles:
    case geocom::kGetAngleAndTilt:
      return Angles(rpc, now);
    case geocom::kDoMeasure:
      MeasureUntil(now);
      distance_ready_.reset();
      if (p[0] == geocom::kMeasureDefault) {
        distance_ready_ = now + options_.think_time + options_.distance_time;
      }
      // Only clearing forgets; a new measurement replaces the old one when it is ready.
      if (p[0] == geocom::kMeasureClear) slope_m_.reset();
      return Outcome{};
    case geocom::kGetSimpleMeasure:
    case geocom::kGetFullMeasure:
      return Measured(rpc, Seconds(p[0] * 1e-3), now);
    default:
      return std::nullopt;
  }
}

GeocomEmulator::Outcome GeocomEmulator::Angles(int rpc, SteadyTime now) {
  const CircleReading circles = instrument_.ReadCircles(CivilAt(now));
  std::string values =
      GeocomNumber(circles.horizontal_rad) + "," + GeocomNumber(circles.zenith_rad);
  if (rpc == geocom::kGetAngleAndTilt) {
    const auto [length_rad, cross_rad] = instrument_.ReadLean(CivilAt(now));
    values += fmt::format(",{},0,{},{},0,0,{}",
                          GeocomNumber(instrument_.errors.angle_sigma_rad),
                          GeocomNumber(cross_rad),
                          GeocomNumber(length_rad),
                          FaceOf(circles) == Face::kTwo ? 1 : 0);
  }
  return {CodeOfAngles(), std::move(values), {}, false};
}

GeocomEmulator::Outcome GeocomEmulator::Measured(int rpc, nanoseconds wait, SteadyTime now) {
  MeasureUntil(now);
  nanoseconds takes{0};
  if (!slope_m_) {
    const bool comes = distance_ready_ && *distance_ready_ <= now + wait;
    takes = comes ? *distance_ready_ - now : wait;
    MeasureUntil(now + takes);
    if (!slope_m_) circles_ = instrument_.ReadCircles(CivilAt(now + takes));
  }
  int code = CodeOfAngles();
  if (!slope_m_) {
    code = code == geocom::kOk ? geocom::kAnglesOnly : geocom::kAnglesNoFullCorrection;
  }
  std::string values =
      GeocomNumber(circles_->horizontal_rad) + "," + GeocomNumber(circles_->zenith_rad);
  const std::string slope = GeocomNumber(slope_m_.value_or(0.0));
  if (rpc == geocom::kGetSimpleMeasure) return {code, values + "," + slope, takes, false};
  const auto [length_rad, cross_rad] = instrument_.ReadLean(CivilAt(now + takes));
  values += fmt::format(",{},{},{},0,{},0",
                        GeocomNumber(instrument_.errors.angle_sigma_rad),
                        GeocomNumber(cross_rad),
                        GeocomNumber(length_rad),
                        slope);
  return {code, std::move(values), takes, false};
}

}  // namespace tbm
