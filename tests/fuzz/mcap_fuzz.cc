// Arbitrary bytes as a journal: what is read lies inside them, and a message that is handed out is
// one of a channel that was declared. What repair makes of them is whole and holds as much.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <functional>

#include "guidance/journal/mcap_reader.h"
#include "guidance/journal/mcap_repair.h"

namespace {

void RepairAndReadAgain(tbm::BytesView file) {
  const auto repair = tbm::RepairMcap(file, "fuzz");
  if (!repair) return;
  const auto again = tbm::ReadMcap(repair->bytes, {});
  if (!again || !again->has_footer || !again->damages.empty()) std::abort();
  if (again->messages != repair->content.messages) std::abort();
  if (repair->losses.size() < repair->content.damages.size()) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const tbm::BytesView file = std::as_bytes(std::span(data, size));
  const std::less_equal<const std::byte*> not_behind;
  std::uint64_t messages = 0;
  const auto content =
      tbm::ReadMcap(file, [&](const tbm::McapChannel&, const tbm::McapMessage& message) {
        ++messages;
        const std::byte* const begin = message.data.data();
        if (!message.data.empty() &&
            !(not_behind(file.data(), begin) &&
              not_behind(begin + message.data.size(), file.data() + size))) {
          std::abort();
        }
      });
  RepairAndReadAgain(file);
  if (!content) return 0;
  if (content->messages != messages || (messages > 0 && content->channels.empty())) std::abort();
  for (const tbm::McapDamage& damage : content->damages) {
    if (damage.offset >= size) std::abort();
  }
  return 0;
}
