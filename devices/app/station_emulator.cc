#include "devices/app/station_emulator.h"

#include <utility>

#include <fmt/format.h>

namespace tbm {

Result<std::unique_ptr<StationEmulator>, StationNotStarted> StationEmulator::Start(
    const StationOptions& options,
    std::vector<SimulatedPrism> prisms,
    Timestamp start,
    const Clock& clock) {
  const std::size_t prism_count = prisms.size();
  auto station = BuildStation(options, std::move(prisms), start);
  if (!station) {
    return Failure{StationNotStarted{StationStartFailure::kOptions, station.error()}};
  }
  const std::vector<SimulatedStation::Fault> faults = station->faults;
  std::unique_ptr<StationEmulator> started(new StationEmulator(std::move(station).value(), clock));
  unsigned seed = static_cast<unsigned>(options.errors.seed);
  for (const auto& one : faults) {
    started->emulator_.faults().AddLasting(one.fault, one.ratio, ++seed);
  }
  std::string where;
  if (options.serial_link.empty()) {
    const TcpServer& tcp =
        started->tcp_.emplace(options.address, options.tcp_port, started->emulator_);
    if (!tcp.IsUp()) {
      return Failure{StationNotStarted{
          StationStartFailure::kLink,
          fmt::format("port {} of {} cannot be had: is the address one of this computer, and the "
                      "port free?",
                      options.tcp_port,
                      options.address)}};
    }
    where = fmt::format("address={} port={}", options.address, tcp.port());
  } else {
    if (!started->pty_.emplace(options.serial_link, started->emulator_).IsUp()) {
      return Failure{StationNotStarted{
          StationStartFailure::kLink,
          fmt::format("{}: the link to a pseudo-terminal cannot be made: is its folder there and "
                      "writable, and is no other file of that name in the way?",
                      options.serial_link)}};
    }
    where = fmt::format("serial={}", options.serial_link);
  }
  started->line_ = fmt::format("total_station {} prisms={} serial_number={}",
                               where,
                               prism_count,
                               options.emulator.serial_number);
  return started;
}

}  // namespace tbm
