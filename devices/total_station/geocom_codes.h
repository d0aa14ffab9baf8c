#pragma once

#include <optional>
#include <string_view>

#include "devices/total_station/total_station.h"

namespace tbm {

// Numbers of the remote procedures used here (GeoCOM reference manuals of the TPS1100, TPS1200 and
// TS30). Where two are named, the first is of the newer instruments.
namespace geocom {
inline constexpr int kNullProc = 0;
inline constexpr int kSetDoublePrecision = 107;
inline constexpr int kSwitchOn = 111;
inline constexpr int kGetAngleAndTilt = 2003;  // inclMode -> Hz,V,sigma,t,cross,length,sigma,t,face
inline constexpr int kSetInclineSwitch = 2006;
inline constexpr int kDoMeasure = 2008;  // command, inclMode
inline constexpr int kGetPrismConstant = 2023;
inline constexpr int kSetPrismConstant = 2024;
inline constexpr int kGetAngles = 2107;         // inclMode -> Hz,V
inline constexpr int kGetSimpleMeasure = 2108;  // wait ms, inclMode -> Hz,V,slope
inline constexpr int kSetAtmospherePpm = 2148;
inline constexpr int kGetAtmospherePpm = 2151;
inline constexpr int kGetFullMeasure = 2167;  // wait, mode -> Hz,V,sigma,cross,len,sigma,slope,t
inline constexpr int kGetSerialNumber = 5003;
inline constexpr int kGetModel = 5004;
inline constexpr int kGetTemperature = 5011;
inline constexpr int kGetFirmware = 5034;
inline constexpr int kCheckPower = 5039;      // -> percent, source, suggested
inline constexpr int kReadLockStatus = 6021;  // 0 none, 1 locked, 2 predicting
inline constexpr int kLockIn = 9013;
inline constexpr int kSetAtrOld = 9018;
inline constexpr int kSetLockOld = 9020;
inline constexpr int kMakePositioning = 9027;  // Hz,V,posMode,atrMode,0
inline constexpr int kChangeFace = 9028;       // posMode,atrMode,0
inline constexpr int kSearch = 9029;           // hzArea,vArea,0
inline constexpr int kFineAdjust = 9037;       // hzArea,vArea,0
inline constexpr int kSetAtr = 18005;
inline constexpr int kSetLock = 18007;

// Commands of kDoMeasure.
inline constexpr int kMeasureDefault = 1;
inline constexpr int kMeasureClear = 3;  // stops and forgets the last distance

// Return codes that this software treats each in its own way.
inline constexpr int kOk = 0;
inline constexpr int kAborted = 8;
inline constexpr int kNoFullCorrection = 1283;
inline constexpr int kNoAccuracyGuarantee = 1284;
inline constexpr int kAnglesOnly = 1285;
inline constexpr int kAnglesNoFullCorrection = 1288;
inline constexpr int kAnglesNoAccuracyGuarantee = 1289;
inline constexpr int kUnknownProcedure = 3081;
inline constexpr int kLostAsync = 3107;
inline constexpr int kSleeping = 3108;
inline constexpr int kSwitchedOff = 3109;
inline constexpr int kNoChecksumHere = 3110;
}  // namespace geocom

// What a return code or a transport code means here. Empty for 0 and for the warnings whose values
// are good (1283, 1284, 1285, 1288, 1289). Codes that no manual names are kInstrument.
std::optional<StationFailure> FailureOfGeocomCode(int code);

// The manual's name of a code, "TMC_ANGLE_OK" and so on; empty for codes not in the table.
std::string_view GeocomCodeName(int code);

// What a code of a measuring call says about its values. Empty: there are none to be used.
struct MeasuredParts {
  ObservationQuality quality = ObservationQuality::kFull;
  bool has_distance = true;  // false: the field is there and its content is void
};
std::optional<MeasuredParts> PartsOfGeocomCode(int code);

}  // namespace tbm
