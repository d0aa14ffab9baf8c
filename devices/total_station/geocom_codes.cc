#include "devices/total_station/geocom_codes.h"

#include <algorithm>
#include <array>

namespace tbm {
namespace {

using enum StationFailure;

struct CodeRow {
  int code;
  std::string_view name;
  StationFailure failure;
};

// Names of the manuals. The first that matches counts; ranges below take the rest.
constexpr std::array kCodes = std::to_array<CodeRow>({
    {1, "UNDEFINED", kInstrument},
    {2, "IVPARAM", kBadParameter},
    {3, "IVRESULT", kInstrument},
    {4, "FATAL", kInstrument},
    {5, "NOT_IMPL", kNotSupported},
    {6, "TIME_OUT", kTimeout},
    {8, "ABORT", kAborted},
    {12, "SHUT_DOWN", kInstrument},
    {13, "SYSBUSY", kBusy},
    {16, "LOW_POWER", kLowPower},
    {18, "BATT_EMPTY", kLowPower},
    {22, "TILT", kTilted},
    {26, "NOT_OK", kInstrument},
    {27, "NA", kNoLicence},
    {257, "ANG_ERROR", kAngleSensor},
    {258, "ANG_INCL_ERROR", kTilted},
    {259, "ANG_BAD_ACC", kAngleSensor},
    {260, "ANG_BAD_ANGLE_ACC", kAngleSensor},
    {514, "ATA_SEVERAL_TARGETS", kSeveralTargets},
    {517, "ATA_NO_TARGET", kNoTarget},
    {524, "ATA_STRANGE_LIGHT", kBadEnvironment},
    {1290, "TMC_ANGLE_ERROR", kAngleSensor},
    {1291, "TMC_DIST_PPM", kDistance},
    {1292, "TMC_DIST_ERROR", kDistance},
    {1293, "TMC_BUSY", kBusy},
    {1294, "TMC_SIGNAL_ERROR", kDistance},
    {3077, "COM_TIMEDOUT", kTimeout},
    {3078, "COM_WRONG_FORMAT", kGarbled},
    {3081, "COM_PROC_UNAVAIL", kNotSupported},
    {3093, "COM_TR_ID_MISMATCH", kGarbled},
    {3100, "COM_OVERRUN", kGarbled},
    {3101, "COM_SRVR_RX_CHECKSUM_ERROR", kGarbled},
    {3102, "COM_CLNT_RX_CHECKSUM_ERROR", kGarbled},
    {3107, "COM_CONS_REQ", kBusy},
    {3108, "COM_SRVR_IS_SLEEPING", kAsleep},
    {3109, "COM_SRVR_IS_OFF", kAsleep},
    {3110, "COM_NO_CHECKSUM", kNotSupported},
    {8704, "AUT_TIMEOUT", kInaccurate},
    {8706, "AUT_ANGLE_ERROR", kAngleSensor},
    {8707, "AUT_MOTOR_ERROR", kMotor},
    {8708, "AUT_INCACC", kInaccurate},
    {8709, "AUT_DEV_ERROR", kInaccurate},
    {8710, "AUT_NO_TARGET", kNoTarget},
    {8711, "AUT_MULTIPLE_TARGETS", kSeveralTargets},
    {8712, "AUT_BAD_ENVIRONMENT", kBadEnvironment},
    {8713, "AUT_DETECTOR_ERROR", kBadEnvironment},
    {8714, "AUT_NOT_ENABLED", kNoLock},
    {8716, "AUT_ACCURACY", kInaccurate},
    {8725, "AUT_NO_LOCK", kNoLock},
    {9217, "BAP_CHANGE_ALL_TO_DIST", kDistance},
    // With their values, so without a failure.
    {1283, "TMC_NO_FULL_CORRECTION", kInstrument},
    {1284, "TMC_ACCURACY_GUARANTEE", kInstrument},
    {1285, "TMC_ANGLE_OK", kInstrument},
    {1288, "TMC_ANGLE_NO_FULL_CORRECTION", kInstrument},
    {1289, "TMC_ANGLE_NO_ACC_GUARANTY", kInstrument},
});

const CodeRow* Find(int code) {
  const auto* const found = std::ranges::find(kCodes, code, &CodeRow::code);
  return found == kCodes.end() ? nullptr : found;
}

}  // namespace

std::optional<MeasuredParts> PartsOfGeocomCode(int code) {
  using enum ObservationQuality;
  switch (code) {
    case geocom::kOk:
      return MeasuredParts{kFull, true};
    case geocom::kNoFullCorrection:
      return MeasuredParts{kNotFullyCorrected, true};
    case geocom::kNoAccuracyGuarantee:
      return MeasuredParts{kNoAccuracy, true};
    case geocom::kAnglesOnly:
      return MeasuredParts{kFull, false};
    case geocom::kAnglesNoFullCorrection:
      return MeasuredParts{kNotFullyCorrected, false};
    case geocom::kAnglesNoAccuracyGuarantee:
      return MeasuredParts{kNoAccuracy, false};
    default:
      return std::nullopt;
  }
}

std::optional<StationFailure> FailureOfGeocomCode(int code) {
  if (PartsOfGeocomCode(code)) return std::nullopt;
  if (const CodeRow* row = Find(code)) return row->failure;
  if (code >= 257 && code <= 511) return kAngleSensor;
  if (code >= 1792 && code <= 1810) return kMotor;
  if (code >= 3072 && code <= 3110) return kGarbled;
  if (code >= 8704 && code <= 8725) return kInaccurate;
  return kInstrument;
}

std::string_view GeocomCodeName(int code) {
  if (code == geocom::kOk) return "OK";
  const CodeRow* row = Find(code);
  return row == nullptr ? std::string_view() : row->name;
}

}  // namespace tbm
