#include "devices/total_station/geocom_client.h"

#include <algorithm>
#include <array>

#include "devices/total_station/geocom_codes.h"

namespace tbm {
namespace {

using std::chrono::milliseconds;

// How soon RequestAbort is noticed, and how long a stopped motion may take to say so.
constexpr milliseconds kAbortSlice(100);
constexpr milliseconds kAbortLimit(5000);
constexpr std::array<std::uint8_t, 1> kAbortByte = {'c'};

std::span<const std::uint8_t> BytesOf(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

// Which codes come with values: 0, and the warnings of measuring calls.
bool CarriesValues(int return_code) { return PartsOfGeocomCode(return_code).has_value(); }

}  // namespace

GeocomClient::GeocomClient(std::unique_ptr<ByteLink> link,
                           int first_transaction,
                           const Clock& clock)
    : link_(std::move(link)),
      clock_(clock),
      transaction_(std::clamp(first_transaction, 1, kLastTransaction)) {}

std::optional<LinkFailure> GeocomClient::Open() {
  checksum_ = LineChecksum::kNone;
  last_reply_had_checksum_ = false;
  timeouts_in_a_row_ = 0;
  cutter_.Reset();
  return link_->Open();
}

void GeocomClient::Close() { link_->Close(); }

Result<GeocomAnswer, StationFault> GeocomClient::Call(const GeocomCall& call) {
  if (!link_->IsOpen()) return Failure{StationFault{StationFailure::kNotConnected}};
  if (const auto fault = Send(call)) return Failure{*fault};
  return Await(call, clock_.Steady());
}

std::optional<StationFault> GeocomClient::Send(const GeocomCall& call) {
  // A request to stop that nobody could obey belongs to the motion before.
  abort_requested_ = false;
  has_sent_abort_ = false;
  transaction_ = NextTransaction(transaction_);
  if (link_->Discard() > 0) ++counters_.noise;
  cutter_.Reset();
  ++counters_.calls;
  const std::string request = EncodeGeocomRequest(
      call.rpc, transaction_, call.parameters, checksum_ != LineChecksum::kNone);
  if (!link_->Write(BytesOf(request))) return std::nullopt;
  link_->Close();
  return StationFault{StationFailure::kLinkLost};
}

Result<GeocomAnswer, StationFault> GeocomClient::Await(const GeocomCall& call,
                                                       ByteLink::SteadyTime sent) {
  ByteLink::SteadyTime deadline = sent + call.limit;
  std::array<std::uint8_t, 512> bytes{};
  while (true) {
    if (call.can_abort) AbortIfAsked(&deadline);
    const auto until =
        call.can_abort ? std::min(deadline, clock_.Steady() + kAbortSlice) : deadline;
    const auto count = link_->Read(bytes, until);
    if (!count && count.error() != LinkFailure::kTimeout) {
      link_->Close();
      return Failure{StationFault{StationFailure::kLinkLost}};
    }
    for (std::size_t i = 0; count && i < *count; ++i) {
      const auto line = cutter_.Push(static_cast<char>(bytes[i]));
      if (!line) continue;
      auto judged = Judge(call, *line);
      if (!judged) continue;
      if (!*judged) return *judged;
      GeocomAnswer answer = std::move(*judged).value();
      answer.sent = sent;
      answer.received = clock_.Steady();
      return answer;
    }
    if (clock_.Steady() >= deadline) return OnTimeout();
  }
}

std::optional<Result<GeocomAnswer, StationFault>> GeocomClient::Judge(const GeocomCall& call,
                                                                      std::string_view line) {
  using Verdict = Result<GeocomAnswer, StationFault>;
  const auto reply = ParseGeocomReply(line, checksum_ == LineChecksum::kRequired);
  if (!reply && reply.error() == GeocomLineFault::kNotForUs) {
    ++counters_.noise;
    return std::nullopt;
  }
  if (!reply) {
    // Ours or a late one: nobody can tell. If ours comes after it, its number makes it stale.
    ++counters_.garbled;
    return Verdict(Failure{StationFault{StationFailure::kGarbled}});
  }
  // The transport's own refusals come without a number when it could not read ours.
  const bool is_refusal = reply->com_code != geocom::kOk && reply->transaction == 0;
  if (reply->transaction != transaction_ && !is_refusal) {
    ++counters_.stale;
    return std::nullopt;
  }
  timeouts_in_a_row_ = 0;
  last_reply_had_checksum_ = reply->has_checksum;
  if (const auto failure = FailureOfGeocomCode(reply->com_code)) {
    return Verdict(Failure{StationFault{*failure, reply->com_code}});
  }
  const bool has_values = CarriesValues(reply->return_code);
  if (has_values && reply->parameters.size() != call.values) {
    ++counters_.garbled;
    return Verdict(Failure{StationFault{StationFailure::kGarbled}});
  }
  ++counters_.answered;
  GeocomAnswer answer;
  answer.return_code = reply->return_code;
  if (has_values) answer.values.assign(reply->parameters.begin(), reply->parameters.end());
  return Verdict(std::move(answer));
}

Result<GeocomAnswer, StationFault> GeocomClient::OnTimeout() {
  ++counters_.timeouts;
  if (++timeouts_in_a_row_ >= kTimeoutsUntilClosed) link_->Close();
  return Failure{StationFault{StationFailure::kTimeout}};
}

void GeocomClient::AbortIfAsked(ByteLink::SteadyTime* deadline) {
  if (!abort_requested_ || has_sent_abort_) return;
  has_sent_abort_ = true;
  // When this write fails the next read says so.
  (void)link_->Write(kAbortByte);
  *deadline = std::min(*deadline, clock_.Steady() + kAbortLimit);
}

}  // namespace tbm
