#include "devices/inclinometer/emulator_fault.h"

#include <array>
#include <utility>

namespace tbm {
namespace {

constexpr std::array<std::pair<std::string_view, EmulatorFaultKind>, 8> kWords = {{
    {"drop", EmulatorFaultKind::kDrop},
    {"wrong_check", EmulatorFaultKind::kWrongCheck},
    {"truncated", EmulatorFaultKind::kTruncated},
    {"noise", EmulatorFaultKind::kNoise},
    {"other_id", EmulatorFaultKind::kOtherId},
    {"late", EmulatorFaultKind::kLate},
    {"frozen", EmulatorFaultKind::kFrozen},
    {"out_of_range", EmulatorFaultKind::kOutOfRange},
}};

// Contains both frame headers, each with a possible length behind it: the unkindest noise.
constexpr std::array<std::uint8_t, 5> kNoise = {0xFF, 0x77, 0x0D, 0x68, 0x0F};

}  // namespace

std::optional<EmulatorFaultKind> EmulatorFaultFromWord(std::string_view word) {
  for (const auto& [name, kind] : kWords) {
    if (name == word) return kind;
  }
  return std::nullopt;
}

void FaultQueue::Add(EmulatorFault fault, int replies) {
  const std::lock_guard lock(mutex_);
  for (int i = 0; i < replies; ++i) queue_.push_back(fault);
}

void FaultQueue::Clear() {
  const std::lock_guard lock(mutex_);
  queue_.clear();
  lasting_.reset();
}

void FaultQueue::SetLasting(std::optional<EmulatorFault> fault) {
  const std::lock_guard lock(mutex_);
  lasting_ = fault;
}

std::optional<EmulatorFault> FaultQueue::Take() {
  const std::lock_guard lock(mutex_);
  std::optional<EmulatorFault> fault = lasting_;
  if (!queue_.empty()) {
    fault = queue_.front();
    queue_.pop_front();
  }
  if (fault) ++taken_;
  return fault;
}

int FaultQueue::taken() const {
  const std::lock_guard lock(mutex_);
  return taken_;
}

std::vector<std::uint8_t> SpoilBytes(std::vector<std::uint8_t> reply, const EmulatorFault& fault) {
  switch (fault.kind) {
    case EmulatorFaultKind::kDrop:
      return {};
    case EmulatorFaultKind::kWrongCheck:
      reply.back() = static_cast<std::uint8_t>(reply.back() ^ 0x5Au);
      return reply;
    case EmulatorFaultKind::kTruncated:
      reply.resize(reply.size() / 2);
      return reply;
    case EmulatorFaultKind::kNoise:
      reply.insert(reply.begin(), kNoise.begin(), kNoise.end());
      return reply;
    case EmulatorFaultKind::kOtherId:
    case EmulatorFaultKind::kLate:
    case EmulatorFaultKind::kFrozen:
    case EmulatorFaultKind::kOutOfRange:
      return reply;
  }
  return reply;
}

void SayReply(std::vector<std::uint8_t> reply,
              const std::optional<EmulatorFault>& fault,
              PtyOutbox::SteadyTime begin,
              const SerialSettings& line,
              PtyOutbox& outbox) {
  if (fault) reply = SpoilBytes(std::move(reply), *fault);
  if (reply.empty()) return;
  auto due = begin + line.LineTime(reply.size());
  if (fault && fault->kind == EmulatorFaultKind::kLate) due += fault->delay;
  outbox.At(due, std::move(reply));
}

}  // namespace tbm
