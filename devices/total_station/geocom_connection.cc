// How GeocomTotalStation opens, wakes and sets up its instrument, and keeps its health.

#include <algorithm>

#include <fmt/format.h>

#include "devices/total_station/geocom_codes.h"
#include "devices/total_station/geocom_total_station.h"

namespace tbm {
namespace {

using enum StationFailure;

StationFailure FailureOfLink(LinkFailure failure) {
  switch (failure) {
    case LinkFailure::kMissing:
    case LinkFailure::kTimeout:
      return kUnreachable;
    case LinkFailure::kDenied:
    case LinkFailure::kBusy:
    case LinkFailure::kBadSettings:
      return kRefused;
    case LinkFailure::kHungUp:
      return kLinkLost;
  }
  return kLinkLost;
}

// Codes by which an instrument says that it does not understand a line with a checksum.
bool SaysNoChecksum(const StationFault& fault) {
  return fault.return_code == geocom::kNoChecksumHere || fault.why == kNotSupported ||
         (fault.why == kGarbled && fault.return_code != 0);
}

}  // namespace

GeocomTotalStation::GeocomTotalStation(TotalStationConfig config,
                                       std::unique_ptr<ByteLink> link,
                                       int first_transaction,
                                       const Clock& clock,
                                       Sleeper& sleeper)
    : config_(std::move(config)),
      clock_(clock),
      sleeper_(sleeper),
      client_(std::move(link), first_transaction, clock),
      life_(config_.first_back_off, config_.longest_back_off) {}

Result<StationIdentity, StationFault> GeocomTotalStation::Connect(SteadyTime until) {
  if (IsConnected()) return *Health().identity;
  if (life_.MayOpenAt() > clock_.Steady()) {
    sleeper_.SleepUntil(std::min(life_.MayOpenAt(), until));
    if (life_.MayOpenAt() > clock_.Steady()) return Failure{StationFault{kNotConnected}};
  }
  life_.Opening();
  {
    const std::lock_guard lock(mutex_);
    health_.state = life_.state();
  }
  const auto fault = OpenAndSetUp();
  const std::lock_guard lock(mutex_);
  if (fault) {
    client_.Close();
    life_.OpeningFailed(clock_.Steady());
    health_.last_fault = *fault;
  } else {
    is_set_up_ = true;
    if (life_.Ready()) ++health_.counters.reconnects;
    health_.last_fault.reset();
  }
  health_.state = life_.state();
  if (fault) return Failure{*fault};
  return *health_.identity;
}

std::optional<StationFault> GeocomTotalStation::OpenAndSetUp() {
  is_set_up_ = false;
  if (const auto failure = client_.Open()) return StationFault{FailureOfLink(*failure)};
  if (const auto fault = AgreeOnChecksum()) {
    if (fault->why != kAsleep) return fault;
    if (const auto still_asleep = Wake()) return still_asleep;
    if (const auto second = AgreeOnChecksum()) return second;
  }
  const auto identity = Identify();
  if (!identity) return identity.error();
  {
    const std::lock_guard lock(mutex_);
    health_.identity = *identity;
    health_.has_checksum = client_.checksum() == LineChecksum::kRequired;
  }
  RestoreSettings();
  if (!client_.IsOpen()) return StationFault{kLinkLost};
  return std::nullopt;
}

std::optional<StationFault> GeocomTotalStation::Wake() {
  const auto answer = Once({geocom::kSwitchOn, "1", 0, config_.motion_timeout, false});
  // An instrument that was awake meanwhile refuses to be switched on: that is good enough.
  if (!answer && answer.error().why != kAsleep && !client_.IsOpen()) return answer.error();
  return std::nullopt;
}

// A lost probe must not leave the line without a checksum for as long as it stays open. So silence
// counts as "cannot" only when the same question without one is answered, and with one again not.
std::optional<StationFault> GeocomTotalStation::AgreeOnChecksum() {
  client_.UseChecksum(LineChecksum::kNone);
  if (config_.checksum == ChecksumUse::kOff) return Probe(LineChecksum::kNone);
  bool was_silent = false;
  bool can = false;
  bool cannot = false;
  for (int attempt = 0; attempt < 3 && !can && !cannot; ++attempt) {
    const auto fault = Probe(LineChecksum::kOffered);
    if (!fault) {
      (client_.last_reply_had_checksum() ? can : cannot) = true;
    } else if (SaysNoChecksum(*fault)) {
      cannot = true;
    } else if (fault->why == kTimeout) {
      if (was_silent) cannot = true;
      was_silent = true;
      if (const auto deaf = Probe(LineChecksum::kNone)) return deaf;
    } else if (fault->why != kGarbled) {
      return fault;
    }
  }
  if (can) {
    client_.UseChecksum(LineChecksum::kRequired);
    return std::nullopt;
  }
  if (!cannot) return StationFault{kGarbled};
  if (config_.checksum == ChecksumUse::kOn) return StationFault{kNotSupported};
  return Probe(LineChecksum::kNone);
}

std::optional<StationFault> GeocomTotalStation::Probe(LineChecksum checksum) {
  client_.UseChecksum(checksum);
  const auto answer = Once({geocom::kNullProc, "", 0, config_.answer_timeout, false});
  if (!answer) return answer.error();
  if (const auto failure = FailureOfGeocomCode(answer->return_code)) {
    return StationFault{*failure, answer->return_code};
  }
  return std::nullopt;
}

Result<StationIdentity, StationFault> GeocomTotalStation::Identify() {
  StationIdentity identity;
  const auto number = Plain(geocom::kGetSerialNumber, "", 1);
  if (!number) return Failure{number.error()};
  const auto serial = GeocomInteger(number->values[0]);
  const auto model = Plain(geocom::kGetModel, "", 1);
  if (!model) return Failure{model.error()};
  const auto name = GeocomText(model->values[0]);
  const auto firmware = Plain(geocom::kGetFirmware, "", 3);
  if (!firmware) return Failure{firmware.error()};
  if (!serial || !name) return Failure{StationFault{kImplausible}};
  identity.serial_number = *serial;
  identity.model = *name;
  identity.firmware =
      fmt::format("{}.{}.{}", firmware->values[0], firmware->values[1], firmware->values[2]);
  return identity;
}

// None of these decides whether the connection is good: what an instrument cannot do shows in the
// call that needs it, and what is applied to a distance is read back.
void GeocomTotalStation::RestoreSettings() {
  (void)PlainDone(geocom::kSetDoublePrecision, "15");
  (void)PlainDone(geocom::kSetInclineSwitch, "1");
  (void)EitherDone(geocom::kSetAtr, geocom::kSetAtrOld, "1");
  prism_constant_m_.reset();
  ppm_.reset();
  if (wanted_prism_constant_m_) {
    (void)SetPrismConstant(*wanted_prism_constant_m_);
  } else if (const auto constant_m = ReadOneReal(geocom::kGetPrismConstant)) {
    prism_constant_m_ = *constant_m;
  }
  if (wanted_ppm_) {
    (void)SetAtmosphere(*wanted_ppm_);
  } else if (const auto ppm = ReadOneReal(geocom::kGetAtmospherePpm)) {
    ppm_ = *ppm;
  }
}

void GeocomTotalStation::Close() {
  client_.Close();
  is_set_up_ = false;
  life_.Lost(clock_.Steady());
  const std::lock_guard lock(mutex_);
  health_.state = life_.state();
}

GeocomTotalStation::Answer GeocomTotalStation::Once(const GeocomCall& call) {
  auto answer = client_.Call(call);
  const auto now = clock_.Steady();
  if (answer || answer.error().return_code != 0) {
    life_.Answered();
  } else if (answer.error().why == kTimeout) {
    life_.NotAnswered();
  }
  if (!client_.IsOpen() && life_.state() != StationState::kClosed &&
      life_.state() != StationState::kOpening) {
    life_.Lost(now);
  }
  const std::lock_guard lock(mutex_);
  const std::uint64_t reconnects = health_.counters.reconnects;
  health_.counters = client_.counters();
  health_.counters.reconnects = reconnects;
  health_.state = life_.state();
  if (answer) {
    health_.last_answer_at = clock_.Now();
    health_.last_fault.reset();
  } else {
    health_.last_fault = answer.error();
  }
  return answer;
}

StationFault GeocomTotalStation::Failed(StationFault fault) {
  const std::lock_guard lock(mutex_);
  health_.last_fault = fault;
  return fault;
}

StationHealth GeocomTotalStation::Health() const {
  const std::lock_guard lock(mutex_);
  return health_;
}

}  // namespace tbm
