#include "guidance/station/reduce.h"

#include <cmath>
#include <numbers>

namespace tbm {
namespace {

constexpr double kZeroCelsius_kelvin = 273.15;

// Saturation pressure over water, Magnus' formula with the coefficients of the instruments'
// manuals: 6.11 hPa * 10^(7.5 t / (237.3 + t)).
double VapourPressure_hpa(const Air& air) {
  const double t = air.temperature_celsius;
  return 0.01 * air.humidity_percent * 6.11 * std::pow(10.0, 7.5 * t / (237.3 + t));
}

double Slope(double displayed_m, const Reduction& reduction) {
  return displayed_m * (1.0 + 1e-6 * reduction.air_correction_ppm) + reduction.prism_constant_m;
}

// The second face shows the circle half a turn further and counts the zenith from the other side.
PolarReading InFaceOne(const RawReading& raw) {
  PolarReading reading;
  const bool first = raw.face == Face::kOne;
  reading.circle_rad = Turn(first ? raw.circle_rad : raw.circle_rad - std::numbers::pi);
  reading.zenith_rad = first ? raw.zenith_rad : 2.0 * std::numbers::pi - raw.zenith_rad;
  reading.slope_m = raw.slope_m;
  return reading;
}

}  // namespace

double GroupRefractivity_ppm(const Air& air, double wavelength_um) {
  const double inverse2 = 1.0 / (wavelength_um * wavelength_um);
  const double standard_ppm = 287.6155 + (4.88660 + 0.06800 * inverse2) * inverse2;
  const double kelvin = kZeroCelsius_kelvin + air.temperature_celsius;
  return standard_ppm * (kZeroCelsius_kelvin / 1013.25) * air.pressure_hpa / kelvin -
         11.27 * VapourPressure_hpa(air) / kelvin;
}

double AirCorrection_ppm(const Air& air, const DistanceMeter& meter) {
  return meter.reference_ppm - GroupRefractivity_ppm(air, meter.wavelength_um);
}

PolarReading Reduced(const RawReading& raw, const Reduction& reduction) {
  PolarReading reading = InFaceOne(raw);
  const double sign = raw.face == Face::kOne ? 1.0 : -1.0;
  reading.zenith_rad -= sign * reduction.axis_errors.index_rad;
  reading.circle_rad = Turn(reading.circle_rad - sign * reduction.axis_errors.collimation_rad /
                                                     std::sin(reading.zenith_rad));
  if (reading.slope_m) reading.slope_m = Slope(*reading.slope_m, reduction);
  return reading;
}

Result<TwoFaces, FacesFailure> MeanOfFaces(const RawReading& a,
                                           const RawReading& b,
                                           const Reduction& reduction,
                                           double largest_axis_error_rad) {
  if (a.face == b.face) return Failure{FacesFailure::kSameFace};
  const PolarReading one = InFaceOne(a.face == Face::kOne ? a : b);
  const PolarReading two = InFaceOne(a.face == Face::kOne ? b : a);
  const double circle_half_rad = 0.5 * HalfTurn(one.circle_rad - two.circle_rad);
  const double index_rad = 0.5 * (one.zenith_rad - two.zenith_rad);
  const double zenith_rad = 0.5 * (one.zenith_rad + two.zenith_rad);
  const double collimation_rad = circle_half_rad * std::sin(zenith_rad);
  if (!(std::abs(collimation_rad) <= 10.0 * largest_axis_error_rad) ||
      !(std::abs(index_rad) <= 10.0 * largest_axis_error_rad)) {
    return Failure{FacesFailure::kNotOnePoint};
  }
  TwoFaces faces;
  faces.mean.circle_rad = Turn(one.circle_rad - circle_half_rad);
  faces.mean.zenith_rad = zenith_rad;
  if (one.slope_m && two.slope_m) {
    faces.mean.slope_m = Slope(0.5 * (*one.slope_m + *two.slope_m), reduction);
  } else if (one.slope_m || two.slope_m) {
    faces.mean.slope_m = Slope(one.slope_m ? *one.slope_m : *two.slope_m, reduction);
  }
  faces.axis_errors = {collimation_rad, index_rad};
  return faces;
}

}  // namespace tbm
