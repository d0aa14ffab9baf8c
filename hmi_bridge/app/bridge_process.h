#pragma once

#include <functional>
#include <memory>
#include <stop_token>

#include "hmi_bridge/app/bridge_config.h"
#include "hmi_bridge/app/report_request.h"
#include "hmi_bridge/core/console_board.h"
#include "hmi_bridge/server/console_source.h"
#include "hmi_bridge/server/private_folder.h"
#include "idl/cpp/alarm.h"
#include "idl/cpp/participant.h"
#include "pose/base/clock.h"

namespace tbm::hmi {

class ConsoleServer;

// What is heard on DDS, for the server, and what people ask, on DDS: the only topic it writes is
// the command topic. Threads: DDS' (each sample), the server's (questions), and Run's.
class BridgeProcess final : public ConsoleSource, public RawSource {
 public:
  BridgeProcess(ConsoleMachine machine,
                BridgeFacts facts,
                const PrivateFolder& state_folder,
                ReportPlaces report_places,
                dds::Participant& participant,
                const Clock& clock);
  ~BridgeProcess() override;

  // Begins to listen on DDS and tells `server`, which outlives StopListening.
  void Listen(ConsoleServer& server);
  void StopListening();

  // Until `stop`: what time alone changes. `on_alive` each time round.
  void Run(const std::stop_token& stop, const std::function<void()>& on_alive);

  void Report(const dds::Alarm& alarm);

  Picture Now() override;
  ApiAnswer History(const HistoryQuestion& question) override;
  ApiAnswer Advance(const AdvanceQuestion& question) override;
  ApiAnswer Ask(const CommandRequest& request, const std::string& user, Role role) override;
  ApiAnswer StartReport(std::string_view json, const std::string& user, Role role) override;
  std::shared_ptr<const std::string> ReportFile(std::string_view id,
                                                std::string_view name) override;
  std::string Metrics() override;
  const std::vector<RawChannel>& Channels() const override;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tbm::hmi
