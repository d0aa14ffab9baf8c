#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "guidance/journal/mcap_reader.h"
#include "pose/base/result.h"

namespace tbm {

// The bytes of a journal file. Errors: a sentence that names the file.
Result<Bytes, std::string> ReadJournalBytes(const std::string& path);

// Why a file that is no journal is none.
std::string NoJournalText(const std::string& path, BytesView bytes);

// "a chunk whose bytes have changed"
std::string_view DamageText(McapDamageKind kind);

// Whether a file that was not closed ends as one does whose writer lost its power: in the middle of
// its last chunk at most. That is nothing to complain about.
bool IsOnlyCut(const McapContent& content);

// "2026-11-23T14:05:00.250Z"
std::string UtcText(Timestamp time);
// Such a text, with none to nine decimals of the second, or integer nanoseconds. Empty for others.
std::optional<Timestamp> UtcFromText(std::string_view text);

}  // namespace tbm
