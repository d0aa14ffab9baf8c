#include "guidance/app/export_command.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include <fmt/format.h>

#include "guidance/app/journal_columns.h"
#include "guidance/app/journal_files.h"
#include "guidance/app/journal_reading.h"
#include "guidance/app/output_file.h"
#include "guidance/journal/local_record.h"
#include "idl/cpp/codec.h"
#include "idl/cpp/topics.h"

namespace tbm {
namespace {

namespace fs = std::filesystem;

// Adds a message's cells to a row that has been begun; nothing is added when there is a fault.
using CellAdder = dds::BoundaryFault (*)(BytesView, JournalRow&, const McapMessage&);

struct Topic {
  dds::TopicRow row;
  CellAdder add;
};

template <class Message>
dds::BoundaryFault AddDecoded(BytesView data, JournalRow& row, const McapMessage& facts) {
  Message message;
  const dds::BoundaryFault fault = dds::DecodeCdr(data, &message);
  if (fault != dds::BoundaryFault::kNone) return fault;
  row.Whole("log_time_utc_ns", facts.log_time.ns);
  row.Count("log_sequence", facts.sequence);
  AddCells(row, message);
  return fault;
}

template <class... Messages>
std::vector<Topic> TopicsOf() {
  return {{dds::TopicOf<Messages>(), &AddDecoded<Messages>}...};
}

const std::vector<Topic>& KnownTopics() {
  static const std::vector<Topic> topics = TopicsOf<dds::FrameFeatures,
                                                    dds::TiltReading,
                                                    dds::RelativePose,
                                                    dds::DeviceHealth,
                                                    dds::Event,
                                                    dds::StationObservation,
                                                    dds::StationSetUp,
                                                    dds::ShieldPose,
                                                    dds::Guidance,
                                                    dds::AlarmStatus,
                                                    dds::Command,
                                                    dds::CommandReply,
                                                    dds::TrolleyState,
                                                    dds::RailLinePiece,
                                                    dds::SettlementPiece,
                                                    dds::CalibrationStatus>();
  static_assert(dds::kTopics.size() == 16, "a new topic needs its columns");
  return topics;
}

std::string ShortName(std::string_view topic) {
  return std::string(topic.substr(topic.rfind('/') + 1));
}

// An IDL text without what the digest of the contract leaves out as well: comments and spaces.
std::string Essence(std::string_view idl) {
  std::string essence;
  for (std::size_t i = 0; i < idl.size(); ++i) {
    if (idl.substr(i).starts_with("//")) i = std::min(idl.find('\n', i), idl.size() - 1);
    if (std::string_view(" \t\r\n").find(idl[i]) == std::string_view::npos) essence += idl[i];
  }
  return essence;
}

// Why a channel is not exported; empty when it is.
std::string Foreignness(const McapChannel& channel, const Topic* topic) {
  if (topic == nullptr) return "no topic of this program";
  if (channel.message_encoding != "cdr") {
    return fmt::format("encoding {} instead of cdr", Quoted(channel.message_encoding));
  }
  if (channel.schema.name != topic->row.type) {
    return fmt::format("type {} instead of {}", Quoted(channel.schema.name), topic->row.type);
  }
  if (channel.schema.encoding != "omgidl" ||
      Essence(channel.schema.text) != Essence(dds::IdlTextOf(topic->row.type))) {
    return fmt::format("another version of {}", topic->row.type);
  }
  return "";
}

struct Table {
  JournalTable cells;
  std::string path;
  std::unique_ptr<GrowingOutputFile> file;
  std::uint64_t rows = 0;
};

class Exporting {
 public:
  Exporting(const ExportRequest& request, const Console& console)
      : request_(request), console_(console) {}

  ExitCode Run() {
    if (!ReadLimits() || !FindTopics() || !FindFiles()) return ExitCode::kBadInput;
    if (const auto fault = MakeFolder(request_.out)) return Refuse(*fault);
    Progress progress(console_, "tbm export", 2 * sources_.size());
    std::size_t done = 0;
    for (Source& source : sources_) {
      ReadOnce(source);
      progress.Show(++done);
    }
    ReportRefused();
    if (tables_.empty()) return Refuse("nothing to export: none of the messages asked for");
    for (auto& [topic, table] : tables_) {
      table.path = (fs::path(request_.out) / (ShortName(topic) + ".csv")).string();
      if (const auto obstacle = OutputFile(table.path, request_.force).Obstacle()) {
        return Refuse(*obstacle);
      }
      table.file = std::make_unique<GrowingOutputFile>(table.path, request_.force);
      table.cells.BeginWriting();
    }
    is_writing_ = true;
    for (const Source& source : sources_) {
      if (const auto fault = WriteOnce(source)) return Refuse(*fault);
      progress.Show(++done);
    }
    for (auto& [topic, table] : tables_) {
      if (const auto fault = Flush(table)) return Refuse(*fault);
      if (const auto fault = table.file->Commit()) return Refuse(*fault);
    }
    Report();
    return outcome_;
  }

 private:
  struct Source {
    std::string path;
    std::size_t size = 0;  // what is exported of it: a journal may grow meanwhile
    bool is_usable = false;
  };

  ExitCode Refuse(const std::string& why) {
    Complain(console_, why);
    return ExitCode::kBadInput;
  }

  bool ReadLimits() {
    for (const auto& [text, limit] : {std::pair{&request_.from, &from_}, {&request_.to, &to_}}) {
      if (text->empty()) continue;
      const auto time = UtcFromText(*text);
      if (!time) {
        Complain(console_,
                 fmt::format("{} is no time: wanted is one such as 2026-11-23T14:05:00Z, or "
                             "nanoseconds since 1970",
                             Quoted(*text)));
        return false;
      }
      *limit = *time;
    }
    return true;
  }

  bool FindTopics() {
    for (const std::string& wanted : request_.topics) {
      const auto& known = KnownTopics();
      const auto found = std::find_if(known.begin(), known.end(), [&](const Topic& topic) {
        return topic.row.name == wanted || ShortName(topic.row.name) == wanted;
      });
      if (found == known.end()) {
        std::string names;
        for (const Topic& topic : known) names += " " + ShortName(topic.row.name);
        Complain(console_, fmt::format("--topic {}: there are{}", Quoted(wanted), names));
        return false;
      }
      wanted_.insert(found->row.name);
    }
    return true;
  }

  bool FindFiles() {
    for (const std::string& journal : request_.journals) {
      std::error_code ignored;
      if (!fs::is_directory(journal, ignored)) {
        sources_.push_back({journal});
        continue;
      }
      const auto files = JournalFilesIn(journal);
      if (files.empty()) {
        Complain(console_, journal + ": no journal_*.mcap in this folder");
        return false;
      }
      for (const JournalFile& file : files) sources_.push_back({file.path});
    }
    return true;
  }

  void ReadOnce(Source& source) {
    const auto bytes = ReadJournalBytes(source.path);
    if (!bytes) {
      outcome_ = Refuse(bytes.error());
      return;
    }
    source.size = bytes->size();
    const auto content = ReadMessages(source.path, *bytes);
    if (!content) {
      // A writer that ended at once leaves nothing that could be missed.
      Complain(console_, NoJournalText(source.path, *bytes));
      if (bytes->size() >= mcap::kMagic.size()) outcome_ = ExitCode::kBadInput;
      return;
    }
    source.is_usable = true;
    for (const McapDamage& damage : content->damages) {
      Complain(
          console_,
          fmt::format("{}: at byte {}: {}", source.path, damage.offset, DamageText(damage.kind)));
    }
    if (!IsOnlyCut(*content)) {
      outcome_ = ExitCode::kBadInput;
      Complain(console_, source.path + ": damaged: the rest is exported; see tbm repair");
    }
  }

  std::optional<std::string> WriteOnce(const Source& source) {
    if (!source.is_usable) return std::nullopt;
    const auto bytes = ReadJournalBytes(source.path);
    if (!bytes) return bytes.error();
    if (bytes->size() < source.size) return source.path + ": has become shorter meanwhile";
    (void)ReadMessages(source.path, BytesView(*bytes).first(source.size));
    return write_fault_;
  }

  Result<McapContent, McapFailure> ReadMessages(const std::string& path, BytesView bytes) {
    channels_.clear();
    return ReadMcap(bytes, [&](const McapChannel& channel, const McapMessage& message) {
      if (message.log_time < from_ || message.log_time > to_) return;
      auto known = channels_.find(message.channel);
      if (known == channels_.end()) {
        known = channels_.emplace(message.channel, WantedTopic(path, channel)).first;
      }
      if (known->second != nullptr) AddRow(*known->second, message);
    });
  }

  // Empty when it is not exported.
  const Topic* WantedTopic(const std::string& path, const McapChannel& channel) {
    const auto& known = KnownTopics();
    const auto found = std::find_if(known.begin(), known.end(), [&](const Topic& topic) {
      return topic.row.name == channel.topic;
    });
    const Topic* topic = found == known.end() ? nullptr : &*found;
    // What replay needs, and no topic.
    if (channel.topic == kStepTopic || channel.topic == kFileTopic) return nullptr;
    if (!wanted_.empty() && (topic == nullptr || !wanted_.contains(topic->row.name)))
      return nullptr;
    const std::string foreignness = Foreignness(channel, topic);
    if (foreignness.empty()) return topic;
    const std::string note =
        fmt::format("topic {} is not exported: {}", Quoted(channel.topic), foreignness);
    // Once, however many files say the same.
    if (!is_writing_ && told_.insert(note).second) Complain(console_, path + ": " + note);
    return nullptr;
  }

  void AddRow(const Topic& topic, const McapMessage& message) {
    Table& table = tables_[topic.row.name];
    JournalRow row(table.cells);
    const dds::BoundaryFault fault = topic.add(message.data, row, message);
    if (fault != dds::BoundaryFault::kNone) {
      if (!is_writing_) ++refused_[{topic.row.name, fault}];
      if (table.cells.column_count() == 0) tables_.erase(topic.row.name);
      return;
    }
    table.cells.EndRow();
    if (!is_writing_) return;
    ++table.rows;
    constexpr std::size_t kPiece = 1 << 20;
    if (table.cells.waiting_bytes() >= kPiece && !write_fault_) write_fault_ = Flush(table);
  }

  static std::optional<std::string> Flush(Table& table) {
    return table.file->Append(table.cells.TakeLines());
  }

  void ReportRefused() {
    for (const auto& [what, count] : refused_) {
      outcome_ = ExitCode::kBadInput;
      Complain(
          console_,
          fmt::format(
              "{} samples of {} are left out: {}", count, what.first, dds::FaultText(what.second)));
    }
  }

  void Report() {
    for (const auto& [topic, table] : tables_) {
      if (table.cells.has_left_out_cells()) {
        outcome_ = ExitCode::kBadInput;
        Complain(console_,
                 fmt::format("{}: more than {} different columns: the others are left out",
                             table.path,
                             JournalTable::kMostColumns));
      }
      console_.out << fmt::format("{}: {} rows\n", table.path, table.rows);
    }
  }

  const ExportRequest& request_;
  const Console& console_;
  Timestamp from_{std::numeric_limits<std::int64_t>::min()};
  Timestamp to_{std::numeric_limits<std::int64_t>::max()};
  std::set<std::string_view> wanted_;
  std::set<std::string> told_;
  std::vector<Source> sources_;
  std::map<std::uint16_t, const Topic*> channels_;  // of the file being read
  std::map<std::string_view, Table> tables_;
  std::map<std::pair<std::string_view, dds::BoundaryFault>, std::uint64_t> refused_;
  bool is_writing_ = false;
  std::optional<std::string> write_fault_;
  ExitCode outcome_ = ExitCode::kDone;
};

}  // namespace

ExitCode RunExport(const ExportRequest& request, const Console& console) {
  return Exporting(request, console).Run();
}

}  // namespace tbm
