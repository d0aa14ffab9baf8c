#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "devices/bus/byte_link.h"
#include "devices/total_station/geocom_protocol.h"
#include "devices/total_station/total_station.h"
#include "pose/base/clock.h"

namespace tbm {

// One remote procedure call.
struct GeocomCall {
  int rpc = 0;
  std::string parameters;  // joined by commas
  std::size_t values = 0;  // that the reply must carry when its return code allows for values
  Duration limit{0};       // from the last byte sent to the last byte received
  bool can_abort = false;  // RequestAbort stops it
};

struct GeocomAnswer {
  int return_code = 0;
  std::vector<std::string> values;  // as they stand; exactly as many as asked for, or none
  ByteLink::SteadyTime sent{};
  ByteLink::SteadyTime received{};
};

enum class LineChecksum {
  kNone,      // requests carry none; one in a reply must still be right
  kOffered,   // requests carry one, replies may
  kRequired,  // requests carry one, and a reply without is damaged
};

// Calls over one line, one at a time. An answer is taken only under its call's own transaction
// number, so a late one is never taken for the next. Numbers go on over reconnects.
//
// Nothing is ever sent twice from here: whoever calls knows what may be repeated.
class GeocomClient {
 public:
  // After so many calls without an answer in a row the line is closed.
  static constexpr int kTimeoutsUntilClosed = 3;

  // `first_transaction` should differ from run to run: on a serial line an answer to the process
  // before may still be on its way.
  GeocomClient(std::unique_ptr<ByteLink> link, int first_transaction, const Clock& clock);

  std::optional<LinkFailure> Open();
  void Close();
  bool IsOpen() const { return link_->IsOpen(); }

  // kNone after Open.
  void UseChecksum(LineChecksum use) { checksum_ = use; }
  LineChecksum checksum() const { return checksum_; }
  // Whether the last sound reply carried one.
  bool last_reply_had_checksum() const { return last_reply_had_checksum_; }

  // Failures: kNotConnected, kLinkLost, kTimeout and kGarbled without a code, after which nothing
  // is known about what the instrument did; and what a code of the transport means, with that code:
  // then the call was not carried out. A return code is the caller's to judge.
  Result<GeocomAnswer, StationFault> Call(const GeocomCall& call);

  // From any thread: the call under way, if it can, is stopped; otherwise nothing happens.
  void RequestAbort() { abort_requested_ = true; }

  const StationCounters& counters() const { return counters_; }

 private:
  std::optional<StationFault> Send(const GeocomCall& call);
  Result<GeocomAnswer, StationFault> Await(const GeocomCall& call, ByteLink::SteadyTime sent);
  // What a line says: an answer, a failure, or nothing that concerns this call.
  std::optional<Result<GeocomAnswer, StationFault>> Judge(const GeocomCall& call,
                                                          std::string_view line);
  Result<GeocomAnswer, StationFault> OnTimeout();
  void AbortIfAsked(ByteLink::SteadyTime* deadline);

  const std::unique_ptr<ByteLink> link_;
  const Clock& clock_;
  int transaction_;
  LineChecksum checksum_ = LineChecksum::kNone;
  bool last_reply_had_checksum_ = false;
  bool has_sent_abort_ = false;
  int timeouts_in_a_row_ = 0;
  GeocomLineCutter cutter_;
  std::atomic<bool> abort_requested_ = false;
  StationCounters counters_;
};

}  // namespace tbm
