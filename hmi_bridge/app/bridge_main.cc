#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include "devices/app/end_signals.h"
#include "devices/app/service_run.h"
#include "guidance/app/exit_code.h"
#include "guidance/config/guidance_file.h"
#include "hmi_bridge/app/account_commands.h"
#include "hmi_bridge/app/bridge_config.h"
#include "hmi_bridge/app/bridge_process.h"
#include "hmi_bridge/app/openapi_text.h"
#include "hmi_bridge/app/web_folder.h"
#include "hmi_bridge/server/auth_store.h"
#include "hmi_bridge/server/console_server.h"
#include "hmi_bridge/server/tls_files.h"
#include "idl/cpp/dds_process.h"
#include "pose/base/clock.h"

namespace tbm::hmi {
namespace {

void Print(const std::vector<std::string>& lines) {
  for (const std::string& line : lines) fmt::print(stderr, "{}\n", line);
}

ExitCode Refuse(const std::vector<std::string>& faults) {
  Print(faults);
  return ExitCode::kBadInput;
}

std::vector<std::string> Texts(const RigFileFaults& faults) {
  std::vector<std::string> texts;
  for (const RigFileFault& fault : faults) texts.push_back(fault.Text());
  return texts;
}

void LogServer(const ServerEvent& event) {
  fmt::print(stderr,
             "source=hmi_bridge code={} name=\"{}\" address={} text=\"{}\"\n",
             Word(event.what),
             event.name,
             event.address,
             event.text);
}

ServerOptions OptionsOf(const BridgeConfig& config) {
  ServerOptions options;
  options.listen = config.listen;
  options.allowed_names = config.names;
  options.openapi_text = std::string(OpenApiText());
  options.product = fmt::format("tbm hmi_bridge {}", TBM_VERSION);
  options.on_event = LogServer;
  if (!config.tls_certificate_file.empty()) {
    options.tls = TlsFiles{config.tls_certificate_file, config.tls_key_file};
  }
  return options;
}

// Its own certificate is made once; a browser is shown the fingerprint to compare it with.
std::optional<std::string> MakeOwnCertificate(const BridgeConfig& config,
                                              const PrivateFolder& state,
                                              const Clock& clock,
                                              ServerOptions* options) {
  const TlsFiles kept{state.PathOf("certificate.pem"), state.PathOf("key.pem")};
  if (!WhyNotTls(kept)) {
    options->tls = kept;
    return {};
  }
  std::vector<std::string> names = config.names;
  for (const ListenAddress& listen : config.listen) names.push_back(listen.address);
  const auto made = MakeSelfSigned(config.state_folder, names, clock);
  if (!made) return made.error();
  options->tls = made->files;
  fmt::print(stderr, "source=hmi_bridge code=certificate_made sha256={}\n", made->sha256);
  return {};
}

std::string UrlOf(const ListenAddress& listen, std::uint16_t port, bool has_tls) {
  const bool is_v6 = listen.address.find(':') != std::string::npos;
  return fmt::format("{}://{}{}{}:{}/",
                     has_tls ? "https" : "http",
                     is_v6 ? "[" : "",
                     listen.address,
                     is_v6 ? "]" : "",
                     port);
}

std::string Absolute(const std::string& path) {
  return path.empty() ? path : std::filesystem::absolute(path).lexically_normal().string();
}

// `tbm` lies beside this program.
ReportPlaces PlacesOf(const BridgeConfig& config, const GuidedMachine& machine) {
  std::error_code ignored;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", ignored);
  AxisFileOptions axis_options;
  const auto file = ParseMachineFile(machine.machine_file.content, machine.machine_file.path);
  if (file) axis_options = file->axis_options;
  return {(program.parent_path() / "tbm").string(),
          Absolute(machine.axis_file.path),
          axis_options,
          Absolute(config.journal_folder)};
}

// What goes into the system's log is read by many: there it is told where the password stands.
void TellFirstUser(const FirstUser& user) {
  if (isatty(STDERR_FILENO) == 0) {
    fmt::print(
        stderr, "source=hmi_bridge code=first_user name={} password_in={}\n", user.name, user.file);
    return;
  }
  fmt::print(
      stderr,
      "\n  The console has no user yet. Log in as\n\n      {}\n      {}\n\n"
      "  and choose another password with `hmi_bridge user password`. Until then it stands in\n"
      "  {} for this computer's user alone.\n\n",
      user.name,
      user.password,
      user.file);
}

ExitCode Run(const BridgeConfig& config,
             const GuidedMachine& machine,
             const WebFolder& web,
             const dds::ParticipantConfig& participant_config) {
  const SystemClock clock;
  auto auth = AuthStore::Open(config.state_folder, clock);
  if (!auth) return Refuse({auth.error()});
  auto state = PrivateFolder::Open(config.state_folder);
  if (!state) return Refuse({state.error()});
  const auto first = auth.value()->MakeFirstUser();
  if (!first) return Refuse({first.error()});

  ServerOptions options = OptionsOf(config);
  options.web_folder = web.folder;
  if (config.tls_self_signed) {
    if (const auto fault = MakeOwnCertificate(config, *state, clock, &options)) {
      return Refuse({*fault});
    }
  }

  HoldSignals();
  signal(SIGPIPE, SIG_IGN);
  dds::AlarmRelay alarms;
  dds::Participant participant(participant_config, alarms.Handler(), dds::LogDds);
  BridgeProcess process(
      ConsoleMachineOf(
          machine.machine, machine.rig, machine.axis, machine.machine_sha256, config.calibrations),
      {TBM_VERSION, web.page_build, config.dds.domain, clock.Now()},
      *state,
      PlacesOf(config, machine),
      participant,
      clock);
  ConsoleServer server(options, process, process, *auth.value(), clock);
  if (const auto faults = server.Start(); !faults.empty()) return Refuse(faults);
  process.Listen(server);
  alarms.SendTo([&process](const dds::Alarm& alarm) { process.Report(alarm); });
  for (std::size_t i = 0; i < config.listen.size(); ++i) {
    fmt::print(stderr,
               "source=hmi_bridge code=listening url={}\n",
               UrlOf(config.listen[i], server.port(i), config.has_tls()));
  }
  if (first.value()) TellFirstUser(*first.value());

  RunService(clock, [&process](const std::stop_token& stop, const auto& on_alive) {
    process.Run(stop, on_alive);
  });
  alarms.SendTo({});
  process.StopListening();
  server.Stop();
  fmt::print(stderr, "source=hmi_bridge code=ended\n");
  return ExitCode::kDone;
}

ExitCode Main(const std::string& config_file, bool check_only) {
  const auto config = LoadBridgeConfig(config_file);
  if (!config) return Refuse(Texts(config.error()));
  MachineFaults warnings;
  const auto machine = LoadGuidedMachine(config->machine_file, &warnings);
  Print(warnings);
  if (!machine) return Refuse(machine.error());
  const auto participant_config =
      dds::ParticipantOf(config->dds, "hmi_bridge " + machine->machine.machine_id);
  std::vector<std::string> faults;
  for (const std::string& problem : dds::Problems(participant_config)) {
    faults.push_back(fmt::format("{}: dds: {}", config_file, problem));
  }
  const auto web = FindWebFolder(config->web_folder);
  if (!web) faults.push_back(fmt::format("{}: web: {}", config_file, web.error()));
  ServerOptions options = OptionsOf(*config);
  // Its own certificate is made when it is needed.
  for (const std::string& problem : Problems(options, config->tls_self_signed)) {
    faults.push_back(fmt::format("{}: {}", config_file, problem));
  }
  if (!faults.empty()) return Refuse(faults);
  if (check_only) {
    fmt::print("{}: good; machine {}, page {} from {}\n",
               config_file,
               machine->machine.machine_id,
               web->page_build,
               web->folder);
    return ExitCode::kDone;
  }
  return Run(*config, *machine, *web, participant_config);
}

}  // namespace
}  // namespace tbm::hmi

int main(int argc, char** argv) {
  CLI::App app(
      "The operator's console: what is said on DDS, for browsers. Without a subcommand it serves "
      "until it is ended.",
      "hmi_bridge");
  std::string config_file;
  bool check_only = false;
  app.add_option("config", config_file, "hmi_bridge.yaml");
  app.add_flag("--check", check_only, "read all files, report every fault, and end");
  app.set_version_flag("--version", std::string(TBM_VERSION));
  tbm::hmi::AccountCommands accounts(app);
  try {
    app.parse(argc, argv);
    if (accounts.IsAsked()) return static_cast<int>(accounts.Run());
    if (config_file.empty()) throw CLI::RequiredError("config");
  } catch (const CLI::ParseError& error) {
    return static_cast<int>(app.exit(error) == 0 ? tbm::ExitCode::kDone : tbm::ExitCode::kBadInput);
  }
  return static_cast<int>(tbm::hmi::Main(config_file, check_only));
}
