#pragma once

#include <string>

#include <CLI/CLI.hpp>

#include "guidance/app/exit_code.h"

namespace tbm::hmi {

// `hmi_bridge user ...` and `hmi_bridge token ...`: who may see the console and what they may do.
// Works while the bridge runs: it notices.
class AccountCommands {
 public:
  explicit AccountCommands(CLI::App& app);
  AccountCommands(const AccountCommands&) = delete;
  AccountCommands& operator=(const AccountCommands&) = delete;

  bool IsAsked() const;
  ExitCode Run();

 private:
  CLI::App* users_;
  CLI::App* tokens_;
  CLI::App* add_user_;
  CLI::App* remove_user_;
  CLI::App* set_password_;
  CLI::App* set_role_;
  CLI::App* list_users_;
  CLI::App* add_token_;
  CLI::App* remove_token_;
  CLI::App* list_tokens_;
  std::string config_file_ = "hmi_bridge.yaml";
  std::string name_;
  std::string role_ = "viewer";
};

}  // namespace tbm::hmi
