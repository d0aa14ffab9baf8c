#include "hmi_bridge/app/account_commands.h"

#include <cstdio>
#include <iostream>
#include <memory>
#include <optional>

#include <fmt/format.h>
#include <termios.h>
#include <unistd.h>

#include "hmi_bridge/app/bridge_config.h"
#include "hmi_bridge/server/auth_store.h"
#include "pose/base/clock.h"

namespace tbm::hmi {
namespace {

// The terminal does not show what is typed until this is gone.
class NoEcho {
 public:
  NoEcho() {
    is_terminal_ = tcgetattr(STDIN_FILENO, &before_) == 0;
    if (!is_terminal_) return;
    termios silent = before_;
    silent.c_lflag &= ~static_cast<tcflag_t>(ECHO);
    tcsetattr(STDIN_FILENO, TCSAFLUSH, &silent);
  }
  ~NoEcho() {
    if (is_terminal_) tcsetattr(STDIN_FILENO, TCSAFLUSH, &before_);
  }
  NoEcho(const NoEcho&) = delete;
  NoEcho& operator=(const NoEcho&) = delete;

 private:
  termios before_{};
  bool is_terminal_ = false;
};

// From the terminal twice, unseen; from a pipe its first line.
std::optional<std::string> AskPassword() {
  const bool is_terminal = isatty(STDIN_FILENO) == 1;
  std::string password;
  std::string again;
  const NoEcho silent;
  if (is_terminal) fmt::print(stderr, "Password: ");
  if (!std::getline(std::cin, password)) return {};
  if (!is_terminal) return password;
  fmt::print(stderr, "\nOnce more: ");
  std::getline(std::cin, again);
  fmt::print(stderr, "\n");
  if (again == password) return password;
  fmt::print(stderr, "the two are not the same\n");
  return {};
}

ExitCode Told(const std::optional<std::string>& fault) {
  if (!fault) return ExitCode::kDone;
  fmt::print(stderr, "{}\n", *fault);
  return ExitCode::kBadInput;
}

void List(AuthStore& store) {
  for (const AuthStore::ListedUser& user : store.ListUsers()) {
    fmt::print("{:<32} {:<9} {} open sessions\n", user.name, Word(user.role), user.open_sessions);
  }
}

void ListTokens(AuthStore& store) {
  for (const ReadToken& token : store.ListTokens()) fmt::print("{}\n", token.name);
}

}  // namespace

AccountCommands::AccountCommands(CLI::App& app)
    : users_(app.add_subcommand("user", "who may log in")),
      tokens_(
          app.add_subcommand("token", "programs that may read: metrics, tools, the site's own")),
      add_user_(users_->add_subcommand("add", "asks for a password, or takes it from a pipe")),
      remove_user_(users_->add_subcommand("remove", "and ends the sessions")),
      set_password_(users_->add_subcommand("password", "sets another one and ends the sessions")),
      set_role_(users_->add_subcommand("role", "sets another role and ends the sessions")),
      list_users_(users_->add_subcommand("list", "names, roles, open sessions")),
      add_token_(tokens_->add_subcommand("add", "prints the token, this once")),
      remove_token_(tokens_->add_subcommand("remove", "it is worth nothing from then on")),
      list_tokens_(tokens_->add_subcommand("list", "names")) {
  users_->require_subcommand(1);
  tokens_->require_subcommand(1);
  for (CLI::App* command : {add_user_,
                            remove_user_,
                            set_password_,
                            set_role_,
                            list_users_,
                            add_token_,
                            remove_token_,
                            list_tokens_}) {
    command->add_option("--config", config_file_, "hmi_bridge.yaml, for its `state`")
        ->capture_default_str();
  }
  for (CLI::App* command :
       {add_user_, remove_user_, set_password_, set_role_, add_token_, remove_token_}) {
    command->add_option("name", name_, "letters, digits, '.', '_', '-'")->required();
  }
  for (CLI::App* command : {add_user_, set_role_}) {
    command->add_option("--role", role_, "viewer, operator or surveyor")
        ->check(CLI::IsMember({"viewer", "operator", "surveyor"}))
        ->capture_default_str();
  }
}

bool AccountCommands::IsAsked() const { return users_->parsed() || tokens_->parsed(); }

ExitCode AccountCommands::Run() {
  const auto config = LoadBridgeConfig(config_file_);
  if (!config) {
    for (const RigFileFault& fault : config.error()) fmt::print(stderr, "{}\n", fault.Text());
    return ExitCode::kBadInput;
  }
  const SystemClock clock;
  const auto opened = AuthStore::Open(config->state_folder, clock);
  if (!opened) return Told(opened.error());
  AuthStore& store = *opened.value();
  const Role role = RoleFromWord(role_).value_or(Role::kViewer);
  if (add_user_->parsed() || set_password_->parsed()) {
    const auto password = AskPassword();
    if (!password) return ExitCode::kBadInput;
    return Told(add_user_->parsed() ? store.AddUser(name_, role, *password)
                                    : store.SetPassword(name_, *password));
  }
  if (remove_user_->parsed()) return Told(store.RemoveUser(name_));
  if (set_role_->parsed()) return Told(store.SetRole(name_, role));
  if (remove_token_->parsed()) return Told(store.RemoveToken(name_));
  if (add_token_->parsed()) {
    const auto token = store.AddToken(name_);
    if (!token) return Told(token.error());
    fmt::print("{}\n", token.value());
    return ExitCode::kDone;
  }
  if (list_users_->parsed()) List(store);
  if (list_tokens_->parsed()) ListTokens(store);
  return ExitCode::kDone;
}

}  // namespace tbm::hmi
