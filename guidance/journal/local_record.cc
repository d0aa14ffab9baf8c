#include "guidance/journal/local_record.h"

#include <array>
#include <limits>

namespace tbm {
namespace {

constexpr std::string_view kStepIdl = R"(module tbm {
module local {
// One step of the guidance: it used every input that stands before it and behind the step before.
struct Step {
  long long now_utc_ns;            // [ns] the time that the step was given
  unsigned long long step_number;  // [1] counts from 1
};
};
};
)";
constexpr std::string_view kFileIdl = R"(module tbm {
module local {
// A file that the process read at its start.
struct File {
  string role;              // machine, rig, axis
  string path;              // as the configuration named it
  sequence<octet> content;  // every byte
};
};
};
)";

// RTPS' encapsulation: CDR, little-endian; numbers are aligned from behind it.
constexpr std::array<std::byte, 4> kHead{std::byte{0}, std::byte{1}, std::byte{0}, std::byte{0}};

void PutNumber(Bytes* bytes, std::uint64_t value, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i) {
    bytes->push_back(static_cast<std::byte>(value >> (8 * i) & 0xFFu));
  }
}
void Align(Bytes* bytes) {
  while (bytes->size() % 4 != 0) bytes->push_back(std::byte{0});
}
void PutRaw(Bytes* bytes, std::string_view raw) {
  const std::byte* begin = reinterpret_cast<const std::byte*>(raw.data());
  bytes->insert(bytes->end(), begin, begin + raw.size());
}
// A string counts its closing zero.
void PutText(Bytes* bytes, std::string_view text) {
  Align(bytes);
  PutNumber(bytes, text.size() + 1, 4);
  PutRaw(bytes, text);
  bytes->push_back(std::byte{0});
}

class Reader {
 public:
  explicit Reader(BytesView bytes) : bytes_(bytes) {
    for (std::size_t i = 0; i < kHead.size(); ++i) {
      is_good_ = is_good_ && i < bytes.size() && bytes[i] == kHead[i];
    }
    at_ = kHead.size();
  }

  std::uint64_t Number(std::size_t size) {
    if (!Has(size)) return 0;
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < size; ++i) {
      value |= std::to_integer<std::uint64_t>(bytes_[at_ + i]) << (8 * i);
    }
    at_ += size;
    return value;
  }
  std::string Raw() {
    at_ = (at_ + 3) / 4 * 4;
    const std::uint64_t size = Number(4);
    if (!Has(size)) return {};
    std::string raw(reinterpret_cast<const char*>(bytes_.data()) + at_,
                    static_cast<std::size_t>(size));
    at_ += static_cast<std::size_t>(size);
    return raw;
  }
  std::string Text() {
    std::string text = Raw();
    is_good_ = is_good_ && !text.empty() && text.find('\0') == text.size() - 1;
    if (is_good_) text.pop_back();
    return text;
  }
  bool IsDone() const { return is_good_ && at_ == bytes_.size(); }

 private:
  bool Has(std::uint64_t size) {
    is_good_ = is_good_ && at_ <= bytes_.size() && size <= bytes_.size() - at_;
    return is_good_;
  }

  BytesView bytes_;
  std::size_t at_ = 0;
  bool is_good_ = true;
};

}  // namespace

McapSchema StepSchema() { return {"tbm::local::Step", "omgidl", std::string(kStepIdl)}; }
McapSchema FileSchema() { return {"tbm::local::File", "omgidl", std::string(kFileIdl)}; }

Bytes Encoded(const StepRecord& record) {
  Bytes bytes(kHead.begin(), kHead.end());
  PutNumber(&bytes, static_cast<std::uint64_t>(record.now.ns), 8);
  PutNumber(&bytes, record.step_number, 8);
  return bytes;
}

Bytes Encoded(const FileRecord& record) {
  Bytes bytes(kHead.begin(), kHead.end());
  PutText(&bytes, record.role);
  PutText(&bytes, record.path);
  Align(&bytes);
  PutNumber(&bytes, record.content.size(), 4);
  PutRaw(&bytes, record.content);
  return bytes;
}

std::optional<StepRecord> StepFrom(BytesView bytes) {
  Reader reader(bytes);
  StepRecord record;
  record.now.ns = static_cast<std::int64_t>(reader.Number(8));
  record.step_number = reader.Number(8);
  if (!reader.IsDone() || record.now.ns <= 0 || record.step_number == 0) return {};
  return record;
}

std::optional<FileRecord> FileFrom(BytesView bytes) {
  Reader reader(bytes);
  FileRecord record;
  record.role = reader.Text();
  record.path = reader.Text();
  record.content = reader.Raw();
  if (!reader.IsDone()) return {};
  return record;
}

}  // namespace tbm
