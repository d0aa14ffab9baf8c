#pragma once

#include <chrono>
#include <map>
#include <mutex>
#include <optional>
#include <string>

#include "devices/bus/pty_server.h"
#include "devices/total_station/emulated_instrument.h"
#include "devices/total_station/geocom_fault.h"
#include "devices/total_station/geocom_protocol.h"
#include "pose/base/clock.h"

namespace tbm {

// How an instrument takes a request that carries a checksum.
enum class EmulatedChecksum {
  kKnown,    // answers with one
  kRefused,  // code 3110 of the transport
  kPlain,    // answers without one
  kMute,     // firmware that does not take it for a request
};

struct GeocomEmulatorOptions {
  std::string model = "TS16 A";
  std::int64_t serial_number = 3'512'345;
  EmulatedChecksum checksum = EmulatedChecksum::kKnown;
  bool is_old = false;                  // the calls of the TPS1100 only: 3081 for newer ones
  bool is_licensed = true;              // robotic functions; else return code 27
  bool ignores_prism_constant = false;  // says done, and keeps that of its prism type
  int battery_percent = 87;
  int temperature_celsius = 21;
  std::chrono::nanoseconds think_time = std::chrono::milliseconds(5);
  std::chrono::nanoseconds distance_time = std::chrono::milliseconds(900);
  std::chrono::nanoseconds recognition_time = std::chrono::milliseconds(600);
  double turn_rad_per_s = 0.785;
};

// The instrument's end of a GeoCOM line, for a PtyServer, a TcpServer or an EmulatorLink: requests
// in, replies out, each after the time that it takes. One request at a time: another that comes
// meanwhile is refused with 3107. A lone 'c' stops a motion.
class GeocomEmulator final : public PtyInstrument {
 public:
  GeocomEmulator(GeocomEmulatorOptions options, EmulatedInstrument instrument, const Clock& clock);

  // From any thread: looks at or changes the instrument while no call is being carried out.
  template <class Function>
  auto With(Function function) {
    const std::lock_guard lock(mutex_);
    return function(instrument_);
  }
  template <class Function>
  void Change(Function function) {
    const std::lock_guard lock(mutex_);
    function(options_);
  }
  // The next request only wakes it.
  void FallAsleep();

  GeocomFaultQueue& faults() { return faults_; }
  // How often a call was carried out, and how many requests came in all.
  int carried_out(int rpc) const;
  int requests() const;

  void OnPlug() override;
  void OnBytes(std::span<const std::uint8_t> bytes, SteadyTime now, PtyOutbox& outbox) override;
  std::optional<SteadyTime> OnTurn(SteadyTime now, PtyOutbox& outbox) override;

 private:
  // What a call comes to, known when it begins; said when it is due.
  struct Outcome {
    int return_code = 0;
    std::string values;  // joined by commas; empty for none
    std::chrono::nanoseconds takes{0};
    bool is_motion = false;
  };
  struct Pending {
    SteadyTime begun{};
    SteadyTime due{};
    std::string reply;
    std::optional<GeocomFault> fault;
    int transaction = 0;
    bool with_checksum = false;
    bool is_motion = false;
    CircleReading from;
  };

  void OnLine(std::string_view line, SteadyTime now, PtyOutbox& outbox);
  void OnRequest(const GeocomRequest& request, SteadyTime now, PtyOutbox& outbox);
  void Abort(SteadyTime now);
  void Say(const Pending& pending, PtyOutbox& outbox);
  void SayNow(const std::string& reply, SteadyTime now, PtyOutbox& outbox);
  std::string BitFlipped(std::string reply);

  // Empty: no such procedure.
  std::optional<Outcome> CarryOut(const GeocomRequest& request, SteadyTime now);
  std::optional<Outcome> Settings(int rpc, const std::vector<double>& p);
  std::optional<Outcome> Motions(int rpc, const std::vector<double>& p, SteadyTime now);
  std::optional<Outcome> Measurements(int rpc, const std::vector<double>& p, SteadyTime now);
  Outcome Turned(const CircleReading& to, bool finds_prism, SteadyTime now);
  Outcome Found(double horizontal_window_rad, double zenith_window_rad, SteadyTime now);
  Outcome Measured(int rpc, std::chrono::nanoseconds wait, SteadyTime now);
  Outcome Angles(int rpc, SteadyTime now);
  void MeasureUntil(SteadyTime now);
  int CodeOfAngles() const;
  Timestamp CivilAt(SteadyTime when) const;

  const Clock& clock_;
  mutable std::mutex mutex_;
  GeocomEmulatorOptions options_;
  EmulatedInstrument instrument_;
  GeocomFaultQueue faults_;

  GeocomLineCutter cutter_;
  std::optional<Pending> pending_;
  std::string last_reply_;
  std::map<int, int> carried_out_;
  int requests_ = 0;
  unsigned bit_errors_ = 0;
  bool is_asleep_ = false;
  bool has_recognition_ = false;  // target recognition switched on
  bool has_lock_ = false;

  // The distance meter: measuring until then, and what it has. Turning away does not make it
  // forget.
  std::optional<SteadyTime> distance_ready_;
  std::optional<double> slope_m_;
  std::optional<CircleReading> circles_;  // read with the distance
};

}  // namespace tbm
