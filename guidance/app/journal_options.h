#pragma once

#include "guidance/app/export_command.h"
#include "guidance/app/live_network.h"
#include "guidance/app/record_command.h"
#include "guidance/app/repair_command.h"
#include "guidance/app/replay_command.h"

namespace CLI {
class App;
}

namespace tbm {

// All options of the commands that make and read journals, filled in by the parser.
struct JournalRequests {
  RecordRequest record;
  RepairRequest repair;
  ExportRequest exported;
  ReplayRequest replay;
};

// --domain, --interface and --peer of a command that meets the live system.
void AddNetworkOptions(CLI::App& command, LiveNetwork& network);

// Each adds its command.
CLI::App* AddRecord(CLI::App& app, JournalRequests& requests);
CLI::App* AddRepair(CLI::App& app, JournalRequests& requests);
CLI::App* AddExport(CLI::App& app, JournalRequests& requests);
CLI::App* AddReplay(CLI::App& app, JournalRequests& requests);

}  // namespace tbm
