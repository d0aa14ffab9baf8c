#include "guidance/app/ask_command.h"

#include <chrono>
#include <optional>
#include <set>
#include <thread>

#include <fmt/format.h>

#include "idl/cpp/publisher.h"
#include "idl/cpp/request_id.h"
#include "idl/cpp/subscriber.h"
#include "idl/cpp/words.h"
#include "pose/base/clock.h"

namespace tbm {
namespace {

using namespace std::chrono_literals;

constexpr std::chrono::seconds kDiscovery{3};    // for a process that runs to be found
constexpr std::chrono::seconds kFirstAnswer{5};  // within which it says at least "accepted"

ExitCode ExitOf(dds::CommandOutcome outcome) {
  switch (outcome) {
    case dds::CommandOutcome::kAccepted:
    case dds::CommandOutcome::kDone:
      return ExitCode::kDone;
    case dds::CommandOutcome::kRefused:
      return ExitCode::kBadInput;
    case dds::CommandOutcome::kFailed:
      return ExitCode::kDevice;
  }
  return ExitCode::kInternal;
}

// The machine whose devices are heard, when it is one alone.
std::optional<std::string> MachineHeard(dds::Participant& participant, const Console& console) {
  dds::Subscriber<dds::DeviceHealth> health(participant);
  std::set<std::string> machines;
  const auto until = std::chrono::steady_clock::now() + kDiscovery;
  while (std::chrono::steady_clock::now() < until) {
    dds::DeviceHealth heard;
    dds::SampleFacts facts;
    if (health.Take(heard, facts, 100ms)) machines.emplace(heard.machine_id.view());
  }
  if (machines.size() == 1) return *machines.begin();
  Complain(console,
           machines.empty() ? "no machine is heard on this domain and interface"
                            : "several machines are heard: say with --machine which one is meant");
  return {};
}

dds::Command CommandOf(const AskRequest& request, const std::string& machine, Timestamp now) {
  dds::Command command;
  command.machine_id = std::string_view(machine);
  command.request_id = std::string_view(dds::NewRequestId());
  command.addressee = std::string_view(request.addressee);
  command.verb = std::string_view(request.verb);
  command.argument = std::string_view(request.argument);
  command.by = std::string_view(request.by);
  command.because = std::string_view(request.because);
  command.issued_at = now;
  command.expires_at = now + std::chrono::seconds(30);
  return command;
}

}  // namespace

ExitCode RunAsk(const AskRequest& request, const Console& console) {
  const auto config = ParticipantOn(request.network, "tbm_ask", console);
  if (!config) return ExitCode::kBadInput;
  const SystemClock clock;
  dds::Participant participant(*config);
  dds::Subscriber<dds::CommandReply> replies(participant);
  dds::Publisher<dds::Command> commands(participant);
  std::string machine = request.machine;
  if (machine.empty()) {
    const auto heard = MachineHeard(participant, console);
    if (!heard) return ExitCode::kDds;
    machine = *heard;
  }
  const auto looked_until = clock.Steady() + kDiscovery;
  while (commands.matched_readers() == 0 && clock.Steady() < looked_until) {
    std::this_thread::sleep_for(10ms);
  }
  std::this_thread::sleep_for(200ms);  // the others of those who listen
  const dds::Command command = CommandOf(request, machine, clock.Now());
  if (commands.Write(command) != dds::WriteOutcome::kWritten) {
    Complain(console,
             fmt::format("the command cannot be sent: {}",
                         dds::FaultText(commands.counters().refused_because)));
    return ExitCode::kBadInput;
  }
  const auto last = clock.Steady() + std::chrono::duration_cast<std::chrono::nanoseconds>(
                                         std::chrono::duration<double>(request.wait_s));
  auto until = std::min(last, clock.Steady() + kFirstAnswer);
  bool was_accepted = false;
  while (clock.Steady() < until) {
    dds::CommandReply reply;
    dds::SampleFacts facts;
    if (!replies.Take(reply, facts, 100ms) || !(reply.request_id == command.request_id)) continue;
    console.out << fmt::format("{}: {}: {}\n",
                               reply.source.view(),
                               dds::WordOf(reply.outcome),
                               reply.text.view())
                << std::flush;
    if (reply.outcome != dds::CommandOutcome::kAccepted) return ExitOf(reply.outcome);
    was_accepted = true;
    until = last;
  }
  Complain(
      console,
      was_accepted
          ? fmt::format("{} has not said how it ended; it may still be at work", request.addressee)
          : fmt::format(
                "{} does not answer: does it run, for machine {}?", request.addressee, machine));
  return ExitCode::kDds;
}

}  // namespace tbm
