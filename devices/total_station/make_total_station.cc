#include "devices/total_station/make_total_station.h"

#include "devices/total_station/asio_link.h"
#include "devices/total_station/geocom_total_station.h"

namespace tbm {

std::unique_ptr<TotalStation> MakeTotalStation(const TotalStationConfig& config,
                                               const Clock& clock,
                                               Sleeper& sleeper) {
  auto link = config.driver == TotalStationDriver::kGeocomTcp
                  ? MakeTcpLink(config.address, config.tcp_port, config.connect_timeout)
                  : MakeAsioSerialLink(config.port);
  // Differs from one start of the process to the next.
  const auto milliseconds = clock.Now().ns / 1'000'000;
  const int first_transaction = static_cast<int>(milliseconds % kLastTransaction);
  return std::make_unique<GeocomTotalStation>(
      config, std::move(link), first_transaction, clock, sleeper);
}

}  // namespace tbm
