#include "guidance/app/replay_command.h"

#include <filesystem>
#include <optional>

#include <fmt/format.h>

#include "devices/replay/csv.h"
#include "guidance/app/journal_files.h"
#include "guidance/app/journal_reading.h"
#include "guidance/app/journal_replay.h"
#include "guidance/journal/mcap_reader.h"

namespace tbm {
namespace {

std::vector<std::string> FilesOf(const std::vector<std::string>& journals) {
  std::vector<std::string> files;
  for (const std::string& name : journals) {
    if (!std::filesystem::is_directory(name)) {
      files.push_back(name);
      continue;
    }
    for (const JournalFile& file : JournalFilesIn(name)) files.push_back(file.path);
  }
  return files;
}

std::string Text(const JournalReplay::Report& report) {
  std::string text =
      fmt::format("{} starts of the guidance, {} steps taken again, {} messages compared\n",
                  report.runs,
                  report.steps,
                  report.compared);
  if (report.skipped > 0) {
    text += fmt::format(
        "{} messages before the first start were passed over: a journal can be taken again from "
        "the "
        "start of the process on\n",
        report.skipped);
  }
  if (report.lost > 0) {
    text += fmt::format(
        "{} inputs are missing in the journal (the disk was too slow, or a chunk is damaged)\n",
        report.lost);
  }
  if (report.unreadable > 0) {
    text += fmt::format("{} messages could not be read: another version of the contract?\n",
                        report.unreadable);
  }
  if (report.different == 0) {
    return text + "every message came out bit for bit as it was\n";
  }
  text += fmt::format(
      "{} differ; of the point that one steers by at most {:.4f} mm to the right, {:.4f} mm up\n",
      report.different,
      1e3 * report.largest_right_m,
      1e3 * report.largest_up_m);
  for (const JournalReplay::Difference& one : report.first) {
    text += fmt::format(
        "  step {} at {}: {} {}\n", one.step_number, UtcText(one.at), one.topic, one.what);
  }
  return text;
}

}  // namespace

ExitCode RunReplay(const ReplayRequest& request, const Console& console) {
  std::optional<ReadFile> machine;
  if (!request.machine.empty()) {
    auto text = ReadTextFile(request.machine, 1'000'000);
    if (!text) {
      Complain(console, fmt::format("{}: {}", request.machine, text.error().what));
      return ExitCode::kBadInput;
    }
    machine = ReadFile{request.machine, std::move(text).value()};
  }
  const std::vector<std::string> files = FilesOf(request.journals);
  if (files.empty()) {
    Complain(console, fmt::format("{}: holds no journal", request.journals.front()));
    return ExitCode::kBadInput;
  }
  JournalReplay replay(machine);
  Progress progress(console, "replay", files.size());
  std::size_t done = 0;
  for (const std::string& file : files) {
    const auto bytes = ReadJournalBytes(file);
    if (!bytes) {
      Complain(console, bytes.error());
      return ExitCode::kBadInput;
    }
    const auto content =
        ReadMcap(*bytes, [&replay](const McapChannel& channel, const McapMessage& message) {
          replay.Take(channel, message);
        });
    if (!content) {
      Complain(console, NoJournalText(file, *bytes));
      return ExitCode::kBadInput;
    }
    for (const McapDamage& damage : content->damages) {
      if (IsOnlyCut(*content)) break;
      Complain(console,
               fmt::format("{}: at byte {}: {}", file, damage.offset, DamageText(damage.kind)));
    }
    progress.Show(++done);
  }
  const JournalReplay::Report& report = replay.report();
  for (const std::string& fault : report.faults) Complain(console, fault);
  if (!report.faults.empty()) return ExitCode::kBadInput;
  if (report.steps == 0) {
    Complain(console,
             fmt::format("{}: no start of the guidance stands in it; `tbm record` keeps what was "
                         "said, the guidance's own journal what its steps rest on",
                         files.front()));
    return ExitCode::kBadInput;
  }
  console.out << Text(report);
  const bool is_same = report.different == 0;
  return is_same || machine ? ExitCode::kDone : ExitCode::kInternal;
}

}  // namespace tbm
