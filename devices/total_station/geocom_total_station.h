#pragma once

#include <functional>
#include <memory>
#include <mutex>

#include "devices/bus/sleeper.h"
#include "devices/total_station/geocom_client.h"
#include "devices/total_station/station_life.h"
#include "devices/total_station/total_station_config.h"

namespace tbm {

// A Leica total station behind the port: which GeoCOM calls make a measurement, which may be
// repeated, and what is known when an answer is missing.
//
// Repeated when the answer is lost or damaged: whatever only reads, and settings (telling one twice
// changes nothing). Never repeated: motions and the start of a distance measurement.
class GeocomTotalStation final : public TotalStation {
 public:
  // The config must be free of faults. Clock and sleeper must outlive the driver.
  GeocomTotalStation(TotalStationConfig config,
                     std::unique_ptr<ByteLink> link,
                     int first_transaction,
                     const Clock& clock,
                     Sleeper& sleeper);

  Result<StationIdentity, StationFault> Connect(SteadyTime until) override;
  void Close() override;
  bool IsConnected() const override { return is_set_up_ && client_.IsOpen(); }
  Result<StationPower, StationFault> ReadPower() override;
  Result<double, StationFault> ReadTemperatureCelsius() override;
  Result<Done, StationFault> SetPrismConstant(double constant_m) override;
  Result<Done, StationFault> SetAtmosphere(double ppm) override;
  Result<Done, StationFault> TurnTo(const CircleReading& target, Aim aim) override;
  Result<Done, StationFault> ChangeFace(Aim aim) override;
  Result<Done, StationFault> Search(const SearchWindow& window) override;
  Result<Done, StationFault> FineAdjust(const SearchWindow& window) override;
  Result<Done, StationFault> LockIn() override;
  Result<Done, StationFault> ReleaseLock() override;
  Result<LockState, StationFault> ReadLock() override;
  Result<PolarObservation, StationFault> Measure() override;
  Result<PolarObservation, StationFault> MeasureAngles() override;
  Result<CompensatorReading, StationFault> ReadCompensator() override;
  void RequestAbort() override { client_.RequestAbort(); }
  StationHealth Health() const override;

 private:
  using Answer = Result<GeocomAnswer, StationFault>;
  // What a standing telescope says about a motion whose answer was lost.
  using Outcome = std::function<Result<Done, StationFault>(const CircleReading& standing)>;

  // One call; its outcome is entered into the health.
  Answer Once(const GeocomCall& call);
  // May be repeated.
  Answer Ask(const GeocomCall& call);
  // May be repeated, and only return code 0 is good.
  Answer Plain(int rpc, std::string parameters, std::size_t values);
  Result<Done, StationFault> PlainDone(int rpc, std::string parameters);
  // The new number of a call, or the one of older instruments.
  Result<Done, StationFault> EitherDone(int newer, int older, const std::string& parameters);
  Result<Done, StationFault> Motion(int rpc, std::string parameters, const Outcome& outcome);
  Result<CircleReading, StationFault> WaitUntilStill();
  std::optional<StationFault> SettleFirst();

  std::optional<StationFault> OpenAndSetUp();
  std::optional<StationFault> Wake();
  std::optional<StationFault> AgreeOnChecksum();
  std::optional<StationFault> Probe(LineChecksum checksum);
  Result<StationIdentity, StationFault> Identify();
  void RestoreSettings();
  Result<double, StationFault> ReadOneReal(int rpc);

  // What kGetAngleAndTilt says, read into an observation without a distance.
  Result<PolarObservation, StationFault> AnglesAndTilt();
  Answer AwaitDistance();
  Result<PolarObservation, StationFault> ToObservation(const GeocomAnswer& answer,
                                                       SteadyTime begun) const;
  PolarObservation Stamped(SteadyTime begun, SteadyTime ended) const;
  StationFault Failed(StationFault fault);

  const TotalStationConfig config_;
  const Clock& clock_;
  Sleeper& sleeper_;
  GeocomClient client_;
  StationLife life_;
  bool is_set_up_ = false;
  bool is_motion_open_ = false;  // a motion may be under way whose answer was lost
  bool has_full_measure_ = true;
  std::optional<double> prism_constant_m_;  // as last read back
  std::optional<double> ppm_;
  std::optional<double> wanted_prism_constant_m_;  // as told, restored when connecting
  std::optional<double> wanted_ppm_;

  mutable std::mutex mutex_;
  StationHealth health_;  // what Health() gives; under mutex_
};

}  // namespace tbm
