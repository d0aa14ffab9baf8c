// What StationProcess does when it is commanded.
#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "devices/app/station_process.h"
#include "devices/app/station_state_file.h"
#include "guidance/core/alarm_command.h"
#include "pose/base/angle.h"
#include "pose/base/parse_number.h"

namespace tbm {
namespace {

using enum dds::CommandOutcome;
using Kind = KeeperNews::Kind;

std::vector<std::string_view> Split(std::string_view text) {
  std::vector<std::string_view> parts;
  while (true) {
    const std::size_t comma = text.find(',');
    std::string_view part = text.substr(0, comma);
    while (!part.empty() && part.front() == ' ') part.remove_prefix(1);
    while (!part.empty() && part.back() == ' ') part.remove_suffix(1);
    parts.push_back(part);
    if (comma == std::string_view::npos) return parts;
    text.remove_prefix(comma + 1);
  }
}

}  // namespace

void StationProcess::Reply(const dds::Command& command,
                           dds::CommandOutcome outcome,
                           std::string_view text) {
  dds::CommandReply reply;
  reply.machine_id = std::string_view(names_.machine_id);
  reply.request_id = command.request_id;
  reply.source = kStationSource;
  reply.outcome = outcome;
  reply.text = text;
  reply.published_at = clock_.Now();
  sink_.Publish(reply);
}

// A request is carried out once, however often it comes; the reply of the first time stands.
void StationProcess::Obey(const dds::Command& command) {
  const std::string request(command.request_id.view());
  if (std::ranges::find(answered_, request) != answered_.end()) return;
  answered_.push_back(request);
  if (answered_.size() > 64) answered_.erase(answered_.begin());
  const std::string verb(command.verb.view());
  if (clock_.Now() > command.expires_at) {
    const std::lock_guard lock(mutex_);
    Reply(command, kRefused, "it came too late; ask again");
    return;
  }
  if (IsAlarmVerb(verb)) {
    ObeyAlarmVerb(command);
    return;
  }
  ObeyVerb(command, verb);
}

void StationProcess::ObeyVerb(const dds::Command& command, const std::string& verb) {
  const Timestamp now = clock_.Now();
  std::optional<Station> rough;
  const std::string_view argument = command.argument.view();
  if ((verb == "set_up" || verb == "propose_move") && !argument.empty()) {
    const auto station = RoughStation(argument);
    if (!station) {
      const std::lock_guard lock(mutex_);
      Reply(command, kRefused, station.error());
      return;
    }
    rough = *station;
  }
  if (verb == "take_over_move") return TakeOver(command, keeper_.TakenOver(now), true);
  if (verb == "undo_move") return TakeOver(command, keeper_.Undone(), false);

  const std::lock_guard lock(mutex_);
  if (verb == "set_up") {
    Begun(command, keeper_.AskSetUp(rough), {Kind::kSetUpDone}, {Kind::kSetUpFailed});
  } else if (verb == "check_references") {
    Begun(command, keeper_.AskCheck(), {Kind::kCheckGood}, {Kind::kCheckBad});
  } else if (verb == "propose_move") {
    const auto& in_use = keeper_.state().in_use;
    if (!rough && in_use) rough = in_use->station;
    Begun(command,
          keeper_.ProposeMove(rough.value_or(config_.keeper.start), now),
          {Kind::kMoveProposed},
          {Kind::kMoveFailed});
  } else if (verb == "pause") {
    Begun(command, keeper_.Pause(), {Kind::kPaused}, {});
  } else if (verb == "resume" || verb == "give_up_move") {
    const auto asked = verb == "resume" ? keeper_.Resume() : keeper_.GiveUpMove();
    Reply(command, asked ? kDone : kRefused, asked ? *asked : asked.error());
    if (asked) {
      Raise(verb == "resume" ? "resumed" : "station_move", dds::Severity::kInfo, false, *asked);
    }
  } else {
    Reply(command,
          kRefused,
          "known are set_up, check_references, propose_move, take_over_move, give_up_move, "
          "undo_move, pause, resume, acknowledge, shelve and unshelve");
  }
}

// A new round ends the one that somebody is waiting for.
void StationProcess::Begun(const dds::Command& command,
                           const StationKeeper::Asked& asked,
                           std::vector<Kind> done,
                           std::vector<Kind> failed) {
  if (!asked) {
    Reply(command, kRefused, asked.error());
    return;
  }
  for (const Pending& other : pending_) {
    Reply(other.command, kFailed, fmt::format("{} came in between", command.verb.view()));
  }
  pending_.clear();
  Reply(command, kAccepted, *asked);
  if (keeper_.is_paused() && command.verb.view() == "pause") {
    Reply(command, kDone, *asked);
    return;
  }
  pending_.push_back({command, std::move(done), std::move(failed)});
}

// First on disk, then in use: whoever is killed in between finds the old state or the new one.
void StationProcess::TakeOver(const dds::Command& command,
                              Result<KeptStation, std::string> changed,
                              bool is_move) {
  if (!changed) {
    const std::lock_guard lock(mutex_);
    Reply(command, kRefused, changed.error());
    return;
  }
  if (const int error = SaveKeptStation(config_.state_file, *changed); error != 0) {
    const std::lock_guard lock(mutex_);
    Reply(command,
          kFailed,
          fmt::format("{} cannot be written: {}; nothing has changed",
                      config_.state_file,
                      std::generic_category().message(error)));
    return;
  }
  const std::uint64_t number = changed->in_use->number;
  if (is_move) {
    keeper_.AdoptTakenOver(std::move(changed).value());
  } else {
    keeper_.AdoptUndone(std::move(changed).value());
  }
  saved_revision_ = keeper_.revision();
  const std::string text =
      is_move ? fmt::format("set-up {} is in use; undo_move goes back", number)
              : fmt::format("back to set-up {}; suspect until its references are found", number);
  const std::lock_guard lock(mutex_);
  Raise("station_move", dds::Severity::kInfo, false, text);
  Reply(command, kDone, text);
}

void StationProcess::ObeyAlarmVerb(const dds::Command& command) {
  const std::lock_guard lock(mutex_);
  const auto order =
      AlarmOrderOf(board_, command.verb.view(), command.argument.view(), command.because.view());
  if (!order) {
    Reply(command, kRefused, order.error());
    return;
  }
  Carry(*order, clock_.Now(), &board_);
  if (order->verb == AlarmVerb::kAcknowledge) acknowledged_by_[order->rule] = command.by;
  if (order->verb == AlarmVerb::kShelve) shelved_by_[order->rule] = command;
  Reply(command, kDone, DoneText(*order));
}

Result<Station, std::string> StationProcess::RoughStation(std::string_view argument) {
  const std::string wanted =
      "wanted E,N,U in m and the bearing of the circle's zero in degrees, or the name of the "
      "reference that the telescope is aimed at";
  const auto parts = Split(argument);
  if (parts.size() != 4) return Failure{wanted};
  std::array<double, 3> p{};
  for (std::size_t i = 0; i < p.size(); ++i) {
    const auto number = ParseReal(parts[i]);
    if (!number || !(std::abs(*number) < 1e8)) return Failure{wanted};
    p[i] = *number;
  }
  Station station{{p[0], p[1], p[2]}, 0.0};
  if (const auto zero_deg = ParseReal(parts[3])) {
    if (!(std::abs(*zero_deg) <= 360.0)) return Failure{wanted};
    station.circle_zero_bearing_rad = Turn(DegToRad(*zero_deg));
    return station;
  }
  const auto angles = instrument_.MeasureAngles();
  if (!angles) {
    return Failure{fmt::format("where the telescope looks cannot be read: {}",
                               FailureSentence(angles.error().why))};
  }
  const PolarReading reading =
      Reduced({angles->circles.horizontal_rad, angles->circles.zenith_rad, {}, angles->face}, {});
  const auto zero_rad =
      keeper_.CircleZeroFrom(station.p_axes_in_site, parts[3], reading.circle_rad);
  if (!zero_rad) return Failure{wanted};
  station.circle_zero_bearing_rad = *zero_rad;
  return station;
}

}  // namespace tbm
