#pragma once

#include <optional>

#include "guidance/station/polar.h"
#include "pose/base/face.h"

namespace tbm {

// The air between instrument and prism.
struct Air {
  double temperature_celsius = 12.0;
  double pressure_hpa = 1013.25;
  double humidity_percent = 60.0;
};

// Refractivity of air for light pulses, in parts per million: (n_group - 1) 1e6, for a carrier of
// `wavelength_um`, after the closed formulas of IAG resolution 3 of 1999 (Barrell and Sears'
// dispersion, 0.5 ppm for 0.65..0.85 um and -30..45 degrees celsius) with Magnus' formula for the
// water vapour.
double GroupRefractivity_ppm(const Air& air, double wavelength_um);

// What a distance meter's own scale assumes. Leica's instruments of the TPS1200 to TS60 families
// measure at 658 nm and show the true distance at 286.34 ppm, that is at 12 degrees celsius,
// 1013.25 hPa and 60 % (instrument's manual, "atmospheric correction").
struct DistanceMeter {
  double wavelength_um = 0.658;
  double reference_ppm = 286.34;
};

// What to add to a displayed distance, in parts per million of it.
double AirCorrection_ppm(const Air& air, const DistanceMeter& meter);

// One pointing as the instrument displayed it.
struct RawReading {
  double circle_rad = 0.0;
  double zenith_rad = 0.0;        // face two: beyond pi
  std::optional<double> slope_m;  // displayed
  Face face = Face::kOne;
};

// Errors of the instrument's axes: they change sign with the face and vanish in the mean of both.
struct AxisErrors {
  double collimation_rad = 0.0;  // of the line of sight: circle_1 = true + c / sin(zenith)
  double index_rad = 0.0;        // of the vertical circle: zenith_1 = true + i
};

struct Reduction {
  AxisErrors axis_errors;           // still in the readings
  double prism_constant_m = 0.0;    // to be added; 0 when the instrument has added it
  double air_correction_ppm = 0.0;  // to be added; 0 when the instrument has added it
};

// A reading of either face in terms of the first, corrected.
PolarReading Reduced(const RawReading& raw, const Reduction& reduction);

// Why two readings are not the two faces of one pointing.
enum class FacesFailure {
  kSameFace,
  kNotOnePoint,  // they differ by more than ten times `largest_axis_error_rad`: two targets
};

struct TwoFaces {
  PolarReading mean;       // free of axis errors
  AxisErrors axis_errors;  // as these two readings show them
};

// The mean of both faces and the axis errors that they show. The distance is the mean of what is
// there. `reduction.axis_errors` is not used.
Result<TwoFaces, FacesFailure> MeanOfFaces(const RawReading& a,
                                           const RawReading& b,
                                           const Reduction& reduction,
                                           double largest_axis_error_rad);

}  // namespace tbm
