#include "guidance/app/journal_options.h"

#include <CLI/CLI.hpp>

namespace tbm {
namespace {

constexpr const char* kRecordHelp =
    "Writes every sample of every topic into FOLDER, as MCAP files that are named after their "
    "time:\n"
    "journal_YYYYMMDDTHHMMSSZ_NNN.mcap. Log time is when a sample came, publish time when it was "
    "sent.\n"
    "A power cut costs the last second at most. Oldest files go when --limit-mb is reached.\n"
    "\n"
    "Examples\n"
    "  tbm record --out journal\n"
    "  tbm record --out journal --interface 192.168.10.5 --seconds 600";

constexpr const char* kRepairHelp =
    "Copies all whole messages of a journal that a power cut, a crash or a bad disk has damaged "
    "into a\n"
    "good one, and says what was lost and where. FILE itself stays as it is.\n"
    "\n"
    "Example\n"
    "  tbm repair journal/journal_20261123T140500Z_007.mcap --out repaired.mcap";

constexpr const char* kExportHelp =
    "Writes one CSV for each topic: FOLDER/guidance.csv, shield_pose.csv, station_observation.csv "
    "and so\n"
    "on, a row for each sample in the order of the journal. JOURNAL is a file or a folder of "
    "them.\n"
    "Columns are named as the fields in idl/*.idl, with their units; before the fields of a point, "
    "a\n"
    "source or a reference stands its name. An empty cell is a number that is not known.\n"
    "Of symmetric matrices the upper triangle is written.\n"
    "\n"
    "Examples\n"
    "  tbm export journal --out tables\n"
    "  tbm export journal --out tables --topic guidance --from 2026-11-23T06:00:00Z --to "
    "2026-11-23T14:00:00Z";

constexpr const char* kReplayHelp =
    "Takes every step of the guidance again from its own journal, in the order of the files, and "
    "compares\n"
    "each message with what was published then, bit for bit. With --machine the same readings go "
    "through\n"
    "another machine file: how far off would the deviations have been? Rig and axis stay the "
    "journal's.\n"
    "\n"
    "Examples\n"
    "  tbm replay journal\n"
    "  tbm replay journal --machine measured_again.yaml";

}  // namespace

void AddNetworkOptions(CLI::App& command, LiveNetwork& network) {
  command.add_option("--domain", network.domain_id, "DDS domain")
      ->check(CLI::Range(0, 232))
      ->capture_default_str();
  command.add_option(
      "--interface", network.interfaces, "address or name of a network interface; 127.0.0.1");
  command.add_option(
      "--peer", network.peers, "address of a machine to look for; none: by multicast");
}

CLI::App* AddRecord(CLI::App& app, JournalRequests& requests) {
  RecordRequest& request = requests.record;
  CLI::App* record = app.add_subcommand("record", "Journal of all live topics");
  record->footer(kRecordHelp);
  record->add_option("--out,-o", request.out, "folder for the files; made when missing")
      ->required();
  AddNetworkOptions(*record, request.network);
  record->add_option("--limit-mb", request.limit_mb, "most that all files in the folder may have")
      ->check(CLI::Range(std::int64_t{1}, std::int64_t{100'000'000}))
      ->capture_default_str();
  record->add_option("--minutes", request.minutes, "length of one file")
      ->check(CLI::Range(0.1, 1440.0))
      ->capture_default_str();
  record->add_option("--seconds", request.seconds, "end after this time; 0: never")
      ->check(CLI::Range(0.0, 1e9));
  return record;
}

CLI::App* AddRepair(CLI::App& app, JournalRequests& requests) {
  RepairRequest& request = requests.repair;
  CLI::App* repair = app.add_subcommand("repair", "A good journal out of a damaged one");
  repair->footer(kRepairHelp);
  repair->add_option("FILE", request.file, "the damaged journal")->required();
  repair->add_option("--out,-o", request.out, "file to write; - is the standard output")
      ->required();
  repair->add_flag("--force,-f", request.force, "replace an existing file");
  return repair;
}

CLI::App* AddExport(CLI::App& app, JournalRequests& requests) {
  ExportRequest& request = requests.exported;
  CLI::App* exported = app.add_subcommand("export", "Tables out of journals");
  exported->footer(kExportHelp);
  exported->add_option("JOURNAL", request.journals, "files, or folders of them")->required();
  exported->add_option("--out,-o", request.out, "folder for the tables; made when missing")
      ->required();
  exported->add_option("--topic", request.topics, "only this one; may be given several times");
  exported->add_option("--from", request.from, "first log time, UTC: 2026-11-23T14:05:00Z");
  exported->add_option("--to", request.to, "last log time");
  exported->add_flag("--force,-f", request.force, "replace existing files");
  return exported;
}

CLI::App* AddReplay(CLI::App& app, JournalRequests& requests) {
  ReplayRequest& request = requests.replay;
  CLI::App* replay = app.add_subcommand("replay", "The guidance's steps again, from its journal");
  replay->footer(kReplayHelp);
  replay->add_option("JOURNAL", request.journals, "files, or folders of them")->required();
  replay->add_option("--machine", request.machine, "machine file instead of the journal's own");
  return replay;
}

}  // namespace tbm
