#pragma once

#include <memory>
#include <span>

#include "devices/bus/byte_link.h"
#include "devices/bus/sleeper.h"
#include "devices/imu/counter_clock.h"
#include "devices/imu/inertial_unit_life.h"
#include "devices/imu/stim_config.h"
#include "devices/imu/stim_datagram.h"
#include "pose/base/clock.h"
#include "pose/base/fixed_vector.h"

namespace tbm {

// A Sensonor unit that sends its datagrams by itself, as it was set up with the vendor's tool; it
// is never written to. A datagram becomes a sample or a failure, none is passed over.
//
// A sample's instant is its last byte's arrival, less the datagram's time on the line, less the
// latency it tells, less `constant_delay`; and from this CounterClock takes the port's jitter. For
// half a second after the port was opened there are no samples, only arrivals that are watched.
class StimUnit final : public InertialUnit {
 public:
  // A config without faults (CheckStimConfig).
  StimUnit(StimConfig config, std::unique_ptr<ByteLink> link, const Clock& clock, Sleeper& sleeper);

  Result<InertialSample, InertialFailure> Read(
      std::chrono::steady_clock::time_point deadline) override;
  InertialHealth Health() const override { return life_.At(clock_.Steady()); }

 private:
  using SteadyTime = std::chrono::steady_clock::time_point;
  using Outcome = Result<InertialSample, InertialFailure>;

  // What came in one piece and has not been handed out yet.
  struct Waiting {
    InertialSample sample;
    std::optional<InertialFailure> failure;
  };
  static constexpr std::size_t kPieceBytes = 256;
  // Every outcome uses up a byte at least, of this piece or of what the decoder held.
  static constexpr std::size_t kMostWaiting = kPieceBytes + kStimMaxLength + 1;

  std::optional<InertialFailure> OpenWhenDue(SteadyTime deadline);
  Outcome Fail(InertialFailure failure);
  Outcome TakeWaiting();
  Outcome NothingCame(SteadyTime now);
  void TakeBytes(std::span<const std::uint8_t> bytes, SteadyTime now);
  void TakeDatagram(const StimDatagram& datagram, std::size_t bytes_behind, SteadyTime now);
  Result<CountedTime, CounterClockFailure> Time(const StimDatagram& datagram,
                                                std::size_t bytes_behind,
                                                SteadyTime now);
  std::optional<InertialFailure> Refuses(const StimDatagram& datagram,
                                         const StimReading& reading,
                                         const Result<CountedTime, CounterClockFailure>& time,
                                         SteadyTime now);
  bool IsFrozen(const StimDatagram& datagram, SteadyTime now);
  InertialSample MakeSample(const StimReading& reading, const CountedTime& time);
  void Forget();

  const StimConfig config_;
  const StimFamily family_;
  const std::unique_ptr<ByteLink> link_;
  const Clock& clock_;
  Sleeper& sleeper_;
  InertialUnitLife life_;
  StimDecoder decoder_;
  CounterClock counter_clock_;

  FixedVector<Waiting, kMostWaiting> waiting_;
  std::size_t next_waiting_ = 0;
  Duration civil_minus_steady_{0};

  SteadyTime open_at_{};   // the port is not tried before
  SteadyTime alive_at_{};  // last datagram, or when the port was opened
  SteadyTime heard_at_{};  // last byte
  std::optional<StimDatagram> unchanged_;
  SteadyTime unchanged_since_{};
  std::optional<std::int64_t> last_ticks_;  // of the last sample handed out
};

}  // namespace tbm
