#include "guidance/app/repair_command.h"

#include <fmt/format.h>

#include "guidance/app/journal_reading.h"
#include "guidance/app/output_file.h"
#include "guidance/journal/mcap_repair.h"

namespace tbm {
namespace {

std::string LossText(const McapLoss& loss) {
  const std::string where =
      fmt::format("  at byte {}: {}", loss.damage.offset, DamageText(loss.damage.kind));
  if (loss.before && loss.behind) {
    return fmt::format(
        "{}; between {} and {}\n", where, UtcText(*loss.before), UtcText(*loss.behind));
  }
  if (loss.before) return fmt::format("{}; after {}\n", where, UtcText(*loss.before));
  if (loss.behind) return fmt::format("{}; before {}\n", where, UtcText(*loss.behind));
  return where + "\n";
}

std::string Report(const RepairRequest& request, const McapRepair& repair) {
  std::string text =
      fmt::format("{}: {} messages in {} chunks, {}\n",
                  request.file,
                  repair.content.messages,
                  repair.content.chunks,
                  repair.content.has_footer ? "closed as it should be"
                                            : "not closed: its writer ended before it could");
  for (const McapLoss& loss : repair.losses) text += LossText(loss);
  for (const auto& [topic, count] : repair.missing) {
    text += fmt::format("  missing: {} of {}, by their sequence numbers\n", count, topic);
  }
  if (repair.losses.empty() && repair.missing.empty()) text += "  nothing is missing\n";
  text += fmt::format("{}: {} bytes", request.out, repair.bytes.size());
  if (repair.first) {
    text += fmt::format(", {} to {}", UtcText(*repair.first), UtcText(*repair.last));
  }
  return text + "\n";
}

}  // namespace

ExitCode RunRepair(const RepairRequest& request, const Console& console) {
  const OutputFile out(request.out, request.force);
  if (const auto obstacle = out.Obstacle()) {
    Complain(console, *obstacle);
    return ExitCode::kBadInput;
  }
  const auto bytes = ReadJournalBytes(request.file);
  if (!bytes) {
    Complain(console, bytes.error());
    return ExitCode::kBadInput;
  }
  const auto repair = RepairMcap(*bytes, request.program);
  if (!repair) {
    Complain(console, NoJournalText(request.file, *bytes));
    return ExitCode::kBadInput;
  }
  const std::string_view mended(reinterpret_cast<const char*>(repair->bytes.data()),
                                repair->bytes.size());
  if (const auto fault = out.Write(mended)) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  // Where the file itself goes to the standard output, the report must not stand in it.
  (request.out == "-" ? console.err : console.out) << Report(request, *repair);
  return ExitCode::kDone;
}

}  // namespace tbm
