#include "devices/total_station/geocom_emulator.h"

#include <algorithm>

#include <fmt/format.h>

#include "devices/sim/hash_noise.h"
#include "devices/total_station/geocom_codes.h"

namespace tbm {
namespace {

constexpr int kWrongFormatCode = 3078;
constexpr int kWrongChecksumCode = 3101;
constexpr std::string_view kWakeUpLines = "%N1,0,255,,0%T0,0,0,:%R1P,0,0:0,1\r\n";

std::vector<std::uint8_t> ToBytes(std::string_view text) { return {text.begin(), text.end()}; }

std::string WithoutEnd(std::string line) {
  while (line.ends_with('\r') || line.ends_with('\n')) line.pop_back();
  return line;
}

}  // namespace

GeocomEmulator::GeocomEmulator(GeocomEmulatorOptions options,
                               EmulatedInstrument instrument,
                               const Clock& clock)
    : clock_(clock), options_(std::move(options)), instrument_(std::move(instrument)) {}

void GeocomEmulator::FallAsleep() {
  const std::lock_guard lock(mutex_);
  is_asleep_ = true;
}

int GeocomEmulator::carried_out(int rpc) const {
  const std::lock_guard lock(mutex_);
  const auto found = carried_out_.find(rpc);
  return found == carried_out_.end() ? 0 : found->second;
}

int GeocomEmulator::requests() const {
  const std::lock_guard lock(mutex_);
  return requests_;
}

Timestamp GeocomEmulator::CivilAt(SteadyTime when) const {
  return clock_.Now() + (when - clock_.Steady());
}

void GeocomEmulator::OnPlug() {
  const std::lock_guard lock(mutex_);
  cutter_.Reset();
}

void GeocomEmulator::OnBytes(std::span<const std::uint8_t> bytes,
                             SteadyTime now,
                             PtyOutbox& outbox) {
  const std::lock_guard lock(mutex_);
  for (const std::uint8_t byte : bytes) {
    if (byte == 'c' && cutter_.bytes_held() == 0 && pending_ && pending_->is_motion) {
      Abort(now);
      SayNow("?\r\n", now, outbox);
      continue;
    }
    if (const auto line = cutter_.Push(static_cast<char>(byte))) OnLine(*line, now, outbox);
  }
}

std::optional<PtyInstrument::SteadyTime> GeocomEmulator::OnTurn(SteadyTime now, PtyOutbox& outbox) {
  const std::lock_guard lock(mutex_);
  if (pending_ && pending_->due <= now) {
    Say(*pending_, outbox);
    pending_.reset();
  }
  if (!pending_) return std::nullopt;
  return pending_->due;
}

void GeocomEmulator::OnLine(std::string_view line, SteadyTime now, PtyOutbox& outbox) {
  if (is_asleep_) {
    is_asleep_ = false;
    SayNow(std::string(kWakeUpLines), now, outbox);
    return;
  }
  const auto request = ParseGeocomRequest(line);
  if (request) {
    ++requests_;
    OnRequest(*request, now, outbox);
  } else if (request.error() == GeocomLineFault::kBadChecksum) {
    SayNow(EncodeGeocomReply(kWrongChecksumCode, 0, "0", false), now, outbox);
  } else if (request.error() == GeocomLineFault::kBadForm) {
    SayNow(EncodeGeocomReply(kWrongFormatCode, 0, "0", false), now, outbox);
  }
}

void GeocomEmulator::OnRequest(const GeocomRequest& request, SteadyTime now, PtyOutbox& outbox) {
  const auto refuse = [&](int com_code) {
    const bool with_checksum =
        request.has_checksum && options_.checksum == EmulatedChecksum::kKnown;
    SayNow(EncodeGeocomReply(com_code, request.transaction, "0", with_checksum), now, outbox);
  };
  if (request.has_checksum && options_.checksum == EmulatedChecksum::kMute) return;
  if (request.has_checksum && options_.checksum == EmulatedChecksum::kRefused) {
    return refuse(geocom::kNoChecksumHere);
  }
  if (pending_) return refuse(geocom::kLostAsync);
  const std::optional<GeocomFault> fault = faults_.Take(request.rpc);
  const auto is = [&](GeocomFaultKind kind) { return fault && fault->kind == kind; };
  if (is(GeocomFaultKind::kLostRequest)) return;
  if (is(GeocomFaultKind::kComCode)) return refuse(fault->code);
  if (is(GeocomFaultKind::kWrongPrism)) instrument_.takes_wrong_prism = true;

  Pending pending;
  pending.begun = now;
  pending.from = instrument_.telescope();
  pending.fault = fault;
  pending.transaction = request.transaction;
  pending.with_checksum = request.has_checksum && options_.checksum == EmulatedChecksum::kKnown;
  Outcome result;
  if (is(GeocomFaultKind::kReturnCode) && !PartsOfGeocomCode(fault->code)) {
    result.return_code = fault->code;
  } else {
    const auto carried_out = CarryOut(request, now);
    if (!carried_out) return refuse(geocom::kUnknownProcedure);
    ++carried_out_[request.rpc];
    result = *carried_out;
    if (is(GeocomFaultKind::kReturnCode)) result.return_code = fault->code;
  }
  if (is(GeocomFaultKind::kMissingValues)) {
    result.return_code = geocom::kOk;
    result.values.clear();
  }
  pending.is_motion = result.is_motion;
  pending.due = now + options_.think_time + result.takes;
  const std::string fields = result.values.empty()
                                 ? fmt::format("{}", result.return_code)
                                 : fmt::format("{},{}", result.return_code, result.values);
  pending.reply =
      EncodeGeocomReply(geocom::kOk, request.transaction, fields, pending.with_checksum);
  pending_ = std::move(pending);
}

// The telescope stops on its way, wherever it is by then.
void GeocomEmulator::Abort(SteadyTime now) {
  const CircleReading to = instrument_.telescope();
  const double whole_s = std::chrono::duration<double>(pending_->due - pending_->begun).count();
  const double part =
      std::clamp(std::chrono::duration<double>(now - pending_->begun).count() / whole_s, 0.0, 1.0);
  const auto between = [part](double a, double b) { return a + part * (b - a); };
  instrument_.Unlock();
  instrument_.PointTo({between(pending_->from.horizontal_rad, to.horizontal_rad),
                       between(pending_->from.zenith_rad, to.zenith_rad)});
  pending_->due = now + options_.think_time;
  pending_->is_motion = false;
  pending_->reply = EncodeGeocomReply(geocom::kOk,
                                      pending_->transaction,
                                      fmt::format("{}", geocom::kAborted),
                                      pending_->with_checksum);
}

void GeocomEmulator::SayNow(const std::string& reply, SteadyTime now, PtyOutbox& outbox) {
  outbox.At(now + options_.think_time, ToBytes(reply));
}

void GeocomEmulator::Say(const Pending& pending, PtyOutbox& outbox) {
  std::string reply = pending.reply;
  const std::string before = std::exchange(last_reply_, reply);
  auto due = pending.due;
  if (!pending.fault) return outbox.At(due, ToBytes(reply));
  switch (pending.fault->kind) {
    case GeocomFaultKind::kLostReply:
      return;
    case GeocomFaultKind::kCloses:
      return outbox.HangUp();
    case GeocomFaultKind::kLate:
      due += pending.fault->delay;
      break;
    case GeocomFaultKind::kGarbageBefore:
      reply = "\x7f\xff%R1Q~,%R1" + reply;
      break;
    case GeocomFaultKind::kBitError:
      reply = BitFlipped(std::move(reply));
      break;
    case GeocomFaultKind::kLostFirst:
      reply.erase(0, 1);
      break;
    case GeocomFaultKind::kSplit: {
      const std::size_t half = reply.size() / 2;
      outbox.At(due + pending.fault->delay, ToBytes(reply.substr(half)));
      reply.resize(half);
      break;
    }
    case GeocomFaultKind::kGlued:
      reply = WithoutEnd(before) + reply;
      break;
    case GeocomFaultKind::kTwice:
      reply += reply;
      break;
    case GeocomFaultKind::kLostRequest:
    case GeocomFaultKind::kMissingValues:
    case GeocomFaultKind::kReturnCode:
    case GeocomFaultKind::kComCode:
    case GeocomFaultKind::kWrongPrism:
      break;
  }
  outbox.At(due, ToBytes(reply));
}

// Another place each time, anywhere but in the end of the line.
std::string GeocomEmulator::BitFlipped(std::string reply) {
  const std::size_t body = WithoutEnd(reply).size();
  const auto at = static_cast<std::size_t>(sim::Mixed(++bit_errors_) % (8 * body));
  reply[at / 8] = static_cast<char>(reply[at / 8] ^ (1 << (at % 8)));
  return reply;
}

}  // namespace tbm
