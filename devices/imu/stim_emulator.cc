#include "devices/imu/stim_emulator.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace tbm {
namespace {

constexpr std::array<std::pair<std::string_view, StimFaultKind>, 8> kWords = {{
    {"drop", StimFaultKind::kDrop},
    {"flipped_bit", StimFaultKind::kFlippedBit},
    {"cut", StimFaultKind::kCut},
    {"noise", StimFaultKind::kNoise},
    {"frozen", StimFaultKind::kFrozen},
    {"saturated", StimFaultKind::kSaturated},
    {"start_up", StimFaultKind::kStartUp},
    {"faulty", StimFaultKind::kFaulty},
}};

// Identifiers of both families among it, and the beginning of a line's end: the unkindest noise.
constexpr std::array<std::uint8_t, 6> kNoise = {0x00, 0xA7, 0x93, 0x0D, 0xA0, 0x90};

void SetStatus(std::uint8_t bits, StimDatagram* datagram) {
  const auto set = [&](std::uint8_t& status) { status = static_cast<std::uint8_t>(status | bits); };
  set(datagram->gyro.status);
  for (auto* cluster : {&datagram->accel,
                        &datagram->tilt,
                        &datagram->gyro_temperature,
                        &datagram->accel_temperature,
                        &datagram->tilt_temperature}) {
    if (*cluster) set((*cluster)->status);
  }
}

}  // namespace

std::optional<StimFaultKind> StimFaultFromWord(std::string_view word) {
  for (const auto& [name, kind] : kWords) {
    if (name == word) return kind;
  }
  return std::nullopt;
}

void StimFaultQueue::Add(StimFaultKind kind, int datagrams) {
  const std::lock_guard lock(mutex_);
  for (int i = 0; i < datagrams; ++i) queue_.push_back(kind);
}

void StimFaultQueue::SetLasting(std::optional<StimFaultKind> kind) {
  const std::lock_guard lock(mutex_);
  lasting_ = kind;
}

std::optional<StimFaultKind> StimFaultQueue::Take() {
  const std::lock_guard lock(mutex_);
  if (queue_.empty()) return lasting_;
  const StimFaultKind kind = queue_.front();
  queue_.pop_front();
  return kind;
}

std::vector<std::uint8_t> SpoilStim(std::vector<std::uint8_t> bytes,
                                    StimFaultKind kind,
                                    std::size_t turn) {
  switch (kind) {
    case StimFaultKind::kDrop:
      return {};
    case StimFaultKind::kFlippedBit: {
      const std::size_t bit = turn * 37 % (8 * bytes.size());
      bytes[bit / 8] = static_cast<std::uint8_t>(bytes[bit / 8] ^ (1u << (bit % 8)));
      return bytes;
    }
    case StimFaultKind::kCut:
      bytes.resize(bytes.size() / 2);
      return bytes;
    case StimFaultKind::kNoise:
      bytes.insert(bytes.begin(), kNoise.begin(), kNoise.end());
      return bytes;
    case StimFaultKind::kFrozen:
    case StimFaultKind::kSaturated:
    case StimFaultKind::kStartUp:
    case StimFaultKind::kFaulty:
      return bytes;
  }
  return bytes;
}

StimEmulator::StimEmulator(SerialSettings line,
                           StimEmulatorSettings settings,
                           StimTruth truth,
                           const Clock& clock)
    : line_(std::move(line)),
      settings_(settings),
      truth_(std::move(truth)),
      clock_(clock),
      server_(line_.path, *this) {}

StimEmulator::SteadyTime StimEmulator::SampleInstant() const {
  const double period_s =
      (1.0 + 1e-6 * settings_.clock_error_ppm) / settings_.scales.sample_rate_hz;
  return *power_on_ + Duration(std::llround(1e9 * period_s * static_cast<double>(sample_)));
}

std::optional<PtyInstrument::SteadyTime> StimEmulator::OnTurn(SteadyTime now, PtyOutbox& outbox) {
  if (!power_on_) {
    power_on_ = now;
    sample_ = 0;
  }
  for (; SampleInstant() <= now; ++sample_) Send(SampleInstant(), now, outbox);
  return SampleInstant();
}

StimDatagram StimEmulator::Sense(Timestamp at, bool is_starting_up) const {
  const StimReading truth = truth_(at);
  StimDatagram datagram = StimFromReading(settings_.family, settings_.id, truth, settings_.scales);
  if (is_starting_up) SetStatus(stim_status::kStartUp, &datagram);
  return datagram;
}

void StimEmulator::Send(SteadyTime sensed, SteadyTime now, PtyOutbox& outbox) {
  const std::optional<StimFaultKind> fault = faults_.Take();
  const bool is_starting_up =
      fault == StimFaultKind::kStartUp || sensed - *power_on_ < settings_.start_up;
  if (fault != StimFaultKind::kFrozen || last_.id == 0) {
    last_ = Sense(clock_.Now() + (sensed - now), is_starting_up);
  }
  StimDatagram datagram = last_;
  const double step = std::round(settings_.counter_hz / settings_.scales.sample_rate_hz);
  datagram.counter =
      static_cast<std::uint8_t>((sample_ * static_cast<std::uint64_t>(step)) & 0xFFu);
  datagram.latency_us = static_cast<std::uint16_t>(
      std::chrono::duration_cast<std::chrono::microseconds>(settings_.latency).count());
  if (fault == StimFaultKind::kSaturated) {
    datagram.gyro.counts[0] = (1 << 23) - 1;
    datagram.gyro.status = static_cast<std::uint8_t>(stim_status::kOverload | 1u);
  }
  if (fault == StimFaultKind::kFaulty) SetStatus(stim_status::kChannel, &datagram);
  ++sampled_;
  auto bytes = EncodeStim(settings_.family, datagram, settings_.has_terminator);
  if (fault) bytes = SpoilStim(std::move(bytes), *fault, sampled_);
  if (bytes.empty()) return;
  const SteadyTime due = sensed + settings_.latency + line_.LineTime(bytes.size());
  outbox.At(due, std::move(bytes));
}

}  // namespace tbm
